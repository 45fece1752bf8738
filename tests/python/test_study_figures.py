"""What the figures and level tables of studies show, from records that were made up."""

from __future__ import annotations

from pathlib import Path

import pytest
from fake_records import records, scene

from mitsuba_bsp.records import Record, ResultsFolder
from mitsuba_bsp.studies import STUDIES


class TestHotSpots:
    def figures(self, tmp_path: Path, specs: list[str], scenes: int) -> dict:
        folder, study = ResultsFolder(tmp_path), STUDIES["hotspots"]
        rows = records(study, ["--specs", *specs], folder, [scene(f"s{n}", n + 1) for n in range(scenes)])
        return dict(study.figures(rows, folder))

    def test_native_alone_has_no_spread_that_could_be_compared(self, tmp_path: Path) -> None:
        assert self.figures(tmp_path, ["native"], 2) == {}

    @pytest.mark.parametrize(("scenes", "panels", "columns"), [(1, 1, 1), (2, 2, 2), (4, 4, 3), (9, 9, 3)])
    def test_three_scenes_are_beside_each_other(self, tmp_path: Path, scenes: int, panels: int, columns: int) -> None:
        figure = self.figures(tmp_path, ["kd", "normals"], scenes)["hotspots"]
        shown = [axes for axes in figure.axes if axes.axison]
        assert len(shown) == 2 * panels
        assert {axes.get_gridspec().ncols for axes in shown} == {columns}
        assert figure.get_figwidth() < 12
        assert [text.get_text() for text in figure.legends[0].texts] == ["kd", "normals"]

    def test_a_scene_without_kd_says_so(self, tmp_path: Path) -> None:
        figure = self.figures(tmp_path, ["normals"], 1)["hotspots"]
        assert figure.axes[0].get_title() == "s0, cost itself: no kd"


class TestCost:
    def test_means_lie_in_the_lane_of_their_rule_among_the_scenes(self, tmp_path: Path) -> None:
        folder, study = ResultsFolder(tmp_path), STUDIES["cost"]
        rows = records(study, ["--alpha", "0.1", "0.5"], folder)
        ((_, figure),) = study.figures(rows, folder)
        panel = figure.axes[0]
        assert [text.get_text() for text in figure.axes[-1].get_xticklabels()] == ["none", "0.1", "0.5"]
        drawn = [line for line in panel.lines if len(line.get_xdata()) == 2 and line.get_color().startswith("#")]
        lanes: dict[str, list[float]] = {}
        for mean in (line for line in drawn if line.get_linewidth() > 1.5):
            lanes.setdefault(mean.get_color(), []).extend(mean.get_xdata())
        lanes.pop("#000000")  # constant: a line across
        assert len(lanes) == 3
        for colour, (first, second) in lanes.items():
            assert abs(first - 1) < 0.4 and second == first + 1  # in the band of its alpha
            points = [x for line in drawn if line.get_color() == colour for x in line.get_xdata() if x < 1.5]
            assert len(points) > 3 and max(abs(x - first) for x in points) < 0.1
        assert min(abs(a[0] - b[0]) for a in lanes.values() for b in lanes.values() if a != b) > 0.2


class TestPlanes:
    @pytest.fixture
    def rows(self, tmp_path: Path) -> list[Record]:
        return records(STUDIES["planes"], [], ResultsFolder(tmp_path))

    def test_every_level_is_listed(self, rows: list[Record]) -> None:
        """9 and 12 planes are considered, 9 and 8 different, 12 in all; of 20 triangles 12n are predicted."""
        tables = {table.title: table for table in STUDIES["planes"].tables(rows)}
        considered = tables["feet: millions of planes considered on a level, counted (predicted)"]
        different = next(table for title, table in tables.items() if title.startswith("feet: millions of different"))
        column = considered.head.index("normals:k=6")
        assert different.head == considered.head and len(considered.head) == 7
        assert [row[0] for row in considered.rows] == ["0", "1", "all"]
        assert [row[column] for row in considered.rows] == [
            "9e-06 (0.00024)", "1.2e-05 (0.00024)", "2.1e-05 (0.00048)",
        ]  # fmt: skip
        assert [row[column] for row in different.rows] == [
            "9e-06 (0.00024)", "8e-06 (0.00036)", "1.2e-05 (0.00036)",
        ]  # fmt: skip

    def test_what_is_predicted_to_differ_is_drawn(self, rows: list[Record], tmp_path: Path) -> None:
        ((_, figure),) = STUDIES["planes"].figures(rows, ResultsFolder(tmp_path))
        panel = next(axes for axes in figure.axes if axes.get_title() == "normals:k=6")
        lines = {line.get_label(): list(line.get_ydata()) for line in panel.lines}
        assert lines["different up to the level, predicted"] == [240, 360]
        assert lines["considered, predicted"] == [240, 240] and lines["different in all"] == [12]
        assert {text.get_text() for text in figure.legends[0].texts} == set(lines)
