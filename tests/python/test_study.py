"""What all studies share: the plan is worked off in rounds, can be resumed, and is told apart from other records."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from conftest import scene_xml
from fake_workers import Workers, study

from mitsuba_bsp import cli
from mitsuba_bsp.studies import STUDIES
from mitsuba_bsp.studies.study import Cell, StudyOptions, specs_of, timed_and_counted


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


def options(**choices: Any) -> StudyOptions:
    return StudyOptions((), (), Path(), "scalar_rgb", 1, {}, choices=choices)


def test_a_seeded_cell_has_another_tree_each_time() -> None:
    cell = Cell("time", "normals:k=4", repeats=2, seeded=True)
    assert [cell.spec(repeat).text for repeat in range(2)] == ["normals:k=4,seed=0", "normals:k=4,seed=1"]
    assert Cell("time", "random", 1, True).spec(3).settings["seed"] == 3
    assert Cell("time", "kd", 2).spec(1).text == "kd"
    assert [spec.text for spec in specs_of([cell, Cell("work", "kd", 3)])] == [
        "normals:k=4,seed=0", "normals:k=4,seed=1", "kd",
    ]  # fmt: skip


def test_what_has_no_seed_is_counted_once_and_embree_never() -> None:
    cells = timed_and_counted(["embree", "native", "kd", "normals", "normals:seed=7"], repeats=5)
    found = {(cell.measure, cell.tree): (cell.repeats, cell.seeded) for cell in cells}
    assert found == {
        ("time", "embree"): (5, False),
        ("time", "native"): (5, False),
        ("work", "native"): (1, False),
        ("time", "kd"): (5, False),
        ("work", "kd"): (1, False),
        ("time", "normals"): (5, True),
        ("work", "normals"): (5, True),
        ("time", "normals:seed=7"): (5, False),
        ("work", "normals:seed=7"): (1, False),
    }


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_says_what_it_is(name: str) -> None:
    own = STUDIES[name]
    assert own.name == name and own.help and own.title and len(own.legend) > 100


class TestRunner:
    """`study comparison` stands for all."""

    WORDS = ("--repeats", "3", "--specs", "kd", "normals", "native")

    def test_rounds_are_shuffled_and_hold_everything_once(self, workers: Workers, room: Path, tmp_path: Path) -> None:
        assert study("comparison", room, *self.WORDS, "--out", tmp_path / "out") == 0
        timed = [job.spec for job in workers.jobs if job.kind == "time"]
        turns = [timed[3 * n : 3 * n + 3] for n in range(3)]
        assert [sorted(turn) for turn in turns] == [["kd", "native", f"normals:seed={n}"] for n in range(3)]
        assert len({tuple(word.partition(":")[0] for word in turn) for turn in turns}) > 1
        counted = [job.spec for job in workers.jobs if job.kind == "work"]
        assert sorted(counted) == ["kd", "native", *(f"normals:seed={n}" for n in range(3))]

    def test_records_say_what_was_measured(self, workers: Workers, room: Path, tmp_path: Path) -> None:
        assert study("comparison", room, *self.WORDS, "--out", tmp_path / "out") == 0
        found = rows(tmp_path / "out")
        assert {row["study"] for row in found} == {"comparison"} and {row["triangles"] for row in found} == {30}
        seeded = [row for row in found if row["tree"] == "normals" and row["measure"] == "time"]
        assert {(row["spec"], row["repeat"]) for row in seeded} == {(f"normals:seed={n}", n) for n in range(3)}
        assert all("seed=" in row["spec_full"] for row in seeded)
        assert all("levels" not in row["statistics"] for row in seeded)
        assert any("levels" in row["statistics"] for row in found if row["measure"] == "work")

    def test_it_goes_on_where_it_stopped(
        self, workers: Workers, room: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        words = ("comparison", room, *self.WORDS, "--out", tmp_path / "out")
        workers.failing = {"kd"}
        assert study(*words) == 1
        assert "failed: room, kd: the worker was killed" in capfd.readouterr().out
        workers.failing = set()
        before = len(workers.jobs)
        assert study(*words) == 0
        assert [(job.kind, job.spec) for job in workers.jobs[before:] if job.kind == "time"] == [("time", "kd")] * 3
        assert "10 of 14 jobs were finished" in capfd.readouterr().err
        before, kept = len(workers.jobs), (tmp_path / "out" / "table.md").read_bytes()
        assert study(*words) == 0
        assert len(workers.jobs) == before and (tmp_path / "out" / "table.md").read_bytes() == kept

    def test_studies_do_not_mix(
        self, workers: Workers, room: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        assert study("comparison", room, *self.WORDS, "--out", tmp_path / "out") == 0
        assert study("claims", room, "--out", tmp_path / "out") == 2
        assert "holds records of the study comparison: choose another --out" in " ".join(capfd.readouterr().err.split())
        (tmp_path / "other").mkdir()
        (tmp_path / "other" / "records.jsonl").write_text('{"scene": "room"}\n')
        assert study("claims", room, "--out", tmp_path / "other") == 2
        assert "holds records of another command" in " ".join(capfd.readouterr().err.split())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["comparison", "gone.xml"], "there is no scene file"),
        (["comparison", "empty.xml"], "empty.xml has no triangle mesh, so there is nothing to put into trees"),
        (["comparison", "room.xml", "--specs", "brute"], "brute is no tree to be compared"),
        (["comparison", "room.xml", "--specs", "bvh"], 'there is no accelerator "bvh"'),
        (["comparison", "room.xml", "--repeats", "2"], "--repeats is 2, but it must be at least 3"),
        (["directions", "room.xml", "--repeats", "5"], "--repeats is 5, but it must be at least 6"),
        (["directions", "room.xml", "--trees", "ize"], '"ize" has no number of directions'),
        (["directions", "room.xml", "--k", "99"], "k=99 is not valid"),
        (["directions", "room.xml", "--layouts", "flat"], "layout=flat is not valid"),
        (["planes", "room.xml", "--specs", "embree"], '"embree" looks at no planes that could be counted'),
        (["hotspots", "room.xml", "--specs", "embree"], "Embree does not count its work: leave it out"),
        (["normals", "room.xml", "--specs", "native"], '"native" does not show its planes: leave it out'),
        (["slice", "room.xml", "--specs", "brute"], '"brute" does not show its planes: leave it out'),
        (["cost", "room.xml", "--trees", "kd"], "kd has no setting 'oblique_price'"),
        (["cost", "room.xml", "--out", "room.xml"], "cannot write to the output folder room.xml"),
    ],
)
@pytest.mark.usefixtures("room")
def test_bad_input(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    (tmp_path / "empty.xml").write_text(scene_xml('<shape type="sphere"/>'))
    monkeypatch.chdir(tmp_path)
    before = sorted(path.name for path in tmp_path.iterdir())
    assert study(*words) == 2
    assert sentence in " ".join(capfd.readouterr().err.partition("error: ")[2].split())
    assert sorted(path.name for path in tmp_path.iterdir()) == before


@pytest.mark.parametrize("plane", ["w=1", "x=", "1,2,3", "0,0,0,1", "nan,0,1,2"])
def test_what_is_no_plane(room: Path, capfd: pytest.CaptureFixture[str], plane: str) -> None:
    assert study("slice", room, f"--plane={plane}") == 2
    assert f'"{plane}" is no plane: give x=N' in capfd.readouterr().err


@pytest.mark.parametrize("words", [*(("study", name) for name in STUDIES), ("heatmap",), ("trade",)])
def test_help_shows_defaults_as_they_are_typed(words: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main([*words, "--help"])
    options = capsys.readouterr().out.partition("what is studied:")[2]
    assert "default: " in options or words == ("study", "claims")
    assert not re.search(r"default: [\[(]|', '", options)
