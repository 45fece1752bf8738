"""The built-in scenes: size, orientation, repeatable meshes, and that plain Mitsuba loads them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp import scenes_dir

GENERATOR = Path(__file__).parents[2] / "scenes" / "generate.py"
NAMES = ("foliage", "knot", "room", "room_turned")


def load(name: str, **parameters: int) -> mi.Scene:
    # Merged meshes would lose their ids.
    return mi.load_file(str(scenes_dir() / f"{name}.xml"), optimize=False, **parameters)


def corners(shape: mi.Mesh) -> np.ndarray:
    """Triangle corners (n, 3, 3)."""
    buffers = mi.traverse(shape)
    vertices = np.array(buffers["vertex_positions"], dtype=float).reshape(-1, 3)
    return vertices[np.array(buffers["faces"]).reshape(-1, 3)]


def axis_share(triangles: np.ndarray) -> float:
    """Share of the area whose normal is within one degree of a coordinate axis."""
    a, b, c = triangles.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    assert (areas > 0).all()
    return areas[np.abs(normals).max(axis=1) >= np.cos(np.radians(1)) * areas].sum() / areas.sum()


def generate(folder: Path) -> dict[str, bytes]:
    subprocess.run([sys.executable, "-B", GENERATOR, folder], check=True)
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_there_are_these_scenes_and_no_others():
    assert sorted(path.stem for path in scenes_dir().glob("*.xml")) == sorted(NAMES)


def test_meshes_come_out_the_same_every_time(tmp_path):
    first = generate(tmp_path / "first")
    assert first and first == generate(tmp_path / "second")


def test_installed_meshes_are_all_used(tmp_path):
    installed = {path.name for path in scenes_dir().glob("*.ply")}
    text = "".join(path.read_text() for path in scenes_dir().glob("*.xml"))
    assert installed == set(generate(tmp_path))
    assert all(f'value="{name}"' in text for name in installed)


@pytest.mark.parametrize("name", NAMES)
def test_number_of_triangles(name):
    assert 10_000 <= sum(shape.face_count() for shape in load(name).shapes()) <= 300_000


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [("room", 0.95, 1), ("room_turned", 0, 1e-3), ("foliage", 0, 1e-3), ("knot", 0.95, 1)],
)
def test_share_of_area_on_axes(name, least, most):
    assert least <= axis_share(np.concatenate([corners(shape) for shape in load(name).shapes()])) <= most


@pytest.mark.parametrize("name", NAMES)
def test_plain_mitsuba_renders_it(name):
    scene = load(name, res=24, spp=2)
    sensor = scene.sensors()[0]
    assert "BoxFilter" in str(sensor.film().rfilter())
    assert sensor.sampler().sample_count() == 2
    ids = [shape.id() for shape in scene.shapes()]
    assert len(set(ids)) == len(ids) and not any(i.startswith("_") for i in ids)
    image = np.array(mi.render(scene))
    assert image.shape == (24, 24, 3)
    assert np.isfinite(image).all() and 0.1 < image.mean() < 1


def test_turned_room_is_the_room_turned():
    turn = np.array(mi.ScalarTransform4f().rotate([0.48, 0.6, 0.64], 60).matrix)[:3, :3]
    room, turned = load("room"), load("room_turned")
    camera, turned_camera = (np.array(scene.sensors()[0].world_transform().matrix)[:3] for scene in (room, turned))
    np.testing.assert_allclose(turned_camera, turn @ camera, atol=1e-5)
    for shape, turned_shape in zip(room.shapes(), turned.shapes(), strict=True):
        assert turned_shape.id() == shape.id()
        np.testing.assert_allclose(corners(turned_shape), corners(shape) @ turn.T, atol=1e-5)


def test_turned_room_looks_the_same():
    room, turned = (np.array(mi.render(load(name, res=32, spp=64))).mean(axis=(0, 1)) for name in NAMES[2:])
    np.testing.assert_allclose(turned, room, rtol=0.03)
