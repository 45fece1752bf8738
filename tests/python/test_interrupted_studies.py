"""A study that was stopped, or of which a job failed: tables and figures are made of whatever records there are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from fake_records import records

from mitsuba_bsp.records import Record, ResultsFolder
from mitsuba_bsp.studies import STUDIES, heatmap
from mitsuba_bsp.studies.study import Study

#: Small plans, by study.
WORDS = {
    "directions": ("--trees", "normals", "rbsp", "--k", "4", "6", "--layouts", "binary", "--axes", "fast"),
    "planes": (),
    "comparison": ("--specs", "native", "kd:cost=thesis", "normals:k=6,axes=fast,cost=thesis"),
    "cost": ("--alpha", "0.1", "0.5"),
    "convergence": (),
    "claims": (),
    "hotspots": ("--specs", "native", "kd", "normals"),
    "normals": ("--specs", "kd", "normals"),
    "slice": ("--specs", "kd", "normals"),
    "heatmap": ("--specs", "native", "kd", "normals"),
}

#: Of so many records tables are made, and figures, which take longer; and of all records.
LISTED, DRAWN = (*range(1, 13), 20, 50, 100), (1, 2, 3, 7)

#: Trees that are left out in turn, at most.
MISSING = 6


@pytest.fixture(params=WORDS)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


def made_up(name: str, path: Path) -> tuple[ResultsFolder, Study, list[Record]]:
    folder, study = ResultsFolder(path), {**STUDIES, "heatmap": heatmap.STUDY}[name]
    return folder, study, records(study, WORDS[name], folder)


def test_the_first_records(name: str, tmp_path: Path) -> None:
    folder, study, rows = made_up(name, tmp_path)
    for length in _up_to(len(rows), LISTED):
        assert any(table.rows for table in study.tables(rows[:length]))
    for length in _up_to(len(rows), DRAWN):
        for _, figure in study.figures(rows[:length], folder):
            figure.draw_without_rendering()


def _up_to(most: int, lengths: Sequence[int]) -> list[int]:
    return sorted({min(length, most) for length in (*lengths, most)})


def test_without_one_tree_in_one_scene(name: str, tmp_path: Path) -> None:
    folder, study, rows = made_up(name, tmp_path)
    trees = sorted({row["tree"] for row in rows})
    for tree in trees[:: -(-len(trees) // MISSING)]:
        kept = [row for row in rows if (row["scene"], row["tree"]) != ("feet", tree)]
        assert study.tables(kept)
        for _ in study.figures(kept, folder):
            pass
