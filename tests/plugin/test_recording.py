"""Recorded rays: all that the renderer asked, in a form that replays to the same work and can be told apart by kind."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.contenders import COUNTERS, build, differences, triangles_of
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.streams import KINDS, Stream, check_recording, read_recording, split

from .plugin_scenes import ball, facing_down, group, view

RESOLUTION, SPP = 32, 4


def lit_room(**sensor: Any) -> dict[str, Any]:
    """A ball and a lamp inside a closed box, so that every camera ray and every bounce hits something."""
    scene = view(RESOLUTION)
    scene["camera"] |= sensor
    lamp = {"type": "rectangle", "to_world": facing_down(1, (0, 0, 5)), "e": {"type": "area"}}
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(8), "flip_normals": True}
    return scene | {"shapes": group("kd", {"ball": ball(), "box": box, "lamp": lamp})}


def record(scene: dict[str, Any], file: Path, spec: str = "kd") -> tuple[mi.Scene, np.ndarray]:
    """The scene after one frame, and the rays it asked."""
    name = mitsuba_bsp.parse_spec(spec).name
    scene["shapes"] |= {"tree": name, "record": str(file)}
    made = mi.load_dict(scene)
    mi.render(made, spp=SPP, seed=1)
    counters = mitsuba_bsp.statistics(made)["counters"]
    check_recording(file, sum(kind["rays"] for kind in counters.values()))
    return made, read_recording(file)


def meshes(scene: dict[str, Any]) -> list[mi.Mesh]:
    shapes = (scene["shapes"][name] for name in ("ball", "box", "lamp"))
    return [mi.load_dict(shape) if isinstance(shape, dict) else shape for shape in shapes]


@pytest.mark.parametrize("spec", ["kd", "normals"])
def test_replayed_rays_do_the_work_of_the_render(tmp_path: Path, spec: str) -> None:
    scene = lit_room()
    made, rays = record(scene, tmp_path / "rays", spec)
    counters = mitsuba_bsp.statistics(made)["counters"]
    streams = split(rays, made.sensors()[0], 10**9)
    contender = build(parse_spec(spec), triangles_of(meshes(scene)))
    for kinds, counted in ((("camera", "bounce"), counters["closest"]), (("shadow",), counters["any"])):
        replayed: Counter[str] = Counter()
        for stream in streams:
            if stream.kind in kinds:
                replayed += Counter(contender.count(stream)) + Counter(rays=len(stream))
        assert {key: replayed[key] for key in (*COUNTERS, "rays")} == counted


def test_every_tree_records_the_same_rays(tmp_path: Path) -> None:
    """On one thread, in the same order: so all give the same answers."""
    threads = dr.thread_count()
    dr.set_thread_count(1)
    try:
        found = [record(lit_room(), tmp_path / spec, spec)[1] for spec in ("kd", "brute", "random")]
    finally:
        dr.set_thread_count(threads)
    assert found[0].tobytes() == found[1].tobytes() == found[2].tobytes()


@pytest.mark.parametrize(
    "sensor",
    [
        {"type": "perspective"},
        {"type": "perspective", "near_clip": 0.5},
        {"type": "thinlens", "aperture_radius": 0.2, "focus_distance": 5.0},
        {"type": "orthographic", "fov": None},
    ],
    ids=["pinhole", "near", "lens", "orthographic"],
)
def test_camera_rays_are_those_of_the_sensor(tmp_path: Path, sensor: dict[str, Any]) -> None:
    scene = lit_room(**sensor)
    scene["camera"] = {key: value for key, value in scene["camera"].items() if value is not None}
    made, rays = record(scene, tmp_path / "rays")
    streams = {stream.kind: stream for stream in split(rays, made.sensors()[0], 10**9)}
    assert len(streams["camera"]) == RESOLUTION * RESOLUTION * SPP
    assert len(streams["shadow"]) == (rays["any_hit"] != 0).sum() > 1000
    assert len(streams["bounce"]) > 1000
    assert sum(map(len, streams.values())) == len(rays)


def test_a_sample_is_always_the_same_and_in_order(tmp_path: Path) -> None:
    made, rays = record(lit_room(), tmp_path / "rays")
    sensor = made.sensors()[0]
    whole = {stream.kind: stream for stream in split(rays, sensor, 10**9)}
    first, again = split(rays, sensor, 500), split(rays, sensor, 500)
    for stream, twin in zip(first, again, strict=True):
        assert (len(stream), stream.total) == (500, len(whole[stream.kind]))
        assert stream.sha256() == twin.sha256() != whole[stream.kind].sha256()
        rows = iter(row.tobytes() for row in whole[stream.kind].directions)
        assert all(row.tobytes() in rows for row in stream.directions)  # a part of the whole, in its order


def test_all_accelerators_answer_the_recorded_rays_alike(tmp_path: Path) -> None:
    scene = lit_room()
    made, rays = record(scene, tmp_path / "rays")
    triangles = triangles_of(meshes(scene))
    exact = build(parse_spec("brute"), triangles)
    for stream in split(rays, made.sensors()[0], 2000):
        expected = exact.answers(stream)
        for spec in ("kd", "random", "native", "embree"):
            found = differences(build(parse_spec(spec), triangles).answers(stream), expected)
            allowed = 0 if parse_spec(spec).is_tree else 20  # rays between two triangles, and t near 0
            assert found["hit_or_miss"] + found["t"] <= allowed, (spec, stream.kind, found)


def test_a_file_that_cannot_be_written(tmp_path: Path) -> None:
    scene = lit_room()
    scene["shapes"] |= {"record": str(tmp_path / "gone" / "rays")}
    with pytest.raises(RuntimeError, match=r'record: cannot write to the file ".*gone/rays"'):
        mi.load_dict(scene)


def test_a_recording_that_is_too_short(tmp_path: Path) -> None:
    _, rays = record(lit_room(), tmp_path / "rays")
    (tmp_path / "rays").write_bytes(rays.tobytes()[:-1])
    with pytest.raises(OSError, match=r"of [\d,]+ rays only [\d,]+ could be written to .*rays: the disk may be full"):
        check_recording(tmp_path / "rays", len(rays))


def test_a_scene_that_records_can_be_loaded_under_another_accelerator(tmp_path: Path) -> None:
    scene = lit_room()
    scene["shapes"]["record"] = str(tmp_path / "rays")
    mi.render(mitsuba_bsp.load_dict(scene, "normals"), spp=1)
    assert not (tmp_path / "rays").exists()


def test_kinds_are_complete() -> None:
    empty = np.zeros((0, 3), np.float32)
    assert [Stream(kind, empty, empty, empty[:, 0], 0).any_hit for kind in KINDS] == [
        False,
        True,
        False,
    ]
