"""A results folder survives interruption and refuses to mix runs that cannot be compared."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_bsp.records import CONTEXT, ResultsFolder, append, check_context

CONTEXT_OF_ROOM = {key: f"this {key}" for key in CONTEXT}
ROW = {**CONTEXT_OF_ROOM, "scene": "room", "spec": "kd", "spec_full": "kd:a=1"}


@pytest.fixture
def folder(tmp_path: Path) -> ResultsFolder:
    found = ResultsFolder(tmp_path / "out")
    found.prepare()
    return found


def test_what_is_appended_is_read_back_in_order(folder: ResultsFolder) -> None:
    for repeat in range(3):
        append(folder.records_file, {**ROW, "repeat": repeat})
    assert [row["repeat"] for row in folder.records()] == [0, 1, 2]


def test_a_record_cut_off_while_written_is_dropped(folder: ResultsFolder) -> None:
    append(folder.records_file, ROW)
    with folder.records_file.open("a") as stream:
        stream.write('{"scene": "room", "spe')
    assert len(folder.records()) == 1
    folder.prepare()
    append(folder.records_file, {**ROW, "repeat": 7})
    assert [row.get("repeat") for row in folder.records()] == [None, 7]


def test_an_untimed_run_counts_only_while_its_image_is_there(folder: ResultsFolder) -> None:
    append(folder.counters_file, {**ROW, "image": "images/a.exr"})
    assert folder.counted() == {}
    (folder.path / "images" / "a.exr").touch()
    assert list(folder.counted()) == [("room", "kd")]


def test_the_newest_untimed_run_counts(folder: ResultsFolder) -> None:
    (folder.path / "images" / "a.exr").touch()
    for run in range(2):
        append(folder.counters_file, {**ROW, "image": "images/a.exr", "run": run})
    assert folder.counted()["room", "kd"]["run"] == 1


def test_records_of_the_same_settings_may_be_added_to() -> None:
    check_context([ROW], "room", {"kd": "kd:a=1"}, CONTEXT_OF_ROOM)


@pytest.mark.parametrize("key", CONTEXT)
def test_records_of_other_settings_may_not(key: str) -> None:
    with pytest.raises(ValueError, match=f"{key} this {key}, but this run has another") as caught:
        check_context([ROW], "room", {"kd": "kd:a=1"}, {**CONTEXT_OF_ROOM, key: "another"})
    assert "choose another --out" in str(caught.value)


def test_a_spec_that_means_something_else_now_is_noticed() -> None:
    with pytest.raises(ValueError, match="spec_full"):
        check_context([ROW], "room", {"kd": "kd:a=2"}, CONTEXT_OF_ROOM)


def test_other_scenes_in_the_folder_do_not_matter() -> None:
    check_context([ROW], "garden", {"kd": "kd:a=2"}, {})


def test_images_of_different_specs_have_different_names(folder: ResultsFolder) -> None:
    specs = ["normals", "normals:k=6", "normals:k=6,axes=fast", "normals:k=6,axes=plain"]
    names = [folder.image("room", spec).name for spec in specs]
    assert len(set(names)) == len(specs)
    assert not any(character in name for name in names for character in ":,/ ")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="cannot write to the output folder .*file"):
        ResultsFolder(tmp_path / "file").check_writable()
    with pytest.raises(ValueError, match="cannot write to the output folder"):
        ResultsFolder(tmp_path / "file" / "out").check_writable()


def test_checking_a_folder_leaves_nothing_behind(tmp_path: Path) -> None:
    ResultsFolder(tmp_path / "a" / "b").check_writable()
    assert list(tmp_path.iterdir()) == []
