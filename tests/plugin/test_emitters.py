"""Emitters inside a group light the scene exactly as outside it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from .plugin_scenes import (
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

GREY = {"type": "twosided", "b": {"type": "diffuse", "reflectance": 0.6}}


def lamp(at: tuple[float, float, float], colour: list[float], scale: float = 0.4, **emitter: Any) -> dict[str, Any]:
    area = {"type": "area", "radiance": {"type": "rgb", "value": colour}, **emitter}
    return {"type": "rectangle", "to_world": facing_down(scale, at), "emitter": area}


def textured(at: tuple[float, float, float]) -> mi.Mesh:
    """Two triangles that glow unevenly; not Mitsuba's rectangle, which maps texture coordinates by itself."""
    rng = np.random.default_rng(1)
    glow = mi.Bitmap(rng.uniform(0, 12, (6, 6, 3)).astype(np.float32))
    radiance = {"type": "bitmap", "bitmap": glow, "raw": True}
    emitter = mi.load_dict({"type": "area", "radiance": radiance})
    corners = np.array([(-1, 1, 0), (1, 1, 0), (1, -1, 0), (-1, -1, 0)]) * 0.6 + np.array(at)
    return to_mesh(corners, np.array([(0, 1, 2), (0, 2, 3)]), emitter, uv=np.array([(0, 0), (1, 0), (1, 1), (0, 1)]))


def surfaces() -> dict[str, Any]:
    return {
        "floor": {"type": "rectangle", "to_world": place(4), "bsdf": GREY},
        "box": {"type": "cube", "to_world": place(0.5, 30, (-0.6, 0, 0.5)), "bsdf": GREY},
        "ball": ball(mi.load_dict({"type": "roughconductor"}), centre=(0.9, 0, 0.6), scale=0.3),
    }


def scene(name: str) -> dict[str, Any]:
    """Scenes that differ in their emitters, and in where these stand among the other objects."""
    point = {"type": "point", "position": [2, -3, 3], "intensity": 6}
    sky = {"type": "constant", "radiance": 0.2}
    solid = surfaces()
    match name:
        case "one":
            return {**view(), "lamp": lamp((0, 0, 3), [9, 9, 9]), **solid}
        case "several":
            red, green = lamp((-1, 0, 3), [9, 1, 1]), lamp((1, 0, 3), [1, 9, 1], sampling_weight=2.5)
            return {**view(), "red": red, **solid, "green": green, "blue": lamp((0, 1, 2), [1, 1, 9])}
        case "textured":
            return {**view(), **solid, "glow": textured((0, 0, 3)), "lamp": lamp((2, 0, 3), [4, 4, 4])}
        case "mixed":
            red, green = lamp((-1, 0, 3), [9, 1, 1]), lamp((1, 0, 3), [1, 9, 1])
            return {**view(), "sky": sky, "red": red, "point": point, **solid, "green": green}
        case "all":
            dim = {"type": "area", "radiance": {"type": "rgb", "value": [0.2, 0.3, 0.4]}}
            glowing = {key: {**shape, "emitter": dim} for key, shape in solid.items() if isinstance(shape, dict)}
            return {**view(), **glowing, "lamp": lamp((0, 0, 3), [9, 9, 9]), "sky": sky}
        case "all but one outside":
            sphere = {"type": "sphere", "radius": 0.4, "center": [0, -1, 0.4]}
            return {**view(), "lamp": lamp((0, 0, 3), [9, 9, 9]), "sphere": sphere, "glow": textured((1, 0, 2))}
    raise AssertionError(name)


SCENES = ("one", "several", "textured", "mixed", "all", "all but one outside")


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("integrator", ["path", "direct", "volpath"])
@pytest.mark.parametrize("hide", [False, True])
def test_the_image_is_that_of_the_plain_scene(name: str, integrator: str, hide: bool) -> None:
    """Pixel for pixel, alpha included: the same lamps are picked by the same random numbers."""
    kind = {"type": integrator, "hide_emitters": hide}
    description = scene(name)
    setup = description["integrator"] | kind
    if integrator == "direct":
        del setup["max_depth"]
    plain = pixels(mi.load_dict({**description, "integrator": setup}, optimize=False))
    everything_is_hidden = hide and name == "all"
    assert (plain[..., :3].max() > 0.1) != everything_is_hidden, "there is no light"
    for spec in ("kd", "normals", "native"):
        assert_same_up_to_rounding(pixels(load({**scene(name), "integrator": setup}, spec)), plain, share=0.01)


@pytest.mark.parametrize("name", SCENES)
def test_all_trees_make_the_same_image(name: str) -> None:
    images = [pixels(load(scene(name), spec)) for spec in TREES]
    for image in images[1:]:
        assert np.array_equal(image, images[0])


def test_reordered_emitters_would_be_seen() -> None:
    """The comparison above can fail: the same lamps in another order give another image."""
    description = scene("several")
    other = {key: description[key] for key in ("blue", *[k for k in description if k != "blue"])}
    first, second = (pixels(mi.load_dict(d, optimize=False)) for d in (description, other))
    with pytest.raises(AssertionError):
        assert_same_up_to_rounding(first, second)


def test_a_hidden_lamp_is_transparent_and_still_lights() -> None:
    """Looked at directly: without `hide_emitters` it shows, with it the sky behind it does."""
    parts = {
        "lamp": lamp((0, 0, 0), [5, 5, 5], scale=3),
        "floor": {"type": "rectangle", "to_world": place(9, at=(0, 0, -5))},
    }
    for spec in ("embree", "kd", "native"):
        images = {}
        for hide in (False, True):
            description = {**view(hide_emitters=hide), **parts}
            description["camera"]["to_world"] = mi.ScalarTransform4f().look_at([0, 0.1, -3], [0, 0, 0], [0, 1, 0])
            images[hide] = pixels(load(description, spec))
        assert images[False][..., :3].mean() == pytest.approx(5), spec
        assert images[False][..., 3].min() == 1, spec
        assert images[True].max() == 0, spec


TEXTURED_SCRIPT = """
import drjit as dr, mitsuba as mi, numpy as np, sys
mi.set_variant("scalar_rgb")
import mitsuba_bsp
sys.path.insert(0, {folder!r})
from plugin.test_emitters import pixels, scene
dr.set_thread_count(8)
image = pixels(mitsuba_bsp.load_dict(scene("textured"), {spec!r}), spp=32)
params = mi.traverse(again := mitsuba_bsp.load_dict(scene("textured"), {spec!r}))
params["glow.vertex_positions"] = np.array(params["glow.vertex_positions"]) + 0.1
params.update()
print(image.mean(), pixels(again, spp=32).mean())
"""


@pytest.mark.parametrize("spec", ["kd", "native"])
def test_a_textured_lamp_does_not_hang(spec: str) -> None:
    """With many threads, in a process of its own; after an edit too, when Mitsuba maps its texture anew."""
    script = TEXTURED_SCRIPT.format(folder=str(Path(__file__).parents[1]), spec=spec)
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 0, result.stderr
    first, second = map(float, result.stdout.split()[-2:])
    assert first > 0.02 and second > 0.02


DANGLING_SCRIPT = """
import mitsuba as mi, sys
mi.set_variant("scalar_rgb")
import mitsuba_bsp
sys.path.insert(0, {folder!r})
from plugin.test_emitters import load, pixels, surfaces, textured, view
description = {{**view(), **surfaces(), "glow": textured((0, 0, 3))}}
mi.load_dict(dict(description), optimize=False)
print(pixels(load(description, "kd"))[..., :3].mean())
"""


def test_meshes_outlive_the_scene_that_they_were_in() -> None:
    """A mesh remembers the scene it was part of, even one that is gone: a group must not follow that trail.

    In a process of its own, whose memory is filled with rubbish when it is freed.
    """
    script = DANGLING_SCRIPT.format(folder=str(Path(__file__).parents[1]))
    environment = {**os.environ, "MALLOC_PERTURB_": "165", "GLIBC_TUNABLES": "glibc.malloc.tcache_count=0"}
    command = [sys.executable, "-c", script]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 0, result.stderr
    assert float(result.stdout.split()[-1]) > 0.02


@pytest.mark.parametrize("lamp_first", [False, True])
@pytest.mark.parametrize("spec", ["kd", "random", "normals", "brute"])
def test_a_lamp_in_the_plane_of_a_wall(spec: str, lamp_first: bool) -> None:
    """Equal t goes to the smaller triangle id, so to the shape that comes first, lamp or not; no ray passes."""
    shine = {"type": "area", "radiance": 3.0}
    wall = {"type": "rectangle", "to_world": place(2), "bsdf": GREY}
    lit = {"type": "rectangle", "to_world": place(1), "emitter": shine}
    pair = {"lamp": lit, "wall": wall} if lamp_first else {"wall": wall, "lamp": lit}
    grouped = mi.load_dict({"type": "scene", "group": group(spec, pair)}, optimize=False)
    rng = np.random.default_rng(2)
    for x, y, dx, dy in rng.uniform(-1.9, 1.9, (400, 4)).astype(np.float32):
        target = np.array([x, y, 0], np.float32)
        inside = max(abs(x), abs(y)) < 1
        si = grouped.ray_intersect(ray(target + [dx, dy, 2], -np.array([dx, dy, 2], np.float32)))
        assert si.is_valid()
        assert si.shape.is_emitter() == (inside and lamp_first)


@pytest.mark.parametrize("spec", ["kd", "normals:triangle_test=mt", "native"])
def test_two_carriers_answer_as_one(spec: str) -> None:
    """A group of lamps and walls is asked twice for a ray: its answers must add up to that of a group asked once.

    The reference has the same triangles in the same order, and no lamps.
    """
    rng = np.random.default_rng(4)
    corners = rng.uniform(-1, 1, (60, 1, 3)) + rng.uniform(-0.5, 0.5, (60, 3, 3))

    def soup(lamps: bool) -> mi.Scene:
        parts = {}
        for i, triangle in enumerate(np.repeat(corners, 2, axis=0)):  # every triangle twice: ties
            extra = [mi.load_dict({"type": "area"})] if lamps and i % 3 == 0 else []
            parts[f"m{i}"] = to_mesh(triangle, np.array([(0, 1, 2)]), *extra)
        return mi.load_dict({"type": "scene", "g": group(spec, parts), "s": {"type": "sphere", "center": [9, 9, 9]}})

    twice, once = soup(lamps=True), soup(lamps=False)
    o, d = rays_inward(4000)
    vertices = corners.reshape(-1, 3).astype(np.float32)
    d[::2] = vertices[rng.integers(len(vertices), size=2000)] - o[::2]  # at vertices, where native errs
    hits = 0
    for origin, direction in zip(o, d, strict=True):
        first, second = (s.ray_intersect(ray(origin, direction)) for s in (twice, once))
        assert first.is_valid() == second.is_valid()
        assert twice.ray_test(ray(origin, direction)) == once.ray_test(ray(origin, direction))
        if second.is_valid():
            hits += 1
            assert (first.t, first.shape.id(), *first.uv) == (second.t, second.shape.id(), *second.uv)
    assert hits > 1000


@pytest.mark.parametrize("spec", ["kd", "native"])
def test_answers_do_not_stick(spec: str) -> None:
    """Two carriers share their answers: only about the same ray, as far as it was asked for, to the tree as it is."""
    parts = {"wall": {"type": "rectangle"}, "lamp": ball(mi.load_dict({"type": "area"}), centre=(0, 0, 3), scale=0.2)}
    scene = mi.load_dict({"type": "scene", "g": group(spec, parts), "aside": {"type": "sphere", "center": [9, 9, 9]}})

    def answer(maxt: float, x: float = 0.01, direction: float = -1) -> float:
        return scene.ray_intersect(ray([x, 0.02, 6], [0, 0, direction], maxt)).t

    lamp, beside = answer(np.inf), 0.9
    assert lamp == pytest.approx(2.6, abs=0.1)
    for maxt, t in ((1, np.inf), (np.inf, lamp), (lamp, lamp), (1, np.inf), (lamp, lamp)):
        assert answer(maxt) == t
    for maxt, t in ((4, np.inf), (np.inf, 6), (4, np.inf), (6, 6), (5, np.inf), (7, 6)):  # all end inside the box
        assert answer(maxt, beside) == t
    assert answer(np.inf, direction=1) == np.inf
    assert answer(np.inf) == lamp
    params = mi.traverse(scene)
    params["lamp.vertex_positions"] = np.array(params["lamp.vertex_positions"]) + 1
    params.update()
    assert answer(np.inf) == 6
    other = mi.load_dict({"type": "scene", "g": group(spec, {**parts, "wall": {"type": "cube"}})})
    assert other.ray_intersect(ray([0.01, 0.02, 6], [0, 0, -1])).t == 5
    assert answer(np.inf) == 6
