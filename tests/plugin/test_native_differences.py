"""Every pixel that Mitsuba's kd-tree makes differently is traced to rays that it answers wrongly, and counted.

With `check`, the shape `nativekdtree` also answers each ray by a loop over all triangles with Mitsuba's own test, and
counts how often its tree's answer is another one: a hit missed, a hit behind the first, another triangle at the same t,
a shadow missed. The stock path integrator renders one pixel at a time, so that the counts belong to that pixel. As long
as no answer differs, the paths of both scenes run through the same rays; so a pixel that differs has a first ray that
was answered differently, and that ray is counted. `impossible` counts answers that no loop over all triangles gives.
"""

from __future__ import annotations

from collections import Counter
from itertools import product
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.verification.meshes import Mesh, sphere

from .plugin_scenes import from_verification, group, to_mesh, view

SIDE = 24


#: Where the camera is: the farther, the worse the distances of planes round.
CAMERAS = {"near": (0.3, -4, 0.2), "telescope": (9e3, -3e4, 7e3)}
Pixel = tuple[int, int]


def hills() -> Mesh:
    """A square of bumpy ground, seen as a picture on a wall, over a lattice."""
    side = np.arange(-SIDE, SIDE + 1, 2) / SIDE
    x, z = np.meshgrid(side, side)
    y = np.random.default_rng(9).integers(-6, 6, x.shape) / 64
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Mesh("hills", np.stack([x, y, z], axis=2).reshape(-1, 3), faces)


def shapes() -> dict[str, Any]:
    """Hills, a square shown twice in two colours before them (ties), and a wall behind all."""
    grey, green, red, blue = (
        mi.load_dict({"type": "twosided", "b": {"type": "diffuse", "reflectance": {"type": "rgb", "value": v}}})
        for v in ([0.7, 0.7, 0.7], [0.3, 0.8, 0.2], [0.8, 0.1, 0.1], [0.1, 0.1, 0.8])
    )
    square = np.array([(-0.5, -0.5, -0.6), (0.2, -0.5, -0.6), (0.2, -0.5, 0.1), (-0.5, -0.5, 0.1)])
    faces = np.array([(0, 1, 2), (0, 2, 3)])
    ground = hills()
    return {
        "ground": to_mesh(ground.vertices, ground.faces, grey),
        "wall": to_mesh(square * 9 + (0, 5, 0), faces, green),
        "red": to_mesh(square, faces, red),
        "blue": to_mesh(square, faces, blue),
    }


def scene(spec: str, camera: str, **settings: Any) -> mi.Scene:
    description = view(SIDE, rr_depth=3)
    origin = np.array(CAMERAS[camera], float)
    description["camera"] |= {
        "to_world": mi.ScalarTransform4f().look_at(origin, [0, 0, 0], [0, 0, 1]),
        "fov": 2 * np.degrees(np.arctan(1.1 / np.linalg.norm(origin))),
        "far_clip": 1e6,
    }
    lights = {"lamp": {"type": "point", "position": [1, -4, 3], "intensity": 30}, "sky": {"type": "constant"}}
    return mi.load_dict({**description, **lights, "g": group(spec, shapes()) | settings}, optimize=False)


class PixelRenderer:
    """Renders single pixels of a scene."""

    def __init__(self, scene: mi.Scene) -> None:
        self.scene = scene
        self.params = mi.traverse(scene)
        self.params["camera.film.crop_size"] = [1, 1]

    def render(self, x: int, y: int) -> np.ndarray:
        self.params["camera.film.crop_offset"] = [x, y]
        self.params.update()
        return np.array(mi.render(self.scene, seed=1 + x + SIDE * y), np.float32).ravel()


def differences(scene: mi.Scene) -> Counter[str]:
    return Counter(mitsuba_bsp.statistics(scene)["differences"])


@pytest.mark.parametrize("camera", CAMERAS)
def test_every_differing_pixel_has_a_ray_to_blame(camera: str) -> None:
    checked = scene("native", camera, check=True)
    native, exact = PixelRenderer(checked), PixelRenderer(scene("brute:triangle_test=mt", camera))
    blamed: dict[Pixel, Counter[str]] = {}
    differing: set[Pixel] = set()
    for x, y in product(range(SIDE), range(SIDE)):
        before = differences(checked)
        pixel, right = native.render(x, y), exact.render(x, y)
        if counted := differences(checked) - before:
            blamed[x, y] = counted
        if not np.array_equal(pixel, right):
            differing.add((x, y))
    kinds = sum(blamed.values(), Counter())
    print(
        f"{len(differing)} of {SIDE * SIDE} pixels differ, {len(blamed)} have rays answered differently: {dict(kinds)}"
    )
    assert differing <= set(blamed), f"unexplained: {sorted(differing - set(blamed))}"
    assert len(differing) > 30
    assert len(blamed) < SIDE * SIDE  # or the containment above would say nothing
    assert kinds["impossible"] == 0
    assert kinds["ties"] > 0
    assert camera == "near" or kinds["farther"] + kinds["missed"] > 0


def test_checking_changes_nothing() -> None:
    plain, checked = (scene("native", "near", **settings) for settings in ({}, {"check": True, "count": True}))
    images = [np.array(mi.render(s, seed=5, spp=4)) for s in (plain, checked)]
    assert np.array_equal(*images)
    assert "differences" not in mitsuba_bsp.statistics(plain)
    assert mitsuba_bsp.statistics(checked)["counters"]["closest"]["rays"] > SIDE * SIDE * 4


@pytest.mark.parametrize("offset", [0.0, 0.001])
def test_rays_that_start_in_a_split_plane(offset: float) -> None:
    """What the counters say is what rays show: from the centre of a sphere some escape, from beside it none."""
    room = group("native", {"m": from_verification(sphere("room", 8))}) | {"check": True}
    scene = mi.load_dict({"type": "scene", "g": room, "aside": {"type": "sphere", "center": [9, 9, 9]}})
    directions = np.random.default_rng(0).normal(size=(3000, 3))
    escaped = [not scene.ray_intersect(mi.Ray3f([offset, 2 * offset, 3 * offset], d)).is_valid() for d in directions]
    found = differences(scene)
    assert found["missed"] == sum(escaped)
    assert (found["missed"] > 0) == (offset == 0)
