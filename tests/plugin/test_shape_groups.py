"""Scenes with shape groups, swapped by the harness: each group has a tree of its own, and nothing else changes."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp

from .plugin_scenes import ball, load, pixels, place, ray, to_mesh, view
from .test_instances import TRANSFORMS, aimed_rays
from .test_instances import shapes as soup_ball_and_cube

SPECS = ("kd", "normals", "native")


def scene() -> dict[str, Any]:
    """Two shape groups, one of them instanced four times, and a mesh that is in one of them and in the scene."""
    group = {"type": "ref", "id": "things"}
    instances = {n: {"type": "instance", "to_world": t(), "shapegroup": group} for n, t in TRANSFORMS.items()}
    return {
        **view(40),
        "floor": {"type": "rectangle", "to_world": place(5, at=(0, 0, -1))},
        "things": {"type": "shapegroup", **soup_ball_and_cube(), "sphere": {"type": "sphere", "radius": 0.3}},
        **instances,
        "wall": {"type": "rectangle", "to_world": place(0.5, 20, (0, 0, 2))},
        "walls": {"type": "shapegroup", "again": {"type": "ref", "id": "wall"}},
        "placed": {"type": "instance", "to_world": place(1, 45, (0, 0, 0.5)), "g": {"type": "ref", "id": "walls"}},
        "sky": {"type": "constant"},
    }


def test_every_group_has_a_tree_built_once(capfd: pytest.CaptureFixture[str]) -> None:
    mi.set_log_level(mi.LogLevel.Info)
    loaded = load(scene(), "normals")
    mi.set_log_level(mi.LogLevel.Warn)
    said = capfd.readouterr().out
    assert said.count("bsptree normals") == 3
    sentence = (
        "shape groups have their own accelerators, built once; the level above, of 5 instances, stays with Embree"
    )
    assert f"2 {sentence}" in said
    found = mitsuba_bsp.statistics(loaded)
    trees = {tree["shape_group"]: tree["triangles"] for tree in found["trees"]}
    assert trees == {"": 4, "things": 60 + 288 + 12, "walls": 2}
    assert found["triangles"] == sum(trees.values())
    assert found["nodes"] == sum(tree["nodes"] for tree in found["trees"])
    assert found["max_depth"] == max(tree["max_depth"] for tree in found["trees"])


@pytest.mark.parametrize("spec", SPECS)
def test_lists_and_names_are_those_of_the_plain_scene(spec: str) -> None:
    plain, swapped = mi.load_dict(scene(), optimize=False), load(scene(), spec)
    assert [s.id() for s in swapped.shapes()] == [s.id() for s in plain.shapes()]
    assert [s.effective_primitive_count() for s in swapped.shapes()] == [
        s.effective_primitive_count() for s in plain.shapes()
    ]
    inside = mitsuba_bsp.shapes(swapped)
    assert [s.id() for s in inside] == ["floor", "wall", "soup", "ball", "cube", "sphere", "wall"]
    assert [s.id() for s in inside if not isinstance(s, mi.Mesh)] == ["sphere"]
    names, expected = (list(mi.traverse(s).properties) for s in (swapped, plain))
    extra = [name for name in names if name not in expected]
    assert [name for name in names if name in expected] == expected
    assert all(name.startswith("walls.wall.") for name in extra), "a mesh in two places has its parameters in both"


def test_all_trees_make_the_same_image() -> None:
    images = {spec: pixels(load(scene(), spec)) for spec in ("brute", "kd", "normals", "clustered")}
    assert images["brute"][..., :3].std() > 0.1
    for image in images.values():
        assert np.array_equal(image, images["brute"])


@pytest.mark.parametrize("spec", SPECS)
def test_hits_on_instances(spec: str) -> None:
    """As `test_instances`, and the number of the triangle, which Embree does not hand on."""
    plain, ours = mi.load_dict(scene(), optimize=False), load(scene(), spec)
    hits = wrong = 0
    for pair in zip(*aimed_rays(), strict=True):
        expected, found = plain.ray_intersect(ray(*pair)), ours.ray_intersect(ray(*pair))
        if not expected.is_valid() or expected.instance is None:
            continue
        hits += 1
        same = found.instance is not None and found.instance.id() == expected.instance.id()
        same = same and found.shape.id() == expected.shape.id() and found.prim_index == expected.prim_index
        wrong += not (same and np.allclose([found.t, *found.p, *found.uv], [expected.t, *expected.p, *expected.uv],
                                           rtol=1e-3, atol=1e-3))  # fmt: skip
    assert hits > 1500
    assert wrong <= hits * 0.2  # a ray at an edge may find either triangle


@pytest.mark.parametrize("spec", SPECS)
def test_moved_meshes_of_a_group_move_all_instances(spec: str) -> None:
    def edited(scene: mi.Scene) -> mi.Scene:
        params = mi.traverse(scene)
        for key in ("things.ball.vertex_positions", "wall.to_world", "squeezed.to_world", "things.sphere.to_world"):
            if "vertex" in key:
                params[key] = np.array(params[key]) + np.float32(0.2)
            else:
                params[key] = params[key] @ place(1.1, 15, (0.1, 0, 0.1))
        params.update()
        return scene

    swapped = load(scene(), spec)
    before = pixels(swapped)
    after = pixels(edited(swapped))
    fresh = pixels(load(edited_description(), spec))
    assert not np.array_equal(before, after)
    assert np.allclose(after, fresh, atol=1e-6)  # a sphere's matrix is inverted in another way
    assert np.mean(np.abs(after - pixels(edited(mi.load_dict(scene(), optimize=False)))) > 1e-3) < 0.03


def edited_description() -> dict[str, Any]:
    """The scene as `test_moved_meshes_of_a_group_move_all_instances` leaves it, its objects never under a tree."""
    description = scene()
    nudge = place(1.1, 15, (0.1, 0, 0.1))
    things = description["things"]
    moved = mi.traverse(things["ball"])
    moved["vertex_positions"] = np.array(moved["vertex_positions"]) + np.float32(0.2)
    moved.update()
    things["sphere"] = {"type": "sphere", "to_world": place(0.3) @ nudge}
    description["wall"]["to_world"] = description["wall"]["to_world"] @ nudge
    description["squeezed"]["to_world"] = description["squeezed"]["to_world"] @ nudge
    return description


@pytest.mark.parametrize("spec", SPECS)
def test_a_mesh_in_two_groups_is_edited_in_both(spec: str) -> None:
    """By either of its names; the tree of the other group would else keep the old triangles."""
    for name in ("wall.to_world", "walls.wall.to_world"):
        swapped = load(scene(), spec)
        params = mi.traverse(swapped)
        params[name] = place(0.5, at=(0, 0, 7))
        params.update()
        assert swapped.ray_intersect(ray([0.1, 0.1, 20], [0, 0, -1])).t == pytest.approx(12.5)
        found = swapped.ray_intersect(ray([0.1, 0.1, 7.2], [0, 0, -1]))
        assert (found.t, found.shape.id()) == (pytest.approx(0.2), "wall")


@pytest.mark.parametrize("spec", SPECS)
def test_a_shape_listed_twice(spec: str) -> None:
    """It is one shape with one set of parameters, in the scene's list twice, as without a tree."""
    description = {"type": "scene", "a": {"type": "cube"}, "s": {"type": "sphere", "center": [9, 9, 9]}}
    twice = {**description, "b": {"type": "ref", "id": "a"}}
    plain, swapped = mi.load_dict(twice, optimize=False), load(twice, spec)
    assert [s.id() for s in swapped.shapes()] == [s.id() for s in plain.shapes()] == ["a", "s", "a"]
    assert list(mi.traverse(swapped).properties) == list(mi.traverse(plain).properties)
    assert mitsuba_bsp.statistics(swapped)["triangles"] == 12
    assert swapped.ray_intersect(ray([0.1, 0.2, 5], [0, 0, -1])).t == 4
    plugin = {"type": "nativekdtree"} if spec == "native" else {"type": "bsptree", "tree": spec}
    by_hand = mi.load_dict({"type": "scene", "g": {**plugin, "a": plain.shapes()[0], "b": plain.shapes()[2]}})
    assert len(by_hand.shapes()) == 2
    assert by_hand.shapes()[0].ptr == by_hand.shapes()[1].ptr


def test_groups_made_before_the_scene_stay_with_embree(capfd: pytest.CaptureFixture[str]) -> None:
    """Nothing can be changed in them any more; that Embree answers shows in the last digits on some processors."""
    group = mi.load_dict({"type": "shapegroup", "a": {"type": "cube"}})
    instance = mi.load_dict({"type": "instance", "g": group})
    scene = load({"type": "scene", "g": group, "i": instance, "ball": ball(centre=(0, 0, 5))}, "kd")
    assert "these shapes stay with Embree: 1 ShapeGroupPlugin, 1 Instance" in capfd.readouterr().out
    assert scene.ray_intersect(ray([0.1, 0.2, -5], [0, 0, 1])).t == pytest.approx(4, rel=1e-6)
    assert mitsuba_bsp.statistics(scene)["triangles"] == 288


@pytest.mark.parametrize(
    ("inner", "sentence"),
    [
        ({"type": "shapegroup", "a": {"type": "cube"}}, "Nested ShapeGroup is not permitted"),
        ({"type": "rectangle", "emitter": {"type": "area"}}, "Instancing of emitters is not supported"),
        ({"type": "instance", "g": {"type": "ref", "id": "other"}}, "Nested instancing is not permitted"),
    ],
)
def test_what_mitsuba_refuses_is_still_refused(inner: dict[str, Any], sentence: str) -> None:
    other = {"type": "shapegroup", "c": {"type": "cube"}}
    group = {"type": "shapegroup", "inner": inner, "b": {"type": "cube"}}
    for make in (lambda d: mi.load_dict(d, optimize=False), lambda d: load(d, "kd")):
        with pytest.raises(RuntimeError, match=sentence):
            make({"type": "scene", "other": other, "g": group})


@pytest.mark.parametrize("threads", [1, 2])
def test_many_groups_are_built_side_by_side(threads: int) -> None:
    """Mitsuba makes them on all its threads at once."""
    import drjit as dr

    before = dr.thread_count()
    dr.set_thread_count(threads)
    try:
        corners = np.random.default_rng(0).random((3000, 3, 3)).astype(np.float32)
        mesh = to_mesh(corners, np.arange(9000).reshape(-1, 3))
        groups = {f"g{i}": {"type": "shapegroup", "m": mesh, "c": {"type": "cube"}} for i in range(12)}
        scene = load({"type": "scene", **groups}, "random")
        assert [tree["triangles"] for tree in mitsuba_bsp.statistics(scene)["trees"]] == [3012] * 12
    finally:
        dr.set_thread_count(before)
