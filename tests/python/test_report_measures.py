"""What a report finds in records: the times of every command, which tree wins, and how they are drawn."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from conftest import REPORTED

from mitsuba_bsp.comparison import Options
from mitsuba_bsp.intervals import Interval
from mitsuba_bsp.outcomes import Outcome, outcomes
from mitsuba_bsp.records import ResultsFolder
from mitsuba_bsp.report.anatomy import anatomy_table
from mitsuba_bsp.report.charts import trade_chart
from mitsuba_bsp.report.measures import Measure, measures
from mitsuba_bsp.report.pictures import renderings
from mitsuba_bsp.report.summary import sentences, wins
from mitsuba_bsp.totals import TotalOptions

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
