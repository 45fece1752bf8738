"""`mitsuba-bsp report`: one page about any results, without a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from conftest import REPORTED, error_line

from mitsuba_bsp.comparison import Options
from mitsuba_bsp.exr import read_exr, write_exr
from mitsuba_bsp.intervals import Interval
from mitsuba_bsp.outcomes import Outcome, outcomes
from mitsuba_bsp.records import ResultsFolder
from mitsuba_bsp.report.anatomy import anatomy_table
from mitsuba_bsp.report.charts import trade_chart
from mitsuba_bsp.report.descriptions import described
from mitsuba_bsp.report.measures import Measure, measures
from mitsuba_bsp.report.page import make_page
from mitsuba_bsp.report.pictures import renderings
from mitsuba_bsp.report.summary import sentences, wins
from mitsuba_bsp.studies.work import QUANTITIES
from mitsuba_bsp.tables_cli import results_folders
from mitsuba_bsp.totals import TotalOptions

Command = Callable[..., subprocess.CompletedProcess[str]]

TREES = ["kd", "normals", "clustered"]


def measure(what: str, **times: float) -> Measure:
    runs = {spec: {repeat: seconds * (1 + repeat / 1000) for repeat in range(3)} for spec, seconds in times.items()}
    return Measure("room", what, "run", "s", runs)


class TestSummary:
    def test_the_quickest_of_ours_wins_and_is_set_against_the_others(self) -> None:
        building = measure("building", native=4, embree=0.5, kd=1, normals=2)
        (win,) = wins([measure("frame", native=6, embree=1, kd=3, normals=2, brute=0.1), building])
        assert (win.spec, win.second, win.time) == ("normals", "kd", "2 s")
        assert win.others == {"native": Interval(3, 3, 3), "embree": Interval(0.5, 0.5, 0.5)}
        assert win.lead == Interval(1.5, 1.5, 1.5) and win.is_clear
        assert win.build_s == pytest.approx(2, rel=0.01) and win.builds == pytest.approx(0.5)
        assert sentences([win]) == [
            "Whole frames (run). The best of our trees is 3.00 times as fast as native and 0.50 times as fast as "
            "embree (geometric mean): normals in room."
        ]

    def test_runs_are_not_mixed(self) -> None:
        fast = measure("frame", native=6, kd=1, normals=2)
        slow = replace(measure("frame", native=2, kd=1, normals=2), run="other")
        assert sentences(list(wins([fast, slow]))) == [
            "Whole frames (run). The best of our trees is 6.00 times as fast as native (geometric mean): kd in room.",
            "Whole frames (other). The best of our trees is 2.00 times as fast as native (geometric mean): kd in room.",
        ]

    def test_what_nobody_else_was_measured_with(self) -> None:
        (win,) = wins([measure("frame", kd=3)])
        assert win.second == "" and win.lead is win.build_s is win.builds is None and not win.is_clear
        assert sentences([win]) == ["Whole frames (run). The best of our trees: kd, our only one, in room."]
        assert not list(wins([measure("frame", native=1, embree=1)]))

    def test_a_lead_within_the_noise_is_not_clear(self) -> None:
        runs = {"kd": {0: 1.0, 1: 1.2, 2: 1.0}, "normals": {0: 1.1, 1: 1.1, 2: 1.1}}
        (win,) = wins([Measure("room", "frame", "run", "s", runs)])
        assert win.spec == "kd" and not win.is_clear
        assert sentences([win]) == ["Whole frames (run). The best of our trees: no clear winner in room (kd, normals)."]
        close = {
            spec: {repeat: 1 + 0.1 * (repeat == number) for repeat in range(3)} for number, spec in enumerate(TREES)
        }
        (win,) = wins([Measure("room", "frame", "run", "s", close | {"ize": dict.fromkeys(range(3), 9.0)})])
        assert sentences([win])[0].endswith("no clear winner in room (kd, normals and 1 more).")

    def test_chance_is_no_lead_though_every_repetition_is_quicker(self) -> None:
        """The interval of three repetitions is their range, which is not one of 95 %."""
        runs = {"normals": {0: 1.0, 1: 1.0, 2: 1.0}, "kd": {0: 1.005, 1: 1.002, 2: 1.22}}
        (win,) = wins([Measure("room", "frame", "run", "s", runs)])
        assert win.spec == "normals" and win.lead.low > 1 and win.rivals == ["kd"] and not win.is_clear

    @pytest.mark.parametrize(("lead", "noise", "clear"), [(1.1, 0.0, True), (1.04, 0.0, False), (1.1, 0.2, False)])
    def test_a_lead_is_more_than_the_noise(self, lead: float, noise: float, clear: bool) -> None:
        """The noise is that of runs of the same tree, here of `native`; at least 5 % whoever was measured."""
        runs = {"kd": dict.fromkeys(range(5), 1.0), "normals": dict.fromkeys(range(5), lead)}
        runs["native"] = {repeat: 2 * (1 + noise) ** repeat for repeat in range(5)}
        (win,) = wins([Measure("room", "frame", "run", "s", runs)])
        assert win.is_clear == clear
        (seeded,) = wins([Measure("room", "frame", "run", "s", runs, varied=["native"])])
        assert seeded.is_clear == (lead > 1.05)

    def test_many_rivals_take_more(self) -> None:
        """What is below 0.05 alone is not so beside three others that differ by chance."""
        runs = {"kd": dict.fromkeys(range(5), 1.0), "normals": dict(enumerate([1.1, 1.12, 1.4, 1.5, 1.15]))}
        rivals = {f"normals:k={k}": dict(enumerate([0.2, 3.0, 1.2, 0.5, 4.0])) for k in (3, 4, 5)}
        alone = Measure("room", "frame", "run", "s", runs, varied=["normals"])
        assert alone.led("kd", ["normals"]) == ["normals"]
        beside = replace(alone, times=runs | rivals, varied=["normals", *rivals])
        assert beside.led("kd", ["normals", *rivals]) == []

    def test_many_trees_and_scenes_stay_readable(self) -> None:
        trees = {f"normals:k={k}": dict.fromkeys(range(3), 1.0) for k in range(3, 33)}
        names = ["room", "feet", "igea", "knot"]
        found = list(wins([Measure(name, "frame", "run", "s", trees) for name in names]))
        assert sentences(found) == [
            "Whole frames (run). The best of our trees: no clear winner in any of the 4 scenes; most often among the "
            "quickest (4 of 4): normals:k=3, normals:k=4, normals:k=5 and 27 more."
        ]

    def test_what_building_takes_is_of_the_same_run_if_it_can(self) -> None:
        tracing, building = measure("rendering", kd=1, normals=2), measure("building", kd=4, normals=1)
        other = replace(measure("building", kd=8), run="other")
        assert [win.build_s for win in wins([tracing, other, building])] == [pytest.approx(4, rel=0.01)]
        assert [win.build_s for win in wins([tracing, other])] == [pytest.approx(8, rel=0.01)]

    def test_one_repetition_does_not_tell_its_noise(self) -> None:
        (win,) = wins([Measure("room", "frame", "run", "s", {"kd": {0: 1.0}, "normals": {0: 2.0}})])
        assert win.spec == "kd" and not win.is_clear and win.rivals == ["normals"]

    def test_trees_that_promise_no_answers_do_not_win(self) -> None:
        quick = ("kd:precision=fast", "kd:precision=epsilon", "normals:early_exit=plane", "brute")
        (win,) = wins([measure("frame", kd=3, normals=4, **dict.fromkeys(quick, 1))])
        assert (win.spec, win.second) == ("kd", "normals")
        assert not list(wins([measure("frame", **{"kd:precision=fast": 1})]))

    def test_a_speed_is_the_one_of_the_tables(self) -> None:
        runs = {"native": {0: 2.0, 1: 6.0, 2: 3.0}, "kd": {0: 1.0, 1: 1.5, 2: 2.0}}
        found = Measure("room", "frame", "run", "s", runs)
        assert found.speedup("kd", "native") == Interval(2, 1.5, 4)
        assert found.speedup("kd", "embree") is None


def text_of(page: str) -> str:
    """Without scripts, styles and tags."""
    return re.sub(r"<(script|style).*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)


class TestPage:
    def test_it_is_one_file_that_needs_nothing_else(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        assert "<h1>A &amp; B</h1>" in page
        outside = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
        assert not re.findall(r"""(?:src|href)=["']?(?!data:|#)[^"' >]+""", outside)
        assert "url(" not in outside

    def test_everything_in_the_folders_is_on_it(self, results: Path) -> None:
        shown = text_of((results / "report.html").read_text())
        for word in ("Measured on: mitsuba 3.9.1", "Rays alone", "Rendering", "Anatomy of the trees", "cpu"):
            assert word in shown
        for title in ("Comparison (compare)", "Replayed rays (rays)", "(heat)"):
            assert title in shown, title

    def test_every_picture_is_described(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        assert all(re.search(r'alt="[^"]{10,}"', tag) for tag in re.findall(r"<img[^>]*>", page))
        figures = re.findall(r'<figure class="scroll"[^>]*><img src="[^"]*" alt="([^"]*)"', page)
        assert len(set(figures)) == 4
        assert all("every pixel of room" in alt and "column an accelerator" in alt for alt in figures)
        assert all("aria-label=" in tag for tag in re.findall(r'<div class="chart"[^>]*>', page))

    def test_figures_are_beside_their_tables(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        assert "All scenes together" not in page
        assert (
            page.count('<figure class="scroll"') == page.partition("Cost images (heat)")[2].count("<figure class") == 4
        )

    def test_equal_images_are_stored_once(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        specs = json.loads(re.search(r"data-specs='([^']*)'", page).group(1).replace("&#34;", '"'))
        assert specs["kd"] == specs["normals"] != specs["native"]
        pictures = json.loads(re.search(r"const pictures = (\{.*?\});</script>", page).group(1))
        assert set(specs.values()) == set(pictures)

    def test_machines_are_kept_apart(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "rays", tmp_path / "one")
        shutil.copytree(results / "rays", tmp_path / "two")
        lines = (tmp_path / "two" / "records.jsonl").read_text().splitlines()
        rows = [{**json.loads(line), "cpu": "another processor"} for line in lines]
        (tmp_path / "two" / "records.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        main = make_page(results_folders(tmp_path), "Two").partition("<main>")[2]
        overview, *own = main.split('<details class="all-of"')
        summaries = overview.split('<section class="overview"')[1:]
        for parts in (summaries, own):
            first, second = map(text_of, parts)
            assert "Machine 2" not in first and "machine 2" not in first and "another processor" not in first
            assert "Machine 1" not in second and "machine 1" not in second and "another processor" in second
        assert all("room, machine" in part for part in own)
        assert all(
            part.count(". The best of our trees") == 1 for part in overview.split('<section class="overview"')[1:]
        )

    def test_the_summary_of_all_machines_comes_first(self, results: Path, tmp_path: Path) -> None:
        for name in ("heat", "rays"):
            shutil.copytree(results / name, tmp_path / name)
            file = tmp_path / name / "records.jsonl"
            file.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "of {name}', file.read_text()))
        page = make_page(results_folders(tmp_path), "Two").partition("<main>")[2]
        summary = text_of(page.partition('<details class="all-of"')[0])
        assert "scene hash" not in summary and "Anatomy" not in summary
        assert summary.index("Machine 1: of rays (rays)") < summary.index("Machine 2: of heat (heat)")
        assert summary.count("No tracing was timed here") == 1
        assert re.findall('<details class="all-of" id="machine-(.)"( open)?>', page) == [("1", " open"), ("2", "")]
        assert page.count("When a tree wins") == 1

    def test_what_was_timed_is_not_denied(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        for spec in ("kd", "normals"):
            file = tmp_path / "compare" / "records.jsonl"
            lines = [line for line in file.read_text().splitlines() if json.loads(line)["spec"] != spec]
            file.write_text("".join(f"{line}\n" for line in lines))
        shown = text_of(make_page(results_folders(tmp_path), "Foreign"))
        assert "None of our trees was timed here" in shown and "No tracing was timed" not in shown

    def test_runs_are_named_where_there_are_several(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "rays", tmp_path / "one")
        head = ">timed</button>"
        assert head not in make_page(results_folders(tmp_path), "One")
        shutil.copytree(results / "rays", tmp_path / "two")
        assert head in make_page(results_folders(tmp_path), "Two")

    @pytest.mark.parametrize(
        ("cpu", "count"), [("AMD EPYC (family 25, model 1), 2 logical cores", 1), ("AMD EPYC, 2 logical cores", 2)]
    )
    def test_processors_without_a_family_are_those_of_their_folder(
        self, results: Path, tmp_path: Path, cpu: str, count: int
    ) -> None:
        for name in ("one", "two"):
            shutil.copytree(results / "rays", tmp_path / name)
            file = tmp_path / name / "records.jsonl"
            rows = [{**json.loads(line), "cpu": cpu} for line in file.read_text().splitlines()]
            file.write_text("".join(json.dumps(row) + "\n" for row in rows))
        page = make_page(results_folders(tmp_path), "Two")
        assert page.count("<h2>Summary") == 1
        heads = [f"<h2>Machine {number}: {cpu} ({name})</h2>" for number, name in ((1, "one"), (2, "two"))]
        assert all((head in page) == (count == 2) for head in heads)

    def test_scenes_of_one_name_are_told_apart(self, results: Path, tmp_path: Path) -> None:
        for name, digest in (("one", "1" * 64), ("two", "2" * 64)):
            shutil.copytree(results / "compare", tmp_path / name, ignore=shutil.ignore_patterns("images"))
            for file in (tmp_path / name).glob("*.jsonl"):
                file.write_text(re.sub('"scene_hash": "[0-9a-f]+"', f'"scene_hash": "{digest}"', file.read_text()))
        shown = text_of(make_page(results_folders(tmp_path), "Two"))
        assert "scene hash 111111111111" in shown and "scene hash 222222222222" in shown
        assert "room 111111" in shown and "room 222222" in shown

    def test_folders_of_one_name_are_told_apart(self, results: Path, tmp_path: Path) -> None:
        for name in ("one/rays", "two/rays"):
            shutil.copytree(results / "rays", tmp_path / name)
        shown = text_of(make_page(results_folders(tmp_path), "Two"))
        assert "Replayed rays (one/rays)" in shown and "Replayed rays (two/rays)" in shown

    def test_every_part_says_how_it_was_measured(self, results: Path) -> None:
        shown = " ".join(text_of((results / "report.html").read_text()).split())
        assert re.search(r"mitsuba-bsp compare: scalar_rgb, \d+x\d+, \d+ spp, \d+ threads?\. mitsuba 3\.9\.1, ", shown)
        assert re.search(r"mitsuba-bsp bench rays: scalar_rgb, 16x16, \d+ spp, 1 thread\. mitsuba 3\.9\.1, ", shown)

    def test_images_that_are_gone_are_left_out(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        page = make_page(results_folders(tmp_path), "No images")
        assert 'class="comparer"' not in page and "Comparison (compare)" in page

    def test_images_of_one_scene_in_two_folders_are_told_apart(self, results: Path, tmp_path: Path) -> None:
        for name in ("one", "two"):
            shutil.copytree(results / "compare", tmp_path / name)
        for image in (tmp_path / "two" / "images").glob("*.exr"):
            write_exr(image, np.stack([0.5 * plane for plane in read_exr(image).values()], axis=2), [], {})
        page = make_page(results_folders(tmp_path), "Two")
        one, two = (set(json.loads(specs).values()) for specs in re.findall("data-specs='([^']*)'", page))
        assert one and two and not one & two

    def test_a_scene_is_shown_where_others_rendered_it(self, results: Path, tmp_path: Path) -> None:
        for name in ("heat", "compare"):
            shutil.copytree(results / name, tmp_path / name)
            file = tmp_path / name / "records.jsonl"
            file.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "of {name}', file.read_text()))
            if name == "compare":
                counters = tmp_path / name / "counters.jsonl"
                counters.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "of {name}', counters.read_text()))
        page = make_page(results_folders(tmp_path), "Two")
        (shown,) = re.findall('<img data-picture="([^"]*)" alt="room, rendered under native [(]compare[)]">', page)
        assert shown in json.loads(re.search(r"const pictures = (\{.*?\});</script>", page).group(1))
        shutil.rmtree(tmp_path / "compare" / "images")
        assert "<img data-picture=" not in make_page(results_folders(tmp_path), "Two")

    def test_jobs_that_failed_are_listed(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        failed = [{"scene": scene, "spec": "ize", "message": f"no memory in {scene}"} for scene in ("room", "attic")]
        (tmp_path / "compare" / "failures.jsonl").write_text("".join(json.dumps(row) + "\n" for row in failed))
        page = make_page(results_folders(tmp_path), "Failed")
        shown = text_of(page)
        assert "2 jobs failed in compare" in shown.partition("scene hash")[0]
        assert page.count("<caption>Failed jobs</caption>") == 2
        scene, together = shown.split("All scenes together")[-2:]
        assert "no memory in room" in scene and "no memory in attic" in together
        assert "Failed jobs" not in (results / "report.html").read_text()

    def test_a_folder_that_cannot_be_read_leaves_the_others_alone(
        self, results: Path, command: Command, tmp_path: Path
    ) -> None:
        for name in ("all/good", "all/bad", "all/empty"):
            shutil.copytree(results / "rays", tmp_path / name)
        (tmp_path / "all" / "bad" / "records.jsonl").write_text('{"scene": "room"}\n')
        (tmp_path / "all" / "empty" / "records.jsonl").write_text("")
        result = command("report", "all")
        assert result.returncode == 0
        sentences = ("all/bad are damaged or of another version", "there are no records in all/empty yet")
        shown = text_of((tmp_path / "all" / "report.html").read_text())
        assert all(text in shown and text in " ".join(result.stderr.split()) for text in sentences)
        assert "Replayed rays (good)" in shown
        shutil.rmtree(tmp_path / "all" / "good")
        assert command("report", "all").returncode == 2

    @pytest.mark.parametrize("error", [RuntimeError("no"), ZeroDivisionError("no"), OSError(5, "no")])
    def test_whatever_is_wrong_with_it(
        self, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
    ) -> None:
        def figures(outcome: Outcome) -> list:
            if outcome.command == "heatmap":
                raise error
            return []

        for name in ("heat", "rays"):
            shutil.copytree(results / name, tmp_path / name)
        monkeypatch.setattr(Outcome, "figures", figures)
        begun, left_out = [], []
        page = make_page(results_folders(tmp_path), "Two", begun.append, left_out.append)
        assert begun == ["heat", "rays"] and "Replayed rays (rays)" in page
        (sentence,) = left_out
        assert sentence.startswith(f"the records in {tmp_path / 'heat'} are") and sentence.endswith(f": {error}")
        with pytest.raises(ValueError, match="no"):
            make_page(results_folders(tmp_path / "heat"), "One")

    def test_an_interruption_is_no_damage(self, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def figures(_: Outcome) -> list:
            raise KeyboardInterrupt

        monkeypatch.setattr(Outcome, "figures", figures)
        with pytest.raises(KeyboardInterrupt):
            make_page(results_folders(results), "All")

    def test_bad_input(self, results: Path, command: Command, tmp_path: Path) -> None:
        assert "there is no folder gone" in error_line(command("report", "gone"))
        (tmp_path / "empty").mkdir()
        assert "there are no records in empty" in error_line(command("report", "empty"))
        shutil.copytree(results / "rays", tmp_path / "rays")
        (tmp_path / "rays" / "records.jsonl").write_text('{"scene": "room"}\n')
        result = command("report", "rays")
        assert result.returncode == 2
        assert "the records in rays are damaged or of another version: a record has no 'mitsuba'" in error_line(result)

    @pytest.mark.parametrize(
        ("change", "sentence"),
        [
            (lambda row: "{", "line 2 of rays/records.jsonl is damaged: it is not a JSON object"),
            (lambda row: "[]", "line 2 of rays/records.jsonl is damaged: it is not a JSON object"),
            (lambda row: json.dumps({k: row[k] for k in row if k != "ns_per_ray"}), "a record has no 'ns_per_ray'"),
            (lambda row: json.dumps(row | {"ns_per_ray": "1"}), "records in rays are damaged or of another version"),
        ],
    )
    def test_a_damaged_record(
        self, results: Path, command: Command, tmp_path: Path, change: Callable[[dict], str], sentence: str
    ) -> None:
        shutil.copytree(results / "rays", tmp_path / "rays")
        lines = (tmp_path / "rays" / "records.jsonl").read_text().splitlines()
        lines[1] = change(json.loads(lines[1]))
        (tmp_path / "rays" / "records.jsonl").write_text("".join(f"{line}\n" for line in lines))
        result = command("report", "rays")
        assert result.returncode == 2
        assert sentence in error_line(result)
        assert not (tmp_path / "rays" / "report.html").exists()


class TestMeasures:
    def outcome(self, folder: Path, **fields: object) -> Outcome:
        """The comparison, with records changed."""
        file = folder / "records.jsonl"
        rows = [json.loads(line) for line in file.read_text().splitlines()]
        file.write_text("".join(json.dumps(row | fields) + "\n" for row in rows))
        (found,) = outcomes(ResultsFolder(folder))
        return found

    def test_times_of_trees_that_were_loaded_are_not_times_of_building(self, results: Path, tmp_path: Path) -> None:
        folder = Path(shutil.copytree(results / "compare", tmp_path / "compare"))
        assert [measure.what for measure in measures(self.outcome(folder))] == ["rendering", "building"]
        loaded = self.outcome(folder, statistics={"loaded": True})
        assert [measure.what for measure in measures(loaded)] == ["rendering"]

    def test_speeds_of_a_comparison_are_those_of_its_table(self, results: Path, tmp_path: Path) -> None:
        found = self.outcome(Path(shutil.copytree(results / "compare", tmp_path / "compare")))
        rendering, table = next(measures(found)), found.tables()[0]
        place = table.head.index("x native")
        shown = {spec: str(rendering.speedup(spec, "native")) for spec in REPORTED}
        assert shown == {row[0]: row[place] for row in table.rows}

    def test_images_of_another_machine_are_not_shown(self, results: Path, tmp_path: Path) -> None:
        folder = Path(shutil.copytree(results / "compare", tmp_path / "compare"))
        assert renderings(self.outcome(folder))
        assert not renderings(self.outcome(folder, cpu="another processor"))

    @pytest.mark.parametrize(("seconds", "text"), [(0.01234, "0.0123 s"), (99.4, "99.4 s"), (1234.5, "1,234 s")])
    def test_a_time_in_words(self, seconds: float, text: str) -> None:
        assert Measure("room", "frame", "run", "s", {"kd": {0: seconds}}).time("kd") == text


class TestStudies:
    """Whatever times says so, whichever command it is."""

    def found(self, results: Path, folder: Path, command: str, *rows: dict, **options: object) -> dict[str, Measure]:
        (known,) = outcomes(ResultsFolder(results / "compare"))
        lines = [{"scene": "room", "repeat": repeat, **row} for row in rows for repeat in range(2)]
        (folder / "records.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
        kind = TotalOptions if command == "bench auto" else Options
        fields = {name: getattr(known.options, name) for name in known.options.__dataclass_fields__}
        asked = kind(**{**fields, "command": command, **options})
        found = list(measures(replace(known, options=asked, folder=ResultsFolder(folder))))
        assert all(measure.scene == "room" for measure in found)
        return {measure.what: measure for measure in found}

    @pytest.mark.parametrize("study", ["directions", "claims", "cost", "comparison"])
    def test_studies(self, results: Path, tmp_path: Path, study: str) -> None:
        time = {"measure": "time", "threads": 1, "build_s": 3, "render_cpu_s": 2, "render_s": 9}
        kd = {"tree": "kd", "spec": "kd", **time}
        random = {"tree": "random", "spec": "random:seed=0", **time}
        other = {**random, "spec": "random:seed=1", "repeat": 1}
        work = {"measure": "work", "tree": "kd", "spec": "kd"}
        found = self.found(results, tmp_path, f"study {study}", kd, random, other, work)
        assert {what: measure.median("kd") for what, measure in found.items()} == {"rendering": 2, "building": 3}
        assert found["rendering"].varied == ["random"]

    def test_studies_without_times(self, results: Path, tmp_path: Path) -> None:
        work = {"measure": "work", "tree": "kd", "spec": "kd"}
        assert not self.found(results, tmp_path, "study hotspots", work)

    def test_convergence(self, results: Path, tmp_path: Path) -> None:
        points = [{"passes": 1, "seconds": 9}, {"passes": 4, "seconds": 11}]
        row = {"measure": "converge", "tree": "kd", "spec": "kd", "build_s": 3, "points": points}
        found = self.found(results, tmp_path, "study convergence", row)
        assert {what: measure.median("kd") for what, measure in found.items()} == {"a pass": 2, "building": 3}

    def test_trade(self, results: Path, tmp_path: Path) -> None:
        streams = {kind: {"rays": 50, "cpu_s": 1e-6} for kind in ("camera", "shadow", "vertex")}
        row = {"measure": "speed", "tree": "kd", "spec": "kd", "build_s": 3, "streams": streams}
        found = self.found(results, tmp_path, "trade", row, {"measure": "far", "tree": "kd", "spec": "kd"})
        assert found["a ray"].median("kd") == pytest.approx(20) and found["a ray"].unit == "ns"
        assert found["building"].median("kd") == 3

    def test_pictures_of_auto(self, results: Path, tmp_path: Path) -> None:
        kd = {"spec": "kd", "for_spp": 0, "turned": False, "build_s": 3, "frames_s": {"1": 1.5, "2": 2.5}}
        auto = [{**kd, "spec": "auto", "for_spp": spp, "build_s": spp / 8} for spp in (1, 8)]
        turned = {**kd, "turned": True, "frames_s": {"1": 100, "2": 100}}
        found = self.found(results, tmp_path, "bench auto", kd, *auto, turned, spp=2, samples=(1, 8))
        medians = {what: {spec: m.median(spec) for spec in m.times} for what, m in found.items()}
        assert medians == {
            "rendering": {"kd": 2.5},
            "building": {"kd": 3},
            "building and 1 spp": {"kd": 4.5, "auto": 1.625},
            "building and 8 spp": {"kd": 13, "auto": 11},
        }


class TestCharts:
    def test_variants_of_a_tree_are_together_and_told_apart(self) -> None:
        trees = {"ize:axes=plain": 1.0, "native": 5.0, "kd": 2.0, "ize:axes=fast": 3.0}
        chart = trade_chart(measure("rendering", **trees), measure("building", **trees))
        assert [trace["name"] for trace in chart["data"]] == ["kd", "ize:axes=fast", "ize:axes=plain", "native"]
        marks = [(trace["marker"]["color"], trace["marker"]["symbol"]) for trace in chart["data"]]
        assert len(set(marks)) == 4 and marks[1][0] == marks[2][0]

    def test_of_many_trees_the_quickest_are_drawn(self) -> None:
        trees = {f"normals:k={k}": float(k) for k in range(32, 2, -1)}
        chart = trade_chart(measure("rendering", **trees), measure("building", **trees))
        assert {trace["name"] for trace in chart["data"]} == {f"normals:k={k}" for k in range(3, 23)}
        assert chart["title"].endswith("; the 20 quickest of 30")

    def test_trees_are_in_order_in_their_table(self) -> None:
        stats = dict.fromkeys(
            ("nodes", "interior_nodes", "oblique_nodes", "leaves", "empty_leaves", "references", "triangles", "bytes",
             "max_depth"), 4
        )  # fmt: skip
        order = [
            "kd",
            "kd:layout=wide",
            "random:k=3",
            "random:k=16",
            "normals:alpha=0.05",
            "normals:alpha=0.2",
            "native",
        ]
        table = anatomy_table(dict.fromkeys(sorted(order), stats))
        assert [row[0] for row in table.rows] == order


class TestDescriptions:
    def test_every_figure_has_one(self) -> None:
        package = files("mitsuba_bsp")
        sources = [file.read_text() for file in Path(str(package)).rglob("*.py") if "report" not in file.parts]
        names = {name for source in sources for name in re.findall(r'^ +yield f?"([a-z][^"]*)", \w', source, re.M)}
        assert {"claims", "slice-planes-{scene}", "heatmap-{scene}-{quantity}", "growth", "trade-front"} <= names
        for name in names:
            for quantity in QUANTITIES if "{quantity}" in name else ("",):
                drawn = name.format(scene="room", quantity=quantity)
                scene, text = described(drawn, "A study", ["room"])
                assert scene == ("room" if "{scene}" in name else "")
                assert len(text) > 40 and text.endswith(".") and "A study" not in text and "{" not in text, drawn

    def test_names_of_scenes_are_not_words_of_figures(self) -> None:
        scenes = ["planes", "feet", "depth"]
        assert described("slice-planes-feet", "", scenes)[0] == "feet"
        assert described("slice-planes", "", scenes)[0] == "planes"
        assert described("comparison-depth", "", scenes)[0] == ""
        assert described("of-another", "Whole frames", scenes) == ("", "Whole frames: of-another.")


def luminance(colour: str) -> float:
    """WCAG 2.2: of #rrggbb, from 0 to 1."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


@pytest.mark.parametrize("face", [1, 2], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "band"])
@pytest.mark.parametrize("ink", ["ink", "soft", "link"])
def test_text_stands_out(ink: str, ground: str, face: int) -> None:
    """WCAG 2.2 AA: 4.5 to 1."""
    style = (files("mitsuba_bsp.report") / "templates" / "style.css").read_text()
    colours = {m[0]: luminance(m[face]) for m in re.findall(r"--(\w+): light-dark\((#\w{6}), (#\w{6})\)", style)}
    low, high = sorted((colours[ink], colours[ground]))
    assert (high + 0.05) / (low + 0.05) >= 4.5
