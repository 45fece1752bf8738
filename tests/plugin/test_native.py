"""The baseline: Mitsuba's own kd-tree, slowed by nothing of ours, and counted by a traversal that does what it does."""

from __future__ import annotations

import time

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.verification.meshes import Mesh, fan, soup, sphere
from mitsuba_bsp.verification.rays import FAMILIES

from .plugin_scenes import from_verification, group, ray, rays_inward, to_mesh

ASIDE = {"type": "sphere", "center": [90, 0, 0], "radius": 0.1}


def native(mesh: mi.Mesh, **settings: object) -> mi.Scene:
    return mi.load_dict({"type": "scene", "g": {"type": "nativekdtree", **settings, "m": mesh}, "aside": ASIDE})


def test_building_takes_as_long_as_the_tree() -> None:
    """The wrapper adds less than a tenth to what the header's class needs by itself, which is `build_s`."""
    mesh = from_verification(sphere("large", 160, bumps=0.02))
    overhead = []
    for _ in range(5):
        start = time.perf_counter()
        scene = mi.load_dict({"type": "nativekdtree", "m": mesh})
        elapsed = time.perf_counter() - start
        lines = [line for line in str(scene).splitlines() if "build_s" in line]
        overhead.append(elapsed / float(lines[0].split('"build_s": ')[1].split(",")[0].rstrip("}")))
    assert min(overhead) < 1.1


def test_statistics() -> None:
    found = mitsuba_bsp.statistics(native(from_verification(soup("soup", 500))))
    assert found["triangles"] == 500 and found["dropped_triangles"] == 0
    assert found["interior_nodes"] + 1 == found["leaves"]
    assert found["nodes"] >= found["interior_nodes"] + found["leaves"]
    assert found["references"] >= 500 and found["max_depth"] > 5
    assert found["bytes"] == 8 * found["nodes"] + 4 * found["references"]
    assert found["build_s"] > 0


def test_settings_reach_the_tree() -> None:
    mesh = from_verification(soup("soup", 500))
    usual = mitsuba_bsp.statistics(native(mesh))
    for settings in (
        {"kd_stop_prims": 50},
        {"kd_max_depth": 4},
        {"kd_clip": False},
        {"kd_intersection_cost": 1.0},
        {"kd_traversal_cost": 500},
        {"kd_empty_space_bonus": 0.1},
        {"kd_exact_primitive_threshold": 10, "kd_min_max_bins": 4},
    ):
        found = mitsuba_bsp.statistics(native(mesh, **settings))
        assert [found[key] for key in ("nodes", "references")] != [usual[key] for key in ("nodes", "references")], (
            settings
        )
    assert mitsuba_bsp.statistics(native(mesh, kd_max_depth=4))["max_depth"] == 4


@pytest.mark.parametrize("mesh", [sphere("sphere", 15), soup("soup", 500), fan("fan", 500)], ids=lambda m: m.name)
def test_counting_changes_no_answer(mesh: Mesh) -> None:
    """Of aimed rays, among them many that Mitsuba's kd-tree gets wrong: counting must get the same ones wrong."""
    whole = from_verification(mesh)
    timed, counted = native(whole), native(whole, count=True)
    rng = np.random.default_rng(3)
    exact = mitsuba_bsp.Accelerator(mesh.vertices, mesh.faces, "brute:triangle_test=mt")
    wrong = 0
    for make in FAMILIES.values():
        o, d = make(mesh, 2500, rng)
        right = exact.closest(o, d)["t"]
        for origin, direction, t in zip(o.tolist(), d.tolist(), right.tolist(), strict=True):
            sent = ray(origin, direction)
            first, second = timed.ray_intersect(sent), counted.ray_intersect(sent)
            assert (first.t, first.prim_index, *first.uv) == (second.t, second.prim_index, *second.uv)
            assert timed.ray_test(sent) == counted.ray_test(sent)
            wrong += first.t != t
    assert wrong > 20, "Mitsuba's kd-tree makes mistakes on such rays, and these tests must see whether they agree"


def counters(scene: mi.Scene) -> dict[str, dict[str, int]]:
    return mitsuba_bsp.statistics(scene)["counters"]


def test_triangle_tests_are_counted_as_mitsuba_makes_them() -> None:
    """Which triangles a ray is tested against, found by experiment.

    Once the tree is built, all triangles but one are shrunk to a point and that one is spread across the ray: the
    scene, which does not know, reports a hit if and only if its traversal tests that triangle. No triangle has two
    references.
    """
    rng = np.random.default_rng(6)
    count = 40
    centres = rng.uniform(-1, 1, (count, 1, 3))
    corners = (centres + rng.uniform(-0.03, 0.03, (count, 3, 3))).astype(np.float32)
    faces = np.arange(3 * count).reshape(-1, 3)
    scenes = [native(to_mesh(corners, faces), kd_stop_prims=1, count=c) for c in (False, True)]
    assert mitsuba_bsp.statistics(scenes[0])["references"] == count
    plain, counting = ((scene, mi.traverse(scene)) for scene in scenes)
    o, d = rays_inward(40)
    for origin, direction in zip(o, d, strict=True):
        unit = direction / np.linalg.norm(direction)
        side = np.cross(unit, (1, 0, 0))
        up = np.cross(unit, side)
        across = origin + 20 * unit + 50 * np.array([side, up - side, -side - up])
        tested = 0
        for triangle in range(count):
            trick = np.zeros_like(corners)
            trick[triangle] = across
            plain[1]["m.vertex_positions"] = trick.ravel()
            tested += plain[0].ray_intersect(ray(origin, unit)).t < 30
        counting[1]["m.vertex_positions"] = np.zeros(9 * count, np.float32)
        before = counters(counting[0])
        for any_hit in (False, True):
            kind = "any" if any_hit else "closest"
            (counting[0].ray_test if any_hit else counting[0].ray_intersect)(ray(origin, unit))
            after = counters(counting[0])
            assert after[kind]["rays"] - before[kind]["rays"] == 1
            assert after[kind]["triangle_tests"] - before[kind]["triangle_tests"] == tested
            assert after[kind]["leaves_visited"] - before[kind]["leaves_visited"] <= tested
            assert after[kind]["oblique_steps"] == 0
    assert counters(counting[0])["closest"]["triangle_tests"] > 40


def test_a_ray_through_every_cell_takes_every_step_once() -> None:
    """Squares in a row across x make a tree that splits x alone: a ray along x that hits nothing passes all its nodes.

    It hits nothing because, once the tree is built, the squares are shrunk to points.
    """
    count = 30
    square = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)])
    corners = np.concatenate([square + np.array([x, 0, 0]) for x in range(count)])
    faces = np.concatenate([np.array([(0, 1, 2), (0, 2, 3)]) + 4 * x for x in range(count)])
    scene = native(to_mesh(corners, faces), kd_intersection_cost=1000, count=True)
    statistics = mitsuba_bsp.statistics(scene)
    assert statistics["interior_nodes"] >= count
    along = ray([-5, 0.3, 0.6], [1, 0, 0])
    assert scene.ray_intersect(along).t == 5
    mi.traverse(scene)["m.vertex_positions"] = np.zeros(corners.size, np.float32)
    before = counters(scene)
    assert not scene.ray_test(along) and not scene.ray_intersect(along).is_valid()
    after = counters(scene)
    for kind, found in after.items():
        taken = {key: found[key] - before[kind][key] for key in found}
        assert taken["axis_steps"] == statistics["interior_nodes"]
        assert taken["leaves_visited"] == statistics["leaves"] - statistics["empty_leaves"]
        assert taken["triangle_tests"] == statistics["references"] == 2 * count


def test_counters_are_those_of_the_rays() -> None:
    scene = mi.load_dict({"type": "scene", "g": group("native", {"c": {"type": "cube"}}) | {"count": True}, "a": ASIDE})
    for i in range(7):
        scene.ray_test(ray([0, 0, 5], [0, 0, -1]))
        if i < 3:
            scene.ray_intersect(ray([0, 0, 5], [0.01 * i, 0, -1]))
    found = counters(scene)
    assert (found["closest"]["rays"], found["any"]["rays"]) == (3, 7)
    assert "counters" not in mitsuba_bsp.statistics(native(from_verification(soup("soup", 9))))
