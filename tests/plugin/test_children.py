"""Every kind of triangle mesh, with any material, is what it is outside a group."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from .plugin_scenes import (
    SPECS,
    TREES,
    assert_same_up_to_rounding,
    ball,
    facing_down,
    group,
    load,
    pixels,
    place,
    ray,
    rays_inward,
    to_mesh,
    view,
)

VERTICES = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0.5), (-1, 1, 0), (0, 0, 1.5)], np.float32)
FACES = np.array([(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)], np.uint32)
UV = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)], np.float32)


def write_ply(folder: Path) -> dict[str, Any]:
    mesh = to_mesh(VERTICES, FACES, uv=UV)
    mesh.add_attribute("vertex_color", 3, np.linspace(0, 1, 3 * len(VERTICES)).tolist())
    mesh.add_attribute("face_color", 3, np.linspace(1, 0, 3 * len(FACES)).tolist())
    mesh.write_ply(str(folder / "pyramid.ply"))
    return {"type": "ply", "filename": str(folder / "pyramid.ply")}


def write_obj(folder: Path) -> dict[str, Any]:
    lines = [f"v {x} {y} {z}" for x, y, z in VERTICES] + [f"vt {u} {v}" for u, v in UV]
    lines += ["f " + " ".join(f"{v + 1}/{v + 1}" for v in face) for face in FACES]
    (folder / "pyramid.obj").write_text("\n".join(lines))
    return {"type": "obj", "filename": str(folder / "pyramid.obj")}


def write_serialized(folder: Path) -> dict[str, Any]:
    """Mitsuba's own binary format, version 4: texture coordinates, single precision."""
    body = struct.pack("<I", 0x1002) + b"pyramid\0" + struct.pack("<QQ", len(VERTICES), len(FACES))
    body += VERTICES.tobytes() + UV.tobytes() + FACES.tobytes()
    start = struct.pack("<HH", 0x041C, 4)
    (folder / "pyramid.serialized").write_bytes(start + zlib.compress(body) + struct.pack("<QI", 0, 1))
    return {"type": "serialized", "filename": str(folder / "pyramid.serialized")}


def merged(_: Path) -> dict[str, Any]:
    """Several shapes that become one mesh; of merged rectangles Mitsuba forgets the box."""
    bsdf = mi.load_dict({"type": "diffuse"})
    parts = {f"part_{i}": {"type": "rectangle", "to_world": place(0.4, at=(i - 1, 0, 0.3 * i)), "bsdf": bsdf}
             for i in range(3)}  # fmt: skip
    return {"type": "merge", **parts}


KINDS: dict[str, Callable[[Path], Any]] = {
    "ply": write_ply,
    "obj": write_obj,
    "serialized": write_serialized,
    "cube": lambda _: {"type": "cube", "to_world": place(0.7, turn=20)},
    "rectangle": lambda _: {"type": "rectangle", "to_world": place([1.5, 0.5, 1], turn=30)},
    "merge": merged,
    "mi.Mesh": lambda _: to_mesh(VERTICES, FACES, uv=UV),
}


@pytest.fixture
def plain(tmp_path: Path, kind: str) -> dict[str, Any]:
    return {"type": "scene", "child": KINDS[kind](tmp_path), "other": ball(centre=(0, 0, 3), scale=0.2)}


@pytest.mark.parametrize("kind", KINDS)
def test_hits_are_those_of_the_mesh_itself(plain: dict[str, Any], kind: str) -> None:
    """Triangle, position, normals, texture coordinates and partial derivatives, against Embree's robust mode."""
    reference = mi.load_dict({**plain, "embree_use_robust_intersections": True}, optimize=False)
    shapes = {name: plain[name] for name in ("child", "other")}
    scenes = {spec: mi.load_dict({"type": "scene", "g": group(spec, shapes)}, optimize=False) for spec in SPECS}
    numbers: dict[str, list[list[float]]] = {spec: [] for spec in (*SPECS, "embree")}
    for origin, direction in zip(*rays_inward(400), strict=True):
        expected = reference.ray_intersect(ray(origin, direction))
        if expected.is_valid():
            numbers["embree"].append(numbers_of(expected))
        for spec, scene in scenes.items():
            found = scene.ray_intersect(ray(origin, direction))
            assert found.is_valid() == expected.is_valid(), spec
            if not found.is_valid():
                continue
            numbers[spec].append(numbers_of(found))
            assert found.prim_index == expected.prim_index, spec
            assert found.shape.id() == expected.shape.id(), spec
    assert len(numbers["embree"]) > 60, "these rays prove nothing"
    for spec in SPECS:
        np.testing.assert_allclose(numbers[spec], numbers["embree"], rtol=1e-4, atol=3e-5, err_msg=spec)


def numbers_of(si: mi.SurfaceInteraction3f) -> list[float]:
    return [si.t, *si.p, *si.n, *si.uv, *si.dp_du, *si.dp_dv, *si.sh_frame.n, *si.wi, *si.dn_du]


def all_materials(folder: Path) -> dict[str, Any]:
    """All kinds of meshes in one picture, each with another material, lit by an environment and a lamp."""
    rng = np.random.default_rng(5)
    noise = {"type": "bitmap", "bitmap": mi.Bitmap(rng.uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32)), "raw": True}
    floor = {"type": "diffuse", "reflectance": {"type": "checkerboard", "to_uv": mi.ScalarTransform4f().scale(8)}}
    pyramid = {"to_world": place(0.5, at=(-1.2, -0.5, 0))}
    attribute = {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "vertex_color"}}
    of_faces = {"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": "face_color"}}
    return {
        **view(48),
        "floor": {"type": "rectangle", "to_world": place(4), "bsdf": {"type": "twosided", "bsdf": floor}},
        "ply": write_ply(folder) | pyramid | {"bsdf": attribute},
        "faces": write_ply(folder) | {"to_world": place(0.4, at=(0.1, -1.8, 0)), "bsdf": of_faces},
        "obj": write_obj(folder) | {"to_world": place(0.5, at=(1.3, -0.3, 0)), "bsdf": {"type": "roughconductor"}},
        "serialized": write_serialized(folder)
        | {"to_world": place(0.5, at=(0, 0.9, 0)), "bsdf": {"type": "diffuse", "reflectance": noise}},
        "cube": {"type": "cube", "to_world": place(0.35, 25, (0, -0.6, 0.4)), "bsdf": {"type": "dielectric"}},
        "masked": {
            "type": "rectangle",
            "to_world": place(1, at=(0, 0, 1.8)),
            "bsdf": {
                "type": "mask",
                "opacity": 0.4,
                "inner": {"type": "twosided", "b": {"type": "principled", "roughness": 0.3}},
            },
        },
        "merged": merged(folder),
        "python": ball(mi.load_dict({"type": "bumpmap", "b": {"type": "plastic"}, "t": noise}),
                       centre=(-1.5, 1, 0.5), scale=0.25),
        "lamp": {
            "type": "rectangle",
            "to_world": facing_down(0.5, (0, 0, 4)),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [9, 8, 7]}},
        },
        "sky": {"type": "constant", "radiance": 0.3},
    }  # fmt: skip


def test_images_of_all_materials(tmp_path: Path) -> None:
    """Identical bits under all our trees; what Mitsuba's accelerators make differs by rounding only."""
    description = all_materials(tmp_path)
    images = {spec: pixels(load(description, spec)) for spec in (*TREES, "native", "embree")}
    assert images["brute"].std() > 0.05, "there is nothing to see"
    for tree in TREES:
        assert np.array_equal(images[tree], images["brute"]), tree
    assert_same_up_to_rounding(images["brute"], images["embree"])
    assert_same_up_to_rounding(images["brute"], images["native"])


def test_a_hand_written_group_makes_the_same_image(tmp_path: Path) -> None:
    """The group's children are the last objects of the scene, so in the plain scene they come last too."""
    description = all_materials(tmp_path)
    shapes = {name: description.pop(name) for name in list(description) if name not in view() and name != "sky"}
    plain = pixels(mi.load_dict({**description, **shapes}, optimize=False))
    for spec in ("normals", "native"):
        scene = mi.load_dict({**description, "group": group(spec, shapes)}, optimize=False)
        assert_same_up_to_rounding(pixels(scene), plain)


def test_merged_rectangles_are_not_clipped() -> None:
    """Mitsuba gives them an empty box, which must reach neither Embree nor the kd-tree."""
    bsdf = mi.load_dict({"type": "diffuse"})
    parts = {f"part_{i}": {"type": "rectangle", "to_world": place(0.4, at=(i, 0, 0)), "bsdf": bsdf} for i in range(4)}
    for spec in ("kd", "native"):
        grouped = group(spec, {"merge": {"type": "merge", **parts}})
        scene = mi.load_dict({"type": "scene", "group": grouped, "other": ball(centre=(0, 0, 9))}, optimize=False)
        assert len(scene.shapes()) == 2
        for i in range(4):
            assert scene.ray_intersect(mi.Ray3f([i, 0.1, 2], [0, 0, -1])).t == pytest.approx(2), (spec, i)
            assert scene.ray_test(mi.Ray3f([i, 0.1, 2], [0, 0, -1])), (spec, i)
