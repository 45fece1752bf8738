"""Saved trees: loaded where they were built before, with the same answers, and never a reason to fail."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp

from .plugin_scenes import ball, group, pixels, view

TREES = ("kd", "random", "normals", "clustered:k=6,axes=plain")


def description() -> dict[str, Any]:
    return {**view(), "sky": {"type": "constant"}, "box": {"type": "cube"}, "ball": ball(centre=(0, -1, 1))}


def load(spec: str, cache: Path) -> mi.Scene:
    return mitsuba_bsp.load_dict(description(), spec, cache=cache)


def is_loaded(scene: mi.Scene) -> bool:
    return mitsuba_bsp.statistics(scene)["loaded"]


@pytest.mark.parametrize("spec", TREES)
def test_the_second_scene_loads_what_the_first_built(tmp_path: Path, spec: str) -> None:
    cache = tmp_path / "new" / "trees"
    built, loaded = load(spec, cache), load(spec, cache)
    assert not is_loaded(built) and is_loaded(loaded)
    assert len(list(cache.iterdir())) == 1
    times = ("build_s", "phases_s", "loaded")
    sizes = [{k: v for k, v in mitsuba_bsp.statistics(s).items() if k not in times} for s in (built, loaded)]
    assert sizes[0] == sizes[1]
    assert np.array_equal(pixels(built), pixels(loaded))


def test_a_scene_in_another_place_has_another_tree(tmp_path: Path) -> None:
    load("kd", tmp_path)
    other = description() | {"ball": ball(centre=(0, -1, 1.1))}
    assert not is_loaded(mitsuba_bsp.load_dict(other, "kd", cache=tmp_path))
    assert not is_loaded(load("kd:leaf_size=2", tmp_path))
    assert is_loaded(load("kd:triangle_test=mt", tmp_path)), "the triangle test does not change the tree"


def test_groups_written_by_hand_can_keep_their_tree(tmp_path: Path) -> None:
    shapes = {key: part for key, part in description().items() if key in ("box", "ball")}
    scenes = []
    for _ in range(2):
        tree = group("normals:k=5", shapes) | {"cache": str(tmp_path)}
        scenes.append(mi.load_dict({**view(), "sky": {"type": "constant"}, "group": tree}, optimize=False))
    assert [is_loaded(scene) for scene in scenes] == [False, True]
    assert np.array_equal(pixels(scenes[0]), pixels(scenes[1]))


def test_the_harness_takes_such_groups_and_uses_its_own_folder(tmp_path: Path) -> None:
    tree = {"type": "bsptree", "cache": str(tmp_path / "theirs"), "box": {"type": "cube"}}
    mitsuba_bsp.load_dict({**view(), "group": tree}, "kd", cache=tmp_path / "ours")
    assert [path.name for path in tmp_path.iterdir()] == ["ours"]


def test_a_damaged_file_is_a_warning_and_is_repaired(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    image = pixels(load("kd", tmp_path))
    (file,) = tmp_path.iterdir()
    sound = file.read_bytes()
    for damaged in (sound[:-1], b"", sound[:70] + bytes([sound[70] ^ 4]) + sound[71:], b"something else" * 100):
        file.write_bytes(damaged)
        capfd.readouterr()
        scene = load("kd", tmp_path)
        said = capfd.readouterr().out
        assert f"the saved tree {file}" in said and "it is built again" in said
        assert not is_loaded(scene)
        assert np.array_equal(pixels(scene), image)
        assert file.read_bytes() == sound
    assert is_loaded(load("kd", tmp_path))


def test_a_folder_that_cannot_be_is_a_warning(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    scene = load("kd", tmp_path / "file" / "trees")
    assert "the tree cannot be saved as" in capfd.readouterr().out
    assert pixels(scene).std() > 0.01


@pytest.mark.parametrize("spec", ["embree", "native", "brute"])
def test_accelerators_without_a_tree_of_ours_keep_none(tmp_path: Path, spec: str) -> None:
    load(spec, tmp_path / "trees")
    assert not (tmp_path / "trees").exists()


def test_edited_geometry_is_not_kept(tmp_path: Path) -> None:
    scene = load("kd", tmp_path)
    params = mi.traverse(scene)
    params["ball.vertex_positions"] = np.array(params["ball.vertex_positions"]) * 1.5
    params.update()
    pixels(scene)
    assert not is_loaded(scene)
    assert len(list(tmp_path.iterdir())) == 1
