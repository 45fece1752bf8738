"""What becomes of the records of studies: tables with known numbers, verdicts, figures that are the same every time."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from statistics import geometric_mean

import pytest
from fake_workers import Workers, study

from mitsuba_bsp.inference import effect_of
from mitsuba_bsp.records import ResultsFolder
from mitsuba_bsp.studies import STUDIES, comparison_figures
from mitsuba_bsp.studies.claim_list import ALIGNMENT, CLAIMS
from mitsuba_bsp.studies.claims import judge_alignment, judge_claim
from mitsuba_bsp.studies.comparison import Findings, as_measured
from mitsuba_bsp.studies.cost import RULES, prices
from mitsuba_bsp.studies.runs import RENDER, Runs
from mitsuba_bsp.thesis import PUBLISHED, PUBLISHED_RENDER, PUBLISHED_TREES, published_scene


@pytest.fixture
def feet(room: Path) -> Path:
    """A scene with the name of one of the thesis's."""
    return room.rename(room.with_name("feet.xml"))


def table(folder: Path, title: str) -> list[list[str]]:
    """The rows of the first table in `table.md` whose title starts so, without the head."""
    text = (folder / "table.md").read_text()
    part = text.partition(f"## {title}")[2].partition("\n## ")[0]
    lines = [line for line in part.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def row(folder: Path, title: str, *start: str) -> list[str]:
    return next(cells for cells in table(folder, title) if cells[: len(start)] == list(start))


class TestDirections:
    """kd takes 2 s, normals 1 s and a hundredth more with each seed."""

    @pytest.fixture
    def out(self, workers: Workers, feet: Path, tmp_path: Path) -> Path:
        words = ("--trees", "normals", "rbsp", "--k", "4", "7", "--axes", "fast", "--layouts", "binary")
        assert study("directions", feet, *words, "--out", tmp_path / "out") == 0
        return tmp_path / "out"

    def test_medians_and_deviations(self, out: Path) -> None:
        assert row(out, "seconds: normals, axes fast, binary", "4") == ["4", "1.025 ± 0.019"]
        assert row(out, "seconds: rbsp, axes fast, kdop, dots not cached, binary", "7") == ["7", "1.800 ± 0.000"]
        assert [k for k, _ in table(out, "seconds: rbsp, axes fast, kdop, binary")] == ["7"]
        assert [k for k, _ in table(out, "seconds: rbsp, axes fast, spiral, binary")] == ["4", "7"]

    def test_percent_of_kd(self, out: Path) -> None:
        found = row(out, "feet, 30 triangles", "normals, axes fast, binary")
        assert found[2].startswith("51.2 [5") and found[4] == "less"

    def test_every_k_has_its_finding(self, out: Path) -> None:
        title = "feet: percent of kd at every k"
        assert row(out, title, "normals, axes fast, binary")[1:] == ["51 *", "51 *"]
        assert row(out, title, "rbsp, axes fast, kdop, binary")[1:] == ["-", "90 *"]

    def test_wide_nodes_have_fast_axes(
        self, workers: Workers, feet: Path, tmp_path: Path, capsys: pytest.CaptureFixture
    ) -> None:
        words = ("directions", feet, "--trees", "normals", "--k", "4", "--axes", "none", "--out", tmp_path / "none")
        assert study(*words, "--layouts", "wide") == 2
        assert "--layouts wide: trees with axes none have binary nodes only" in capsys.readouterr().err
        assert study(*words) == 0
        trees = {own["tree"] for own in ResultsFolder(tmp_path / "none").records()}
        assert {tree for tree in trees if tree.startswith("normals")} == {"normals:k=4,axes=none,layout=binary"}

    def test_beside_the_published(self, out: Path) -> None:
        title = "percent of kd, beside the thesis's (feet has other triangles)"
        assert row(out, title, "normals, axes fast, binary") == [
            "normals, axes fast, binary", "4", "51.2", "72.1",
        ]  # fmt: skip

    def test_a_scene_that_stands_in_is_beside_its_own(self, out: Path) -> None:
        """Of the museum, only one k of each tree was published."""
        other = {"scene": "sanmiguel", "tree": "normals:k=6,axes=fast,layout=binary"}
        own = ResultsFolder(out).records()
        rows = [{**row, "scene": "sanmiguel"} for row in own if row["tree"].startswith("kd")]
        rows += [{**row, **other} for row in own if row["tree"].startswith("normals:k=4")]
        found = next(t for t in STUDIES["directions"].tables([*own, *rows]) if t.title.startswith("percent of kd"))
        assert found.title.endswith("(feet has other triangles; sanmiguel stands in for museum)")
        assert found.rows == (
            ("normals, axes fast, binary", "4", "51.2", "72.1", "-", "-"),
            ("normals, axes fast, binary", "6", "-", "67.7", "51.2", "63"),
        )

    def test_a_plan_is_complete(self) -> None:
        own = STUDIES["directions"]
        assert own.repeats == own.least_repeats == 6


def test_more_threads_are_timed_on_the_clock(workers: Workers, room: Path, tmp_path: Path) -> None:
    assert study("comparison", room, "--repeats", "3", "--specs", "kd", "--out", tmp_path / "out") == 0
    rows = ResultsFolder(tmp_path / "out").records()
    times = [Runs([{**own, "threads": n} for own in rows]).values("room", "kd", RENDER)[0] for n in (1, 2)]
    assert times == [2.0, 3.0]


class TestComparison:
    @pytest.fixture
    def out(self, workers: Workers, feet: Path, tmp_path: Path) -> Path:
        assert study("comparison", feet, "--repeats", "5", "--out", tmp_path / "out") == 0
        return tmp_path / "out"

    def test_times_and_counters(self, out: Path) -> None:
        spec = "normals:k=6,axes=fast"
        found = row(out, "feet, 30 triangles", spec)
        assert found[1:3] == ["0.5", "1.02 [1, 1.04]"]
        assert found[3].startswith("51.0 [50.0, 52.0") and found[4:] == ["10.00", "8.00", "10.00", "8.00", "4.0", "75%"]
        assert row(out, "feet, 30 triangles", "embree")[4:] == ["-"] * 4 + ["-", "-"]

    def test_another_scene_decides_nothing(self, out: Path) -> None:
        """The thesis's feet have 33,264 triangles, these 30."""
        found = row(out, "what was published, and what is found", "normals:k=6,axes=fast,cost=thesis", "R")
        assert found[2:4] == ["less than kd", "open"]
        assert found[4] == "only other scenes were measured; another scene: feet 51 %"

    def test_a_tree_is_known_however_it_is_written(self, out: Path) -> None:
        runs = Runs(ResultsFolder(out).records())
        assert "normals:k=6,axes=fast" in runs.trees
        assert as_measured(runs, "normals") == "normals:k=6,axes=fast"
        assert as_measured(runs, "normals:k=7") == "normals:k=7"
        found = Findings(runs, "feet")
        assert found.published("normals:cost=thesis") == found.published("normals:k=6,axes=fast,cost=thesis") != {}

    def test_leaves_and_kd_nodes(self, out: Path) -> None:
        assert row(out, "feet: leaves by their number", "kd")[1:7] == ["4", "1.50", "10.00", "25.0%", "25.0%", "50.0%"]
        assert row(out, "feet: the share of kd nodes", "kd")[1] == "75%"

    def test_the_same_scene_decides(self, out: Path, workers: Workers) -> None:
        folder = ResultsFolder(out)
        rows = [{**own, "triangles": 33_264} for own in folder.records()]
        found = STUDIES["comparison"].tables(rows)
        (verdicts,) = (t for t in found if t.title.startswith("what was published"))
        words = {cells[:3]: cells[3] for cells in verdicts.rows}
        assert words["normals:k=6,axes=fast,cost=thesis", "R", "less than kd"] == "confirmed"
        assert words["ize:axes=fast,cost=thesis", "R", "less than kd"] == "refuted"
        assert words["normals:k=6,axes=fast,cost=thesis", "B", "more than kd"] == "open"  # no difference
        sizes = {cells[:2]: cells[5] for cells in verdicts.rows}
        assert sizes["normals:k=6,axes=fast,cost=thesis", "R"] == "feet 68 %: more than here"  # 51 [50, 52]
        assert sizes["normals:k=6,axes=fast,cost=thesis", "B"] == "feet 11300 %: more than here"

    def test_trees_of_a_single_leaf(self, out: Path) -> None:
        """They have no interior nodes, so there is nothing to draw by depth."""
        leaf = [{"axis_nodes": 0, "oblique_nodes": 0, "leaves": 1, "references": 30, "planes": 0}]
        rows = [
            {**own, "statistics": {**own["statistics"], "levels": leaf} if own["statistics"] else {}}
            for own in ResultsFolder(out).records()
        ]
        assert STUDIES["comparison"].tables(rows)
        drawn = dict(STUDIES["comparison"].figures(rows, ResultsFolder(out)))["comparison-depth"]
        assert not any(axes.lines for axes in drawn.axes) and not drawn.legends

    def test_the_figures_have_what_was_measured(self, workers: Workers, feet: Path, tmp_path: Path) -> None:
        published = "normals:k=6,axes=fast,cost=thesis"
        specs = ("native", "embree", "kd", "kd:orientation=scene", "random", "normals", "kd:cost=thesis", published)
        assert study("comparison", feet, "--repeats", "3", "--specs", *specs, "--out", tmp_path / "out") == 0
        rows = ResultsFolder(tmp_path / "out").records()
        rows += [{**own, "tree": "auto"} for own in rows if own["tree"] == "random"]
        runs = Runs(rows)
        found = comparison_figures.rows_of(runs)
        assert [*found] == ["normals", "auto", "kd:orientation=scene", "random"]
        assert found["normals"] == {"wide": "normals", "thesis": published}
        percent = comparison_figures.percent_figure(runs)
        labels = [text.get_text() for text in percent.legends[0].get_texts()]
        assert labels == ["ours, thesis", "ours, wide", "published"]
        low, high = percent.axes[0].get_xlim()
        ticks = [tick for tick in percent.axes[0].get_xticks() if low < tick < high]
        assert len(ticks) > 2 and 100 in ticks

    def test_there_are_panels_only_for_what_is_drawn(self, workers: Workers, feet: Path, tmp_path: Path) -> None:
        """Mitsuba's own accelerators have no kd nodes to be counted."""
        specs = ("native", "embree", "kd:cost=thesis", "normals:cost=thesis")
        assert study("comparison", feet, "--repeats", "3", "--specs", *specs, "--out", tmp_path / "out") == 0
        figure = comparison_figures.depth_figure(Runs(ResultsFolder(tmp_path / "out").records()))
        assert [axes.get_title() for axes in figure.axes] == ["feet, thesis"]


class TestCost:
    def test_every_price_once(self) -> None:
        trees = [price.tree() for price in prices(["normals"], (0.1, 0.5))]
        assert len(set(trees)) == len(trees) == 2 * (1 + 3 * 2)
        assert "normals:layout=wide,oblique_price=linear,retry=false,alpha=0.5" in trees

    def test_what_decides(self, workers: Workers, room: Path, tmp_path: Path) -> None:
        out = tmp_path / "out"
        assert study("cost", room, "--alpha", "0.1", "0.5", "--repeats", "3", "--out", out) == 0
        found = table(out, "what decides")
        assert {cells[0] for cells in found} == {"rule", "alpha", "layout"}
        pairs = {tuple(cells[:3]): int(cells[6]) for cells in found}
        assert pairs["layout", "binary", "wide"] == 3 * (1 + 3 * 2)
        assert pairs["rule", "constant", "linear"] == 3 * 2 * 2
        assert pairs["alpha", "0.1", "0.5"] == 3 * 2 * 3
        assert all(cells[3] == "100.0 [100.0, 100.0]" and cells[5] == "noise" for cells in found)
        apart = {tuple(cells[:5]): int(cells[8]) for cells in table(out, "the same on each scene")}
        assert apart["layout", "binary", "wide", "room", "-"] == 3 * (1 + 3 * 2)
        assert apart["alpha", "0.1", "0.5", "room", "wide"] == 3 * 3
        assert {cells[2] for cells in table(out, "room, 30 triangles")} == set(RULES)

    def test_what_one_scene_shows_is_not_pooled_away(self, workers: Workers, room: Path, tmp_path: Path) -> None:
        """A larger alpha takes a tenth longer in one scene, and as much less in the other."""
        out = tmp_path / "out"
        other = room.with_name("other.xml")
        shutil.copy(room, other)
        assert study("cost", room, other, "--alpha", "0.1", "0.5", "--repeats", "5", "--out", out) == 0

        def slower(own: dict) -> dict:
            factor = {"room": 1.1, "other": 1 / 1.1}[own["scene"]]
            changed = own["measure"] == "time" and "alpha=0.5" in own["tree"]
            return {**own, "render_cpu_s": own["render_cpu_s"] * factor} if changed else own

        pooled, apart, *_ = STUDIES["cost"].tables([slower(own) for own in ResultsFolder(out).records()])
        assert {cells[5] for cells in pooled.rows if cells[0] == "alpha"} == {"noise"}
        found = {cells[3:5]: cells[7] for cells in apart.rows if cells[0] == "alpha"}
        layouts = ("binary", "wide")
        assert found == {("room", own): "less" for own in layouts} | {("other", own): "more" for own in layouts}


class TestClaims:
    @pytest.fixture
    def out(self, workers: Workers, room: Path, tmp_path: Path) -> Path:
        assert study("claims", room, "--repeats", "3", "--out", tmp_path / "out") == 0
        return tmp_path / "out"

    def test_verdicts(self, out: Path) -> None:
        words = {cells[0]: cells[3] for cells in table(out, "verdicts")}
        assert len(words) == len(CLAIMS) + 1
        assert words[ALIGNMENT] == "open"
        assert words["BSP trees need fewer triangle tests than kd-trees (binary nodes)"] == "confirmed"
        assert words["BSP trees render in less time than kd-trees (wide nodes)"] == "confirmed"
        assert words["BSP trees take more traversal steps than kd-trees (wide nodes)"] == "open"  # just as many
        normals = "Normals are better directions than random ones, at equal k, axes and seed"
        assert words[f"{normals}: less time"] == words[f"{normals}: fewer tests"] == "confirmed"
        assert words["Clustering the normals is better than drawing them: less time"] == "refuted"
        assert words["Fast axis nodes help: less time than with plain ones"] == "open"

    def test_pairs_share_their_seed(self, out: Path) -> None:
        claim = "Normals are better directions than random ones, at equal k, axes and seed: less time (render time)"
        found = table(out, claim)
        assert len(found) == 6 and all(cells[0] == "room" for cells in found)
        ratios = [float(re.match(r"[\d.]+", cells[3])[0]) for cells in found]
        assert ratios == [66.9] * 6  # 1.01 s over 1.51 s

    def test_a_scene_counts_once_however_many_pairs_it_has(self, out: Path) -> None:
        """Student's test of three repetitions, each the geometric mean of all pairs."""
        runs = Runs(ResultsFolder(out).records())
        claim = next(own for own in CLAIMS if "in less time" in own.sentence)
        (scene,) = judge_claim(runs, claim).scenes
        means = [geometric_mean((x + seed / 100) / 2 for x in (1.5, 1.0, 1.2)) for seed in range(3)]
        assert scene.effect == effect_of(means)

    def test_what_no_order_of_scenes_can_decide_is_open(self, out: Path) -> None:
        own = ResultsFolder(out).records()
        times = (1.0, 0.8, 0.6, 0.5)
        rows = []
        for number, (share, seconds) in enumerate(zip((0, 0, 0.3, 0.4), times, strict=True)):
            changed = {"scene": f"room{number}", "axis_area_share": share}
            for row in own:
                time = {"render_cpu_s": seconds if "axes=plain" in row["tree"] else 1.0}
                rows.append({**row, **changed, **time})
        assert "too few scenes, and too alike" in judge_alignment(Runs(rows)).verdict.why

    def test_too_few_scenes_for_a_correlation(self, out: Path) -> None:
        assert "too few scenes for a correlation" in (out / "table.md").read_text()

    @pytest.mark.parametrize(
        ("shares", "times", "word"),
        [
            ((0.1, 0.2, 0.3, 0.4), (1.0, 0.8, 0.6, 0.5), "confirmed"),
            ((0.1, 0.2, 0.3, 0.4), (0.5, 0.6, 0.8, 1.0), "refuted"),
            ((0.001, 0.002, 0.3, 0.4), (1.0, 0.8, 0.6, 0.5), "open"),  # the first two have the same rank
            ((0.1, 0.2, 0.3, 0.4), (1.03, 1.02, 1.01, 1.0), "open"),  # within the noise
        ],
    )
    def test_why_the_axes_help(
        self, workers: Workers, room: Path, tmp_path: Path, shares: Sequence[float], times: Sequence[float], word: str
    ) -> None:
        assert study("claims", room, "--repeats", "3", "--out", tmp_path / "out") == 0
        rows = []
        for number, (share, seconds) in enumerate(zip(shares, times, strict=True)):
            for own in ResultsFolder(tmp_path / "out").records():
                changed = {"scene": f"room{number}", "axis_area_share": share}
                if "axes=plain" in own["tree"]:
                    changed |= {"render_cpu_s": seconds}
                elif "axes=none" in own["tree"]:
                    changed |= {"render_cpu_s": 1.0}
                rows.append({**own, **changed})
        verdicts, *_ = STUDIES["claims"].tables(rows)
        assert {cells[0]: cells[3] for cells in verdicts.rows}[ALIGNMENT] == word


class TestHotSpots:
    def test_spread(self, workers: Workers, room: Path, tmp_path: Path) -> None:
        out = tmp_path / "out"
        assert study("hotspots", room, "--specs", "kd", "normals", "--out", out) == 0
        assert all(job.kind == "work" for job in workers.jobs)
        assert all(job.choices["keep_pixels"] for job in workers.jobs if job.kind == "work")
        exact = "100.0 [100.0, 100.0]"
        assert row(out, "room, 30 triangles, 256x256, 4 spp: whole paths", "normals") == [
            "normals", "2.0", "9.9", "0.50", "4.95", "5.00", exact, exact,
        ]  # fmt: skip

    def test_costs_are_drawn_over_the_mean_of_kd(self, workers: Workers, room: Path, tmp_path: Path) -> None:
        out = tmp_path / "out"
        specs = ("native", "kd", "kd:orientation=scene", "normals")
        assert study("hotspots", room, "--specs", *specs, "--out", out) == 0

        def dearer(own: dict) -> dict:
            """Every pixel costs as much again, without a change of the spread."""
            own = json.loads(json.dumps(own))
            if own["tree"] == "normals":
                for pixels in own["pixels"]["cost"].values():
                    pixels |= {"mean": 2 * pixels["mean"], "quantiles": [2 * q for q in pixels["quantiles"]]}
            return own

        rows = [dearer(own) for own in ResultsFolder(out).records()]
        (_, figure), *_ = STUDIES["hotspots"].figures(rows, ResultsFolder(out))
        lines = {line.get_label(): line for line in figure.axes[0].lines}
        assert set(lines) == {"kd", "kd:orientation=scene", "normals"}
        assert (lines["normals"].get_ydata() == 2 * lines["kd"].get_ydata()).all()
        assert len({line.get_color() for line in lines.values()}) == 3


def test_published_numbers() -> None:
    assert all(set(rows) == {f"{tree},cost=thesis" for tree in PUBLISHED_TREES} for rows in PUBLISHED.values())
    own = PUBLISHED["museum"]["rbsp:k=13,axes=plain,cost=thesis"]
    assert (own.render, own.build, own.tests, own.steps) == (482, 250, 1376, 109)
    by_scene = [
        PUBLISHED_RENDER[scene].get("random:k=4,axes=fast") for scene in ("feet", "sponza", "conference", "museum")
    ]
    assert by_scene == [92.3, 90.9, 92.7, None]
    assert PUBLISHED_RENDER["feet"]["normals:k=6,axes=fast"] == 67.7
    assert PUBLISHED_RENDER["museum"]["rbsp:k=13,axes=plain"] == 482
    assert "ize:axes=fast" not in PUBLISHED_RENDER["feet"]
    assert published_scene("feet", 33_264) == ("feet", True)
    assert published_scene("conference", 69_047) == ("conference", False)
    assert published_scene("sanmiguel", 1_460_000) == ("museum", False)
    assert published_scene("room", 33_264) is None


class TestRealRuns:
    """From command to pictures, with nothing replaced."""

    @pytest.mark.parametrize(
        ("name", "figures"),
        [
            ("planes", ["planes"]),
            ("hotspots", ["hotspots", "hotspots-room"]),
            ("normals", ["normals-room"]),
            ("slice", ["slice-room", "slice-planes-room"]),
        ],
    )
    def test_tables_and_figures_are_made_from_the_records(
        self, room: Path, tmp_path: Path, name: str, figures: list[str]
    ) -> None:
        words = (name, room, "--specs", "kd", "normals:k=4", "--resolution", "12", "--spp", "1", "--out", "out")
        out = tmp_path / "out"
        words = (*words[:-1], out)
        assert study(*words) == 0
        files = [out / f"{figure}.{suffix}" for figure in figures for suffix in ("png", "svg")]
        assert all(file.stat().st_size > 5000 for file in files)
        assert {json.loads(line)["study"] for line in (out / "records.jsonl").read_text().splitlines()} == {name}
        before = {file: file.read_bytes() for file in (*files, out / "table.md")}
        for file in before:
            file.unlink()
        assert study(*words) == 0
        assert {file: file.read_bytes() for file in before} == before
