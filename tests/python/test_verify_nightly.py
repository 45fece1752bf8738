"""The long checks at a small scale: they pass, they try what they say, and they can fail."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from conftest import WILD_PLY

from mitsuba_bsp import _core
from mitsuba_bsp.image_regression import Setup, render
from mitsuba_bsp.judging import Rendering
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification import (
    checks_exact,
    checks_files,
    checks_image_set,
    checks_memory,
    checks_primary,
    checks_sanitizers,
    checks_soak,
    checks_spawn,
    checks_speed,
    exactness,
)
from mitsuba_bsp.verification.check import Outcome, Plan, all_checks
from mitsuba_bsp.verification.damaged_files import KINDS, damaged, intact
from mitsuba_bsp.verification.meshes import Mesh, of_corners, sphere
from mitsuba_bsp.verification.oracle import brute_force
from mitsuba_bsp.verification.rays import vertex_rays
from mitsuba_bsp.verification.runner import Listener, Result, run
from mitsuba_bsp.verification.sanitizers import MEMCHECK, THREAD, Tool
from mitsuba_bsp.verification.subjects import chosen_subjects, incumbents
from mitsuba_bsp.verification.wrapped import answers, group, to_mitsuba, wrong_answers

Command = Callable[..., subprocess.CompletedProcess[str]]


def result_of(check: str, scale: float, folder: Path | None = None) -> Result:
    plan = Plan(chosen_subjects(["kd", "normals"]), scale=scale, folder=folder)
    (found,) = run([all_checks()[check]], plan, Listener())
    assert found.records
    return found


def figures(found: Result, name: str) -> list[float]:
    return [row["figures"][name] for row in found.records if name in row["figures"]]


class TestExact:
    def test_no_hit_of_a_closed_mesh_is_missed(self) -> None:
        found = result_of("N03", 0.01)
        assert found.passed and sum(found.tried.values()) > 100
        inside = [row for row in found.records if row["judged"]]
        assert len(inside) >= 5 and all(row["figures"][exactness.ERROR] < 2 for row in inside)
        assert all(row["figures"][exactness.OF_REACH] < 2 for row in inside)

    def test_a_test_that_is_not_watertight_is_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(checks_exact, "brute_force", lambda mesh, test="mt": brute_force(mesh, test))
        found = result_of("N03", 0.02)
        assert not found.passed and "misses what exact arithmetic hits" in found.failures[0]

    def test_disputed_rays_are_disputed(self) -> None:
        mesh = sphere("sphere", 10)
        o, d = checks_exact.disputed_rays(mesh, 40, np.random.default_rng(1))
        ends = np.full(len(o), np.inf, np.float32)
        woop, mt = (brute_force(mesh, test).closest(o, d, ends)["triangle"] for test in ("woop", "mt"))
        assert 10 < len(o) <= 40 and (woop != mt).all()

    def test_rates_and_errors_are_published(self) -> None:
        found = result_of("N03", 0.01)
        (table,) = found.check.tables(found.records)
        assert len(table.rows) == len(found.records)
        counts = [int(row[1].replace(",", "")) for row in table.rows]
        assert sum(counts) == sum(row["tried"] for row in found.records)


class TestExtremes:
    def test_the_error_of_the_triangle_test_is_published(self) -> None:
        found = result_of("N07", 0.002)
        assert found.passed
        (table,) = found.check.tables(found.records)
        names = [row[0].partition(",")[0] for row in table.rows]
        assert len(names) == 15 + 13 + 13 and {"moved by 1e7", "aspect 1e12", "scaled by 1e-30"} <= set(names)

    def test_the_choice_of_precision_loses_nothing_there(self) -> None:
        found = result_of("N07p", 0.01)
        assert not found.wrong.get("lost") and len(found.records) == 2 * (15 + 13 + 13)
        assert sum(row["figures"]["fast"] for row in found.records) > 0  # the rays can tell
        (table,) = found.check.tables(found.records)
        assert [row[:2] for row in table.rows] == [("kd", "41 of 41"), ("normals", "41 of 41")]


class TestSpawnedRays:
    def test_mitsubas_offset_suffices_and_less_would(self) -> None:
        found = result_of("N06", 0.01)
        assert found.passed and sum(found.tried.values()) == 10 * 100 * 2
        assert all(0 < least <= 1 for least in figures(found, "least offset without a hit, of Mitsuba's"))

    def test_the_least_offset_of_all_is_published(self) -> None:
        found = result_of("N06", 0.06)
        (table,) = found.check.tables(found.records)
        least = figures(found, checks_spawn.LEAST)
        assert len(least) == 2 and table.rows[0][2] == f"{max(least):.3g}"

    def test_the_incumbents_hits_stand_beside_ours(self) -> None:
        plan = Plan((), incumbents(), seed=1, scale=0.01)
        (unit,) = checks_spawn.spawned_rays(plan)
        found = unit.run().figures
        assert [key for key in found if key.startswith(checks_spawn.HITS)] == [
            f"hits under {spec}" for spec in ("normals", "native", "embree", "embree:robust=true")
        ]

    def test_a_hit_that_rounding_explains_is_mitsubas(self) -> None:
        corners = np.array([[[-10.5, -6.8e7, 0], [-1.9, 7.5e7, 0], [3.8e3, 0, 15]]], np.float32)
        mesh = of_corners("long", corners)
        normal = checks_spawn._normal(mesh)
        on_it = corners[0].astype(float).mean(axis=0)
        assert checks_spawn._within_rounding(mesh, on_it + 0.4 * normal)
        assert not checks_spawn._within_rounding(mesh, on_it + 400 * normal)

    def test_rays_that_hit_their_own_triangle_are_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(checks_spawn, "_normal", lambda mesh: np.array([0.6, 0.0, 0.8]))
        assert not result_of("N06", 0.01).passed


class TestDamagedFiles:
    def test_some_load_and_are_answered_for(self) -> None:
        found = result_of("N08f", 0.01)
        assert found.passed
        assert sum(figures(found, "loaded")) >= 5 and sum(figures(found, "rays")) > 1000

    def test_whole_files_load(self, tmp_path: Path) -> None:
        files = []
        for kind in KINDS:
            files.append(tmp_path / f"{kind}.{kind.partition('-')[0]}")
            files[-1].write_bytes(intact(kind))
        done, death = checks_files._look_at(files, 1)
        assert death is None and all(row["loaded"] and row["wrong"] == 0 and row["rays"] for row in done)

    def test_each_wrong_answer_is_seen(self) -> None:
        """The scene's answers against those about another mesh."""
        mesh, other = sphere("sphere", 6), sphere("larger", 7)
        rays = vertex_rays(mesh, 50, np.random.default_rng(1))
        scene = mi.load_dict({"type": "scene", "group": group(parse_spec("kd"), {"mesh": to_mitsuba(mesh)})})
        right, others = (brute_force(m).closest(*rays, np.full(50, np.inf, np.float32)) for m in (mesh, other))
        given = answers(scene, rays)
        assert not wrong_answers(given, right).any()
        assert wrong_answers(given, others).any()
        hit = right["triangle"] < len(mesh.faces)
        shifted = {**right, "triangle": np.where(hit, right["triangle"] ^ 1, right["triangle"])}
        assert (wrong_answers(given, shifted) == hit).all() and hit.sum() > 20

    def test_damage_is_done_and_is_the_same_again(self) -> None:
        for kind in KINDS:
            first, second, other = (damaged(intact(kind), np.random.default_rng(seed)) for seed in (1, 1, 2))
            assert first == second != other and first != intact(kind)

    def test_what_would_kill_mitsubas_loader_is_refused(self, tmp_path: Path) -> None:
        """It dies of it on its way to vertex normals, without which it is loaded here."""
        (tmp_path / "wild.ply").write_text(WILD_PLY)
        (tmp_path / "good.ply").write_bytes(intact("ply-ascii"))
        done, death = checks_files._look_at([tmp_path / "wild.ply", tmp_path / "good.ply"], 1)
        assert death is None and [(row["loaded"], row["wrong"]) for row in done] == [(False, 0), (True, 0)]

    @pytest.mark.parametrize("end", ["import time; time.sleep(60)", "import os; os.kill(os.getpid(), 9)"])
    def test_all_that_was_reported_counts_before_a_hang_or_a_death(self, end: str) -> None:
        """However many lines come at once, and though the last is not finished."""
        reports = [{"stage": "building kd"}, {"file": 0}, {"stage": "loading"}, {"file": 1}, {"stage": "tracing kd"}]
        text = "noise\n" + "".join(json.dumps(report) + "\n" for report in reports) + '{"file": 2'
        command = [sys.executable, "-c", f"import os; os.write(1, {text.encode()!r}); {end}"]
        done, death = checks_files._watch(command, 3, 1.0)
        assert done == [{"file": 0}, {"file": 1}] and death == ("tracing kd", "hung" if "sleep" in end else "died")

    def test_output_that_reports_nothing_is_a_hang(self) -> None:
        loop = "import time\nwhile True: print('still here', flush=True); time.sleep(0.01)"
        assert checks_files._watch([sys.executable, "-c", loop], 1, 0.5) == ([], ("loading", "hung"))

    def test_a_death_while_building_or_tracing_or_refusing_is_ours(self, monkeypatch: pytest.MonkeyPatch) -> None:
        deaths = iter([("building kd", "died"), ("tracing kd", "hung"), ("refusing", "died")])
        monkeypatch.setattr(checks_files, "_look_at", lambda files, seed: ([], next(deaths, ("loading", "died"))))
        found = result_of("N08f", 0.001)
        assert sum(figures(found, "crashes of Mitsuba's loader")) == 2
        assert found.wrong == {"survival": 3} and "the process died while building kd" in found.failures[0]

    def test_an_index_out_of_range_is_refused_and_spoils_nothing(self, tmp_path: Path) -> None:
        good = intact("ply-ascii")
        (tmp_path / "good.ply").write_bytes(good)
        head, _, body = good.partition(b"end_header\n")
        *vertices, last = body.rstrip(b"\n").split(b"\n")
        count = int(head.split(b"element vertex ")[1].split()[0])
        words = last.split()
        (tmp_path / "wild.ply").write_bytes(
            head + b"end_header\n" + b"\n".join([*vertices, b" ".join([*words[:-1], b"%d" % count])]) + b"\n"
        )
        done, death = checks_files._look_at([tmp_path / "wild.ply", tmp_path / "good.ply"], 1)
        assert death is None and [row["loaded"] for row in done] == [False, True]
        assert [row["wrong"] for row in done] == [0, 0]


class TestMemory:
    def test_trees_keep_to_their_budget(self) -> None:
        found = result_of("N09", 0.005)
        assert found.passed and len(found.records) >= 20

    def test_there_are_24_sizes_up_to_a_million(self) -> None:
        found = checks_memory.sizes(checks_memory.LARGEST)
        assert len(found) == 24 and found[0] == 128 and found[-1] == 1_000_000

    def test_the_curve_is_published(self) -> None:
        found = result_of("N09", 0.0003)
        curves = found.check.tables(found.records)
        assert len(curves) == 3
        for curve in curves:
            assert [row[0] for row in curve.rows] == [f"{n} triangles" for n in (128, 192, 288, 300)]
            assert all(float(cell.replace(",", "")) > 0 for row in curve.rows for cell in row[1:])

    def test_the_peak_is_that_of_the_tree_at_least_every_time(self) -> None:
        found = [figures(result_of("N09", 0.0003), checks_memory.PEAK) for _ in range(2)]
        sizes = figures(result_of("N09", 0.0003), checks_memory.BYTES)
        for peaks in found:
            assert all(peak > size for peak, size in zip(peaks, sizes, strict=True))

    def test_a_smaller_budget_would_be_broken(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(checks_memory, "BUDGETS", {"kd": 5, "rbsp": 5, "normals": 5})
        monkeypatch.setattr(checks_memory, "FIXED_BYTES", 0)
        assert not result_of("N09", 0.0002).passed


class TestPrimaryHits:
    def test_trees_are_with_brute_force_where_others_are_not(self) -> None:
        found = result_of("N12p", 0.1)
        assert found.passed and found.tried == {"rays": 12 * 2 * 100_000}
        (table,) = found.check.tables(found.records)
        assert [row[1] for row in table.rows] == ["100,000"] * 12 and table.rows[0][0] == "sphere"

    def test_a_tree_that_loses_rays_is_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        lost = _core.Accelerator(sphere("elsewhere", 5).vertices + 9, sphere("elsewhere", 5).faces, "kd", {})
        monkeypatch.setattr(checks_primary, "build", lambda *_: lost)
        assert not result_of("N12p", 0.00001).passed


class TestImageSet:
    def test_images_are_embrees_and_furnaces_are_closed(self) -> None:
        found = result_of("N12", 0.01)
        assert found.passed and found.tried["images"] == 2 * (3 * 2 + 2 * 2)
        assert all(abs(mean - 1) < 0.01 for mean in figures(found, "mean"))

    def test_a_hole_in_a_furnace_is_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        whole = sphere("sphere", 10)
        torn = Mesh("torn", whole.vertices, whole.faces[:-20])
        monkeypatch.setattr(checks_image_set, "_furnaces", lambda: {"torn furnace": torn})
        found = checks_image_set._furnace("torn furnace", "kd", 1)
        assert found.wrong["escapes"] and found.wrong["mean"]

    def test_another_image_is_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def wrong(name: str, samples: int, seed: int) -> Rendering:
            return render(checks_image_set._scene("soup", samples), "embree", name, Setup(seed=seed))

        monkeypatch.setattr(checks_image_set, "_reference", wrong)
        assert {"paired", "z"} <= set(checks_image_set._against_embree("room", "kd", 8).wrong)


class TestSanitizers:
    """The tools themselves run in CI and at night, where the first thing to see is whether they see."""

    @staticmethod
    def outcome(monkeypatch: pytest.MonkeyPatch, reports: list[str], code: int, rows: str = "") -> Outcome:
        """What a check is worth of which the tool reports this, and which ends so."""

        def watch(tool: Tool, arguments: list[str], folder: Path) -> tuple[subprocess.CompletedProcess[str], list[str]]:
            (folder / "out").mkdir()
            (folder / "out" / "records.jsonl").write_text(rows)
            return subprocess.CompletedProcess(arguments, code, "", "Killed\n"), reports

        monkeypatch.setattr(Tool, "watch", watch)
        return checks_sanitizers._watch(Plan(chosen_subjects(["kd"])), THREAD, "C07")

    ROW = '{"tried": 9, "wrong": {"time": 1, "copies": %d}, "judged": true, "failures": ["a tie is broken"]}\n'

    def test_reports_deaths_and_wrong_answers_are_seen_but_not_time(self, monkeypatch: pytest.MonkeyPatch) -> None:
        fine = self.outcome(monkeypatch, [], 1, self.ROW % 0)
        assert fine.passed and fine.tried > 9
        reported = self.outcome(monkeypatch, ["data race tree.cpp:7"], 66, self.ROW % 0)
        assert reported.wrong["reports"] == 1 and reported.failures[0].text == "thread, C07: data race tree.cpp:7"
        dead = self.outcome(monkeypatch, [], -9)
        assert dead.wrong["end"] and dead.failures[0].text == "thread, C07: the process ended with -9: Killed"
        wrong = self.outcome(monkeypatch, [], 1, self.ROW % 3)
        assert wrong.wrong["answers"] == 3 and "a tie is broken" in wrong.failures[0].text

    def test_a_blind_tool_is_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        found = subprocess.CompletedProcess([], 0, "", "")
        monkeypatch.setattr(Tool, "watch", lambda *_: (found, ["data race module.c:1"]))
        assert checks_sanitizers._sees(THREAD).wrong == {"unseen": 1}

    def test_of_sanitizers_only_what_concerns_the_core_counts(self, tmp_path: Path) -> None:
        lines = ("    #1 f() tree.cpp:9 (_core.cpython.so+0x17)", "    #1 g() (/lib/_allocations.cpython.so+0x17)")
        for number, line in enumerate((*lines, "    #1 h() (libpython.so+0x17)")):
            (tmp_path / f"report.{number}").write_text(f"WARNING: race\n{line}\n\nSUMMARY: race free.cpp:1\n")
        (tmp_path / "stderr").write_text("a warning\ntree.cpp:9:3: runtime error: signed integer overflow\n")
        assert THREAD.reports(tmp_path) == [
            "tree.cpp:9:3: runtime error: signed integer overflow",
            "race free.cpp:1, from f() tree.cpp:9 (_core.cpython.so+0x17)",
            "race free.cpp:1, from g() (/lib/_allocations.cpython.so+0x17)",
        ]

    def test_a_report_that_ends_with_the_core_itself_is_one_of_its_own(self, tmp_path: Path) -> None:
        ours, theirs = ("race (/lib/_core.cpython.so+0x17)", "race free.cpp:1")
        lines = ("    #0 <null> (_core.cpython.so+0x17)", f"SUMMARY: {ours} ", f"SUMMARY: {theirs}")
        (tmp_path / "report.1").write_text("\n".join(lines))
        (tmp_path / "stderr").write_text("")
        assert THREAD.reports(tmp_path) == [f"{ours}, from <null> (_core.cpython.so+0x17)"]

    def test_of_valgrind_only_what_concerns_the_core_counts(self, tmp_path: Path) -> None:
        frame = "<frame><obj>/{}.so</obj><fn>any</fn><file>tree.cpp</file><line>7</line></frame>"
        error = "<error><kind>InvalidRead</kind><what>Invalid read of size 4</what><stack>{}</stack></error>"
        errors = [error.format(frame.format(name)) for name in ("libpython", "_core.cpython-311")]
        (tmp_path / "report.17").write_text(f"<valgrindoutput>{''.join(errors)}</valgrindoutput>")
        assert MEMCHECK.reports(tmp_path) == ["Invalid read of size 4 tree.cpp:7 in any"]

    def test_without_the_sources_it_is_skipped(self, command: Command, tmp_path: Path) -> None:
        """And not green: who asks for it by name is told."""
        asked = command("verify", "--only", "N11t", "--out", "out")
        assert asked.returncode == 1
        assert "SKIPPED" in asked.stdout and "start it in the folder of a checkout" in asked.stdout
        assert "| N11t" in (tmp_path / "out" / "table.md").read_text()


class TestSoak:
    def test_nothing_is_left(self) -> None:
        found = result_of("N10", 0.002)
        assert found.passed and found.tried["builds"] >= 200 and found.tried["rays"] > 8000

    def test_wrong_answers_and_memory_are_seen(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(checks_soak, "differing", lambda a, b: np.ones(3, bool))
        monkeypatch.setattr(checks_soak, "LEFT_BYTES", -(10**12))
        found = result_of("N10", 0.002)
        assert {"soak", "answers", "memory"} <= set(found.wrong)


class TestSpeed:
    @pytest.fixture(autouse=True)
    def _small(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(checks_speed, "MESHES", {"sphere": lambda: sphere("sphere", 20)})

    def test_the_first_night_has_nothing_to_compare(self, tmp_path: Path) -> None:
        found = result_of("N13", 0.01, tmp_path)
        assert found.passed and len(found.records) == 2 and all(speed > 0 for speed in figures(found, "sphere"))
        assert [row[2] for row in found.check.tables(found.records)[0].rows] == ["-", "-"]

    def test_a_slower_tree_is_seen_but_not_noise(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def night(seed: int, *speeds: float) -> Result:
            measured = iter(speeds)
            monkeypatch.setattr(checks_speed, "_speed", lambda *_: next(measured))
            plan = Plan(chosen_subjects(["kd"]), seed=seed, folder=tmp_path)
            return run([all_checks()["N13"]], plan, Listener())[0]

        assert night(1, 2.0).passed
        assert night(2, 1.91).passed  # within 5 %
        assert night(3, 1.5, 1.6, 2.1).passed  # not again
        slower = night(4, 1.99, 1.9, 1.98)
        assert slower.wrong == {"sphere": 1} and "1.99 times as fast as native, it was 2.10" in slower.failures[0]
        assert slower.check.tables(slower.records)[0].rows == (("kd", "1.99", "2.10"),)
