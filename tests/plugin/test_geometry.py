"""Meshes without faces, empty groups, triangles without area or with wild vertices, huge coordinates."""

from __future__ import annotations

import gc
import json
import math
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.verification.meshes import soup, sphere

from .plugin_scenes import SPECS, ball, group, load, ray, rays_inward, to_mesh

FAR = {"type": "sphere", "center": [0, 0, 50]}


def scene_of(spec: str, **shapes: object) -> mi.Scene:
    return mi.load_dict({"type": "scene", "group": group(spec, shapes), "far": FAR}, optimize=False)


@pytest.mark.parametrize("spec", SPECS)
class TestNothing:
    def test_an_empty_group_is_invisible_and_says_so(self, spec: str, capfd: pytest.CaptureFixture[str]) -> None:
        scene = scene_of(spec)
        assert "has no children: it is invisible" in capfd.readouterr().out
        assert not scene.ray_test(ray([0, 0, 0], [1, 0, 0]))
        assert scene.ray_intersect(ray([0, 0, 0], [0, 0, 1])).t == 49
        assert len(scene.shapes()) == 2

    def test_a_mesh_without_faces_is_invisible_and_says_so(self, spec: str, capfd: pytest.CaptureFixture[str]) -> None:
        scene = scene_of(spec, empty=mi.Mesh("empty", 3, 0))
        assert 'child "empty" of a ' in (said := capfd.readouterr().out) and "has no faces: it is invisible" in said
        assert not scene.ray_test(ray([0, 0, 0], [1, 0, 0]))
        assert not scene.ray_intersect(ray([0, 0, 0], [1, 0, 0])).is_valid()
        assert mitsuba_bsp.statistics(scene)["triangles"] == 0

    def test_meshes_without_faces_between_others(self, spec: str) -> None:
        empty = {f"e{vertices}": mi.Mesh("empty", vertices, 0) for vertices in range(4)}
        a, b = (ball(centre=(x, 0, 0), scale=0.2) for x in (-1, 1))
        scene = scene_of(spec, e0=empty["e0"], a=a, e1=empty["e1"], e2=empty["e2"], b=b, e3=empty["e3"])
        for x, name in ((-1, "a"), (1, "b")):
            assert scene.ray_intersect(ray([x, 0.01, 5], [0, 0, -1])).shape.id() == name


@pytest.mark.parametrize("spec", [*SPECS, "embree"])
@pytest.mark.parametrize("wild", [math.nan, math.inf, -math.inf])
def test_wild_vertices(spec: str, wild: float, capfd: pytest.CaptureFixture[str]) -> None:
    """Their triangles are left out, counted and warned about; the others keep their numbers, which are Embree's."""
    mesh = soup("soup", 200, edge=0.8)
    vertices = mesh.vertices.copy()
    spoiled = np.array([0, 17, 18, 150, 199])
    vertices[3 * spoiled + [0, 1, 2, 0, 1], [0, 1, 2, 0, 1]] = wild
    kept = np.delete(np.arange(200), spoiled)
    expected = mitsuba_bsp.Accelerator(mesh.vertices, mesh.faces[kept], "brute")
    scene = load({"type": "scene", "ball": ball(centre=(9, 9, 9)), "m": to_mesh(vertices, mesh.faces)}, spec)
    o, d = rays_inward(1500, reach=2)
    answers = expected.closest(o, d, np.full(len(o), np.inf, np.float32))
    found = [scene.ray_intersect(ray(*pair)) for pair in zip(o, d, strict=True)]
    hit = answers["triangle"] != mitsuba_bsp.NO_TRIANGLE
    assert hit.sum() > 500
    got = np.array([si.prim_index if si.is_valid() else -1 for si in found])
    want = np.where(hit, kept[np.where(hit, answers["triangle"], 0)], -1)
    assert np.mean(got != want) < 0.002  # a ray through an edge may go either way in Embree and native
    if spec == "embree":
        return
    statistics = mitsuba_bsp.statistics(scene)
    assert statistics["dropped_triangles"] == 5
    assert statistics["triangles"] == 195 + 288
    assert "5 of 488 triangles have " in capfd.readouterr().out


@pytest.mark.parametrize("spec", ["kd", "native"])
def test_wild_vertices_in_a_large_mesh(spec: str) -> None:
    """Mitsuba's kd-tree bins large meshes, and loses its way among numbers that are not finite."""
    mesh = sphere("large", 200)
    vertices = mesh.vertices.copy()
    rng = np.random.default_rng(0)
    some = rng.integers(len(vertices), size=len(vertices) // 50)
    vertices[some, rng.integers(3, size=len(some))] = math.nan
    grouped = group(spec, {"m": to_mesh(vertices, mesh.faces)}) | {"count": True}
    scene = mi.load_dict({"type": "scene", "group": grouped, "far": FAR})
    found = [scene.ray_intersect(ray([0.01, 0.02, 0.03], d)).is_valid() for d in rays_inward(300)[1]]
    assert 0.7 < np.mean(found) < 0.99
    statistics = mitsuba_bsp.statistics(scene)
    assert len(mesh.faces) > 2 * 65536 and statistics["dropped_triangles"] > 5000
    assert statistics["counters"]["closest"]["triangle_tests"] < 300 * 50


@pytest.mark.parametrize("spec", SPECS)
def test_triangles_without_area(spec: str) -> None:
    """Points, lines and repeated vertices are never hit, and hide nothing."""
    mesh = sphere("sphere", 8)
    extra = np.array([(0, 0, 1), (5, 5, 5), (0, 1, 0), (2, 3, 3)])
    flat = np.concatenate([mesh.vertices, [[1, 0, 0], [2, 0, 0], [3, 0, 0]]]).astype(np.float32)
    line = np.array([(len(flat) - 3, len(flat) - 2, len(flat) - 1)])
    faces = np.concatenate([extra, mesh.faces, line])
    scene = scene_of(spec, m=to_mesh(flat, faces))
    direct = mitsuba_bsp.Accelerator(mesh.vertices, mesh.faces, "kd")
    _, d = rays_inward(500)
    o = np.full_like(d, (0.01, 0.02, 0.03))  # not in a split plane, where native loses rays by itself
    want = direct.closest(o, d, np.full(len(o), np.inf, np.float32))["triangle"].astype(int) + len(extra)
    got = np.array([scene.ray_intersect(ray(*pair)).prim_index for pair in zip(o, d, strict=True)])
    assert np.mean(want != got) < 0.005
    assert not scene.ray_test(ray([2.5, 1, 0], [0, -1, 0], 2))


def huge_triangle(size: float) -> mi.Mesh:
    return to_mesh(np.array([(-size, -size, -3), (size, -size, -3), (0, size, -3)]), np.array([(0, 1, 2)]))


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
def test_a_huge_triangle_does_not_hide_the_rest(spec: str) -> None:
    """As large as Embree takes a shape; beyond, it would drop it without a word."""
    scene = scene_of(spec, huge=huge_triangle(1.79e18), small=ball())
    assert scene.ray_intersect(ray([0, 0.01, 9], [0, 0, -1])).shape.id() == "small"
    assert scene.ray_intersect(ray([1e18, -1e18, 9], [0, 0, -1])).shape.id() == "huge"


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
@pytest.mark.parametrize("size", [1.81e18, 1e30, 3e38])
def test_what_embree_would_drop_is_refused(spec: str, size: float) -> None:
    with pytest.raises(RuntimeError) as caught:
        scene_of(spec, huge=huge_triangle(size), small=ball())
    message = str(caught.value)
    assert 'child "huge" extends from [-' in message and "drops shapes that reach beyond 1.8e+18" in message
    assert f"{size:g}" in message and "\n" not in message


@pytest.mark.parametrize("spec", SPECS)
def test_statistics_are_json_without_exceptions(spec: str, tmp_path: Path) -> None:
    def refuse(word: str) -> None:
        raise AssertionError(word)

    for shapes in ({}, {"m": mi.Mesh("m", 3, 0)}, {"a": {"type": "cube"}}, {"a": ball(), "b": ball()}):
        for shape in scene_of(spec, **shapes).shapes():
            for line in str(shape).splitlines():
                if line.strip().startswith("statistics = "):
                    json.loads(line.partition("=")[2], parse_constant=refuse)


def test_a_member_may_outlive_its_scene() -> None:
    """What it answers then is the child itself, for the shape that stood for it is gone."""
    parts = {"a": ball(), "b": {"type": "rectangle"}, "c": {"type": "rectangle", "emitter": {"type": "area"}}}
    scene = mi.load_dict({"type": "scene", "far": FAR, "group": group("kd", parts)}, optimize=False)
    members = {shape.id(): shape for shape in scene.shapes()}
    at_b, emitter = ray([0.99, 0.99, 9], [0, 0, -1]), scene.emitters()[0]
    before = scene.ray_intersect(at_b).shape
    assert before.id() == "b" and before.class_name() == "Member"
    carrier = members["a"]
    del scene, members, before
    gc.collect()
    hit = carrier.ray_intersect(at_b)
    assert hit.t == 9
    assert hit.shape.id() == "b" and hit.shape.class_name() == "Rectangle"
    assert "AreaLight" in str(emitter) and "Member" in str(carrier)
    assert "a.vertex_positions" not in mi.traverse(carrier) and "vertex_positions" in mi.traverse(carrier)
