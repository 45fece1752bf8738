"""Spheres and the like inside the trees: the image of brute force bit for bit, Embree's by rounding, and edits."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp

OURS = ("brute", "auto", "kd", "normals", "clustered", "kd:layout=binary", "normals:layout=binary")


def view(**things: Any) -> dict[str, Any]:
    camera = mi.ScalarTransform4f().look_at(origin=[0, -8, 3], target=[0, 0, 0], up=[0, 0, 1])
    film = {"type": "hdrfilm", "width": 32, "height": 32, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 5, "block_size": 16},
        "camera": {"type": "perspective", "fov": 50, "to_world": camera, "film": film},
        "sky": {"type": "constant", "radiance": 0.3},
        **things,
    }


def kinds() -> dict[str, Any]:
    """One of each, a lamp and a ball of glass among them, and a mesh."""
    place = mi.ScalarTransform4f
    rng = np.random.default_rng(3)
    axes = np.linspace(-1, 1, 6)
    distance = np.linalg.norm(np.stack(np.meshgrid(axes, axes, axes, indexing="ij"), -1), axis=-1) - 0.7
    parts = {
        "centers": rng.uniform(-1, 1, (10, 3)) + [0, 2, 1],
        "scales": rng.uniform(0.05, 0.2, (10, 3)),
        "quaternions": np.tile([0, 0, 0, 1.0], (10, 1)),
    }
    return view(
        floor={"type": "rectangle", "to_world": place().translate([0, 0, -1]).scale(6)},
        lamp={"type": "sphere", "center": [2, -2, 3], "radius": 0.4, "emitter": {"type": "area", "radiance": 10.0}},
        glass={"type": "sphere", "center": [0, -1.5, 0.2], "radius": 0.8, "bsdf": {"type": "dielectric"}},
        disk={"type": "disk", "to_world": place().translate([-2, 0, 0]).rotate([1, 0, 0], 60)},
        column={"type": "cylinder", "p0": [2, 0, -1], "p1": [2, 0, 1], "radius": 0.5},
        grid={
            "type": "sdfgrid",
            "grid": mi.TensorXf(distance[..., None].astype(np.float32)),
            "to_world": place().translate([-1, 1, -1]).scale(1.5),
        },
        many={"type": "ellipsoids", **{key: mi.TensorXf(value.astype(np.float32)) for key, value in parts.items()}},
    )


def balls(count: int, radius: float, around: float = 0) -> dict[str, Any]:
    rng = np.random.default_rng(4)
    found = {
        f"ball {i}": {"type": "sphere", "center": rng.uniform(-2, 2, 3).tolist(), "radius": radius}
        for i in range(count)
    }
    if around:
        light = {"type": "area", "radiance": 0.5}
        found["around"] = {"type": "sphere", "radius": around, "flip_normals": True, "emitter": light}
    return view(**found)


SCENES = {
    "kinds": kinds,
    "only spheres": lambda: balls(200, 0.2),
    "tiny ones": lambda: balls(1500, 0.02),
    "one around all": lambda: balls(30, 0.2, around=50.0),
    "one": lambda: balls(1, 1.0),
}


def rendered(scene: mi.Scene) -> np.ndarray:
    return np.array(mi.render(scene, spp=4, seed=2))


@pytest.mark.parametrize("name", SCENES)
def test_every_tree_renders_the_pixels_of_brute_force_and_embrees_image(name: str) -> None:
    plain = rendered(mi.load_dict(SCENES[name](), optimize=False))
    expected = None
    for spec in OURS:
        scene = mitsuba_bsp.load_dict(SCENES[name](), spec)
        assert mitsuba_bsp.statistics(scene)["primitives"] > 0
        image = rendered(scene)
        expected = image if expected is None else expected
        assert np.array_equal(image, expected), spec
    native = rendered(mitsuba_bsp.load_dict(SCENES[name](), "native"))
    for image in (expected, native):
        assert (np.abs(image - plain).max(axis=2) > 1e-3 * plain.mean()).mean() < 1e-3
    assert plain.std() > 0.01


def test_hits_are_those_of_the_shape_itself() -> None:
    """Shape, primitive, uv and normal, as Embree's scene has them."""
    plain, ours = mi.load_dict(kinds(), optimize=False), mitsuba_bsp.load_dict(kinds(), "normals")
    rng = np.random.default_rng(5)
    seen: dict[str, int] = {}
    outside = 0
    for origin, target in zip(rng.uniform(-6, 6, (2000, 3)), rng.uniform(-2, 2, (2000, 3)), strict=True):
        ray = mi.Ray3f(mi.Point3f(origin.tolist()), mi.Vector3f((target - origin).tolist()))
        one, other = plain.ray_intersect(ray), ours.ray_intersect(ray)
        assert one.is_valid() == other.is_valid() == ours.ray_test(ray)
        if one.is_valid():
            assert one.shape.id() == other.shape.id()
            name = one.shape.id()
            # Mitsuba finds a few hits outside of the box of the ellipsoid that they are on; ours are moved into it.
            moved = name == "many" and abs(one.t - other.t) > 1e-5 * one.t
            assert not moved or abs(one.t - other.t) < 0.01 * one.t
            outside += moved
            if not moved:
                assert other.t == pytest.approx(one.t, rel=1e-5)
                assert np.allclose(one.uv, other.uv, atol=2e-3) and np.allclose(one.n, other.n, atol=2e-3)
            seen[one.shape.id()] = seen.get(one.shape.id(), 0) + 1
    assert outside < 10 < seen["many"]
    assert set(seen) == {"floor", "lamp", "glass", "disk", "column", "grid", "many"}


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
def test_a_moved_sphere_is_found_where_it_is(spec: str) -> None:
    scene = mitsuba_bsp.load_dict(view(ball={"type": "sphere"}, box={"type": "cube", "to_world": far()}), spec)
    params = mi.traverse(scene)
    down = mi.Ray3f([3, 0, 9], [0, 0, -1])
    assert not scene.ray_test(down)
    params["ball.to_world"] = mi.ScalarTransform4f().translate([3, 0, 0])
    params.update()
    assert scene.ray_intersect(down).t == 8
    assert not scene.ray_test(mi.Ray3f([0, 0, 9], [0, 0, -1]))


def far() -> mi.ScalarTransform4f:
    return mi.ScalarTransform4f().translate([0, 20, 0])


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
def test_instances_of_spheres(spec: str) -> None:
    def description() -> dict[str, Any]:
        stretched = mi.ScalarTransform4f().translate([1, 0, 0]).scale([1, 0.5, -2])
        return view(
            group={"type": "shapegroup", "id": "g", "ball": {"type": "sphere", "radius": 0.5}, "box": {"type": "cube"}},
            first={"type": "instance", "to_world": stretched, "g": {"type": "ref", "id": "g"}},
            floor={"type": "disk", "to_world": mi.ScalarTransform4f().translate([0, 0, -2]).scale(5)},
        )

    plain = rendered(mi.load_dict(description(), optimize=False))
    ours = rendered(mitsuba_bsp.load_dict(description(), spec))
    assert (np.abs(ours - plain).max(axis=2) > 1e-3).mean() < 1e-3


def test_a_tree_that_was_kept_is_the_same(tmp_path: Any) -> None:
    first = rendered(mitsuba_bsp.load_dict(balls(100, 0.2), "normals", cache=tmp_path))
    scene = mitsuba_bsp.load_dict(balls(100, 0.2), "normals", cache=tmp_path)
    assert mitsuba_bsp.statistics(scene)["loaded"] and np.array_equal(rendered(scene), first)
    other = mitsuba_bsp.load_dict(balls(100, 0.21), "normals", cache=tmp_path)
    assert not mitsuba_bsp.statistics(other)["loaded"], "other boxes, another tree"
