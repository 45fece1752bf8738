"""Embree and Mitsuba's kd-tree on arrays: the answers of the oracle up to rounding, times, and what is hashed."""

from __future__ import annotations

import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp import _incumbents
from mitsuba_bsp.contenders import Triangles, build, differences, triangles_of
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.streams import Stream
from mitsuba_bsp.verification.meshes import Mesh, soup

INCUMBENTS = ["embree", "embree:robust=true", "native", "native:kd_stop_prims=1,kd_clip=false"]


def triangles(*meshes: Mesh) -> Triangles:
    return Triangles(
        tuple(
            (np.ascontiguousarray(mesh.vertices, np.float32), np.ascontiguousarray(mesh.faces, np.uint32))
            for mesh in meshes
        )
    )


def rays(kind: str, count: int = 20_000) -> Stream:
    """From around the scene into it; those that ask for any hit end somewhere within."""
    rng = np.random.default_rng(5)
    origins = rng.uniform(-3, 3, (count, 3)).astype(np.float32)
    directions = (rng.uniform(-1, 1, (count, 3)) - origins).astype(np.float32)
    maxt = rng.uniform(0.2, 1, count) if kind == "shadow" else np.full(count, np.inf)
    return Stream(kind, origins, directions, maxt.astype(np.float32), count)


@pytest.mark.parametrize("spec", INCUMBENTS)
@pytest.mark.parametrize("kind", ["bounce", "shadow"])
def test_answers_are_those_of_the_oracle(spec: str, kind: str) -> None:
    scene = triangles(soup("soup", 200), soup("more", 50, seed=3))
    stream = rays(kind)
    expected = build(parse_spec("brute"), scene).answers(stream)
    hits = np.isfinite(expected).mean()
    assert 0.05 < hits < 0.999
    found = differences(build(parse_spec(spec), scene).answers(stream), expected)
    assert found["hit_or_miss"] <= 2 and found["t"] <= 2, found


@pytest.mark.parametrize("spec", ["kd", "brute", *INCUMBENTS])
def test_times_are_of_all_rays(spec: str) -> None:
    contender = build(parse_spec(spec), triangles(soup("soup", 50)))
    for kind in ("bounce", "shadow"):
        few, many = rays(kind, 2000), rays(kind, 40_000)
        assert contender.tree.time(*few.arrays, few.any_hit)[0] > 0
        short, long = (
            min(contender.tree.time(*stream.arrays, stream.any_hit)[0] for _ in range(3)) for stream in (few, many)
        )
        assert 5 < long / short < 80
        cpu_s, wall_s, misses = contender.tree.time(*few.arrays, few.any_hit)
        assert cpu_s <= wall_s * 1.5 + 1e-3
        assert misses is None or misses >= 0


def test_hashes_tell_trees_and_scenes_apart() -> None:
    scene, other = triangles(soup("soup", 300)), triangles(soup("soup", 301))
    specs = [
        "brute",
        "kd",
        "kd:intersection_cost=1",
        "random:axes=none",
        "random:axes=none,seed=1",
        "native",
        "native:kd_stop_prims=9",
    ]
    found = [build(parse_spec(spec), scene).sha256() for spec in specs]
    assert len(set(found)) == len(specs)
    assert found == [build(parse_spec(spec), scene).sha256() for spec in specs]
    assert build(parse_spec("kd"), other).sha256() != found[1]
    assert build(parse_spec("embree"), scene).sha256() is None
    assert scene.sha256() != other.sha256()


def test_memory_outlives_the_name_of_its_tree() -> None:
    for spec in ("kd", "native"):
        contender = build(parse_spec(spec), triangles(soup("soup", 300)))
        before, parts = contender.sha256(), contender.tree.memory()
        copies = [part.copy() for part in parts]
        del contender
        assert all((part == copy).all() for part, copy in zip(parts, copies, strict=True)) and before
        with pytest.raises(ValueError, match="read-only"):
            parts[0][0] = 1


def test_native_counts_its_work() -> None:
    contender = build(parse_spec("native"), triangles(soup("soup", 300), soup("more", 20)))
    work = contender.count(rays("bounce"))
    assert work["axis_steps"] > 20_000 and work["triangle_tests"] > 20_000 and work["oblique_steps"] == 0
    assert build(parse_spec("embree"), triangles(soup("soup", 3))).count(rays("bounce")) == {}


@pytest.mark.parametrize("spec", ["kd", "native", "embree"])
def test_arrays_that_do_not_fit(spec: str) -> None:
    tree = build(parse_spec(spec), triangles(soup("soup", 3))).tree
    o, d, maxt = rays("bounce", 10).arrays
    with pytest.raises(ValueError, match="10 origins, 9 directions and 10 values of maxt"):
        tree.time(o, d[:9], maxt, False)
    with pytest.raises(TypeError):
        tree.time(o.astype(np.float64).astype(str), d, maxt, False)


def test_an_empty_scene_is_missed() -> None:
    o, d, maxt = rays("bounce", 10).arrays
    vertices, faces = np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)
    for tree in (_incumbents.Native([], {}), _incumbents.Embree(vertices, faces)):
        assert np.isinf(tree.closest(o, d, maxt)).all() and not tree.any(o, d, maxt).any()


def test_triangles_that_are_not_finite_are_left_out() -> None:
    mesh = mi.load_dict({"type": "cube"})
    params = mi.traverse(mesh)
    positions = np.array(params["vertex_positions"])
    positions[0] = np.nan
    params["vertex_positions"] = positions
    params.update()
    ((vertices, faces),) = triangles_of([mesh]).meshes
    assert np.isfinite(vertices).all() and len(faces) < 12
    with pytest.raises(ValueError, match="no triangle mesh"):
        triangles_of([])


def test_differences() -> None:
    inf = np.inf
    expected = np.array([1, 1, inf, inf, 2], np.float32)
    found = np.array([1.00001, inf, inf, 3, 2.1], np.float32)
    assert differences(found, expected) == {"hit_or_miss": 2, "t": 1}
