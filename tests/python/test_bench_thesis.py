"""`mitsuba-bsp bench thesis`: the published numbers, ours beside them, and bad input."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import error_line, scene_xml

from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.thesis import BASELINE, PUBLISHED, SPECS, percent

Command = Callable[..., subprocess.CompletedProcess[str]]


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


def test_the_published_numbers_are_of_the_specs_that_are_run() -> None:
    assert all(set(numbers) == set(SPECS) - {BASELINE} for numbers in PUBLISHED.values())
    assert all(parse_spec(text).settings["cost"] == "thesis" for text in SPECS)


def test_percentages_are_per_ray() -> None:
    def row(rays: int, tests: int, axis: int, oblique: int) -> dict:
        counters = {"rays": rays, "triangle_tests": tests, "axis_steps": axis, "oblique_steps": oblique}
        return {"statistics": {"counters": {"closest": counters}}}

    found = percent(row(20, 40, 30, 70), row(10, 40, 100, 0))
    assert (found.tests, found.steps) == (50, 50)


def test_what_is_shown_and_kept(room: Path, command: Command, tmp_path: Path) -> None:
    feet = room.rename(tmp_path / "feet.xml")
    other = tmp_path / "other.xml"
    other.write_text(feet.read_text())
    words = ["bench", "thesis", feet, other, "--resolution", "8", "--spp", "1", "--out", "out"]
    result = command(*words)
    assert result.returncode == 0, result.stderr
    found = rows(tmp_path / "out")
    assert {(row["scene"], row["spec"]) for row in found} == {(s, spec) for s in ("feet", "other") for spec in SPECS}
    assert len({row["pixels_sha256"] for row in found}) == 1
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"asked.jsonl", "records.jsonl", "table.md"}
    for text in (result.stdout, (tmp_path / "out" / "table.md").read_text()):
        ours, theirs = (text[text.index(f"{name}, 30 triangles") :] for name in ("other", "feet"))
        assert "not the same scene: the thesis's has 33,000" in theirs and "not the same" not in ours
        line = next(line for line in theirs.splitlines() if "normals:k=6" in line)
        cells = line.replace("|", " ").split()
        assert (cells[5], cells[8]) == ("19", "83")
        assert float(cells[6]) == pytest.approx(float(cells[3]) - 19, abs=0.11)
        assert cells[7] == ("yes" if abs(float(cells[6])) <= 10 else "NO")
        baseline = next(line for line in ours.splitlines() if BASELINE in line)
        assert baseline.replace("|", " ").split()[3:] == ["100.0", "100.0"]
    again = command(*words)
    assert again.stdout == result.stdout and rows(tmp_path / "out") == found


class TestBadInput:
    """Each mistake: status 2, one sentence, and nothing left behind."""

    @pytest.mark.parametrize(
        ("words", "sentence"),
        [
            (["gone.xml"], "there is no scene file"),
            (["room.xml", "--specs", "oak"], 'there is no accelerator "oak"'),
            (["room.xml", "--specs", "native"], '"native" does not count the work for its rays'),
            (["room.xml", "--out", "room.xml"], "cannot write to the output folder room.xml"),
            (["empty.xml"], "empty.xml has no triangle"),
        ],
    )
    @pytest.mark.usefixtures("room")
    def test_one_sentence_and_status_2(self, command: Command, tmp_path: Path, words: list[str], sentence: str) -> None:
        (tmp_path / "empty.xml").write_text(scene_xml('<shape type="sphere"/>'))
        before = sorted(path.name for path in tmp_path.iterdir())
        result = command("bench", "thesis", *words)
        assert result.returncode == 2, result.stderr
        assert sentence in error_line(result)
        assert "Traceback" not in result.stderr
        assert sorted(path.name for path in tmp_path.iterdir()) == before
