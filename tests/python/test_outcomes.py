"""Tables and figures from a results folder alone: machines kept apart, and failures that are none any more."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from fake_workers import Workers, study

from mitsuba_bsp import cli
from mitsuba_bsp.asked import asked
from mitsuba_bsp.outcomes import outcomes
from mitsuba_bsp.records import ResultsFolder

RESULTS = Path(__file__).parents[2] / "results"


def tables(*words: str | Path) -> int:
    """The exit status of `tables`, run in this process."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["tables", *map(str, words)])
    return caught.value.code


@pytest.fixture
def out(workers: Workers, room: Path, tmp_path: Path) -> Path:
    """The folder of a study."""
    out = tmp_path / "out"
    assert study("comparison", room, "--repeats", "3", "--specs", "kd", "normals", "--out", out) == 0
    return out


def edit(file: Path, *changed: dict) -> None:
    """Add to every record of a file a copy with other values."""
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    rows += [{**row, **values} for values in changed for row in rows]
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_everything_in_results_is_made_from_its_records(tmp_path: Path) -> None:
    shutil.copytree(RESULTS, tmp_path / "results")
    for file in (tmp_path / "results").rglob("*"):
        if file.name == "table.md" or file.suffix in (".png", ".svg"):
            file.unlink()
    assert tables(tmp_path / "results") == 0
    for folder in RESULTS.rglob("records.jsonl"):
        for file in folder.parent.iterdir():
            again = tmp_path / "results" / file.relative_to(RESULTS)
            assert again.exists(), f"{file} is not made from records"
            if file.suffix in (".md", ".svg"):
                assert again.read_text() == file.read_text(), f"{file}: run mitsuba-bsp tables results"


def test_tables_and_figures_are_made_again(out: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()}
    for name in ("table.md", "comparison.png", "comparison.svg"):
        (out / name).unlink()
    capfd.readouterr()
    assert tables(out.parent) == 0
    assert {file.name: file.read_bytes() for file in out.iterdir() if file.is_file()} == before
    assert f"{out}: " in capfd.readouterr().out


def test_machines_are_kept_apart(out: Path) -> None:
    edit(out / "records.jsonl", {"cpu": "Z80, 1 logical core", "render_cpu_s": 9.0})
    assert tables(out) == 0
    text = (out / "table.md").read_text()
    assert text.count("# All trees compared") == text.count("## room, 30 triangles, 256x256, 4 spp (noise") == 2
    assert "cpu Z80, 1 logical core" in text
    here, there = text.split("# All trees compared")[1:]
    assert "| 9 [9, 9]" in there and "| 9 [9, 9]" not in here
    assert {file.name for file in out.glob("comparison*.png")} == {
        "comparison.png", "comparison-2.png", "comparison-depth.png", "comparison-depth-2.png",
    }  # fmt: skip


def test_the_scenes_of_a_study_are_those_of_all_its_requests(out: Path) -> None:
    line = json.loads((out / "asked.jsonl").read_text())
    hall = {**line["scenes"][0], "name": "hall"}
    with (out / "asked.jsonl").open("a") as file:
        file.write(json.dumps({**line, "scenes": [hall]}) + "\n")
    (found,) = outcomes(ResultsFolder(out))
    assert [scene.name for scene in found.scenes] == ["room", "hall"]


def test_a_folder_that_does_not_say_what_was_asked(out: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (out / "asked.jsonl").unlink()
    assert tables(out) == 2
    assert "has records, but no asked.jsonl, which says what was measured" in " ".join(capfd.readouterr().err.split())


@pytest.mark.parametrize(("name", "sentence"), [("none", "there is no folder"), ("", "there are no records in")])
def test_where_there_is_nothing(tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, sentence: str) -> None:
    assert tables(tmp_path / name) == 2
    assert sentence in capfd.readouterr().err


def test_of_a_scene_the_last_question_counts(workers: Workers, room: Path, tmp_path: Path) -> None:
    other = room.with_name("other.xml")
    shutil.copy(room, other)
    words = ("--repeats", "3", "--specs", "kd", "--out", tmp_path / "out")
    for scenes in ([room, other], [other], [other]):
        assert study("comparison", *scenes, *words) == 0
    folder = ResultsFolder(tmp_path / "out")
    assert [[scene["name"] for scene in line["scenes"]] for line in asked(folder)] == [["room"], ["other"]]
    (outcome,) = outcomes(folder)  # the records of a study belong together
    text = "".join(table.title for table in outcome.tables())
    assert "room, 30 triangles" in text and "other, 30 triangles" in text


def test_what_failed_and_was_done_then_is_no_failure(workers: Workers, room: Path, tmp_path: Path) -> None:
    words = ("comparison", room, "--repeats", "3", "--specs", "kd", "--out", tmp_path / "out")
    workers.failing = {"kd"}
    assert study(*words) == 1
    workers.failing = set()
    assert study(*words) == 0
    assert (tmp_path / "out" / "failures.jsonl").read_text() == ""
    assert "Failed" not in (tmp_path / "out" / "table.md").read_text()
