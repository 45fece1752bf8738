"""Scenes of any size, anywhere, and rays that are hardly rays: the answers are those of brute force."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from mitsuba_bsp import NO_TRIANGLE, Accelerator
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification.meshes import SMALL, Mesh
from mitsuba_bsp.verification.oracle import build, differing, found, plane_questions, questions

MESHES = [SMALL[name](name) for name in ("sphere", "stairs", "soup", "slivers")]
SPECS = [("kd", "wide"), ("kd", "binary"), ("normals", "wide"), ("normals", "binary"), ("ize", "wide")]


def changed(mesh: Mesh, factor: float, move: float = 0.0) -> Mesh:
    """Times `factor`, and `move` sizes away from where it was."""
    vertices = (mesh.vertices.astype(float) + move * mesh.size * np.array([1, -0.7, 0.3])) * factor
    return Mesh(mesh.name, vertices.astype(np.float32), mesh.faces, mesh.closed)


def assert_equal_to_brute_force(mesh: Mesh, tree: str, layout: str, seed: int) -> None:
    accelerator = build(mesh, parse_spec(f"{tree}:layout={layout}"))
    for asked in (*questions(mesh, 500, seed), plane_questions(mesh, accelerator, 500, seed)):
        wrong = differing(accelerator.closest(*asked.rays), asked.expected)
        wrong |= accelerator.any(*asked.rays).astype(bool) != found(asked.expected)
        assert not wrong.any(), f"{tree} {layout} {asked.describe(int(np.argmax(wrong)))}"


@pytest.mark.parametrize("factor", [1e-30, 1e-20, 1e-10, 1e-3, 1e3, 1e10, 1e20, 1e30])
def test_scenes_of_any_size(factor: float) -> None:
    for mesh in MESHES:
        scaled = changed(mesh, factor)
        for tree, layout in SPECS:
            assert_equal_to_brute_force(scaled, tree, layout, seed=1)
        hits = [found(asked.expected).mean() for asked in questions(scaled, 500, seed=1)]
        assert np.mean(hits) > 0.2


@pytest.mark.parametrize("move", [10, 1e3, 1e5, 1e6, 1e7])
@pytest.mark.parametrize("factor", [1, 1e-25, 1e25])
def test_scenes_anywhere(move: float, factor: float) -> None:
    for mesh in MESHES:
        moved = changed(mesh, factor, move)
        for tree, layout in SPECS:
            assert_equal_to_brute_force(moved, tree, layout, seed=2)


@pytest.mark.parametrize("tree", ["kd", "normals:layout=binary", "rbsp", "ize", "brute"])
def test_directions_of_any_length(tree: str) -> None:
    mesh = MESHES[0]
    accelerator = Accelerator(mesh.vertices, mesh.faces, tree)
    rng = np.random.default_rng(3)
    o = rng.uniform(-3, 3, (1000, 3)).astype(np.float32)
    d = (mesh.vertices[rng.integers(len(mesh.vertices), size=1000)] - o).astype(np.float32)
    expected = accelerator.closest(o, d)
    for k in (-110, -60, -20, -1, 1, 20, 60, 110):
        scaled = d * np.float32(2.0**k)
        if k == -110:
            scaled = np.where(np.abs(scaled) < 2.0**-126, 0, scaled).astype(np.float32)
            expected_here = accelerator.closest(o, (scaled * np.float32(2.0**110)).astype(np.float32))
        else:
            expected_here = expected
        answer = accelerator.closest(o, scaled)
        for key in ("u", "v", "triangle"):
            assert np.array_equal(answer[key], expected_here[key])
        assert np.array_equal(answer["t"] * np.float32(2.0**k), expected_here["t"])


@pytest.mark.parametrize("tree", ["kd", "kd:layout=binary", "normals", "ize:layout=binary", "brute"])
@pytest.mark.parametrize("precision", ["safe", "fast", "epsilon"])
def test_rays_that_are_hardly_rays(tree: str, precision: str) -> None:
    """Of numbers that are not, zero, or the largest and smallest there are: no NaN comes back, any hit agrees."""
    if tree == "brute" and precision != "safe":
        return
    mesh = MESHES[0]
    spec = tree + ("" if tree == "brute" else f"{',' if ':' in tree else ':'}precision={precision}")
    accelerator = Accelerator(mesh.vertices, mesh.faces, spec)
    rng = np.random.default_rng(4)
    wild = np.float32([np.nan, np.inf, -np.inf, 0, -0.0, 1, -1, 1e30, -1e30, 3e38, 1e-30, 1e-40, -1e-45])
    o, d = rng.choice(wild, (2, 20000, 3))
    maxt = rng.choice(np.append(wild, [np.inf] * 10), 20000).astype(np.float32)
    answer = accelerator.closest(o, d, maxt)
    hit = answer["triangle"] != NO_TRIANGLE
    t = answer["t"][hit]
    assert 20 < hit.sum() < 10000
    assert np.isfinite(t).all() and (t >= 0).all() and (t <= maxt[hit]).all()
    assert np.isfinite(answer["u"][hit]).all() and np.isfinite(answer["v"][hit]).all()
    assert (answer["t"][~hit] == np.inf).all()
    assert np.array_equal(accelerator.any(o, d, maxt), hit)
    usable = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & d.any(axis=1) & (maxt >= 0)
    assert not hit[~usable].any()
    if precision == "safe":
        brute = Accelerator(mesh.vertices, mesh.faces, "brute").closest(o, d, maxt)
        assert all(np.array_equal(answer[key], brute[key]) for key in brute)


def test_one_huge_triangle_among_ordinary_ones() -> None:
    """It is hit or missed within the errors of its own size; the others are hit as if it were not there."""
    mesh = MESHES[0]
    vertices = np.concatenate([mesh.vertices, np.float32([(-1e30, -1e30, -5), (1e30, -1e30, -5), (0, 1e30, -5)])])
    faces = np.concatenate([mesh.faces, np.uint32([[len(mesh.vertices) + k for k in range(3)]])])
    huge = Mesh("huge", vertices, faces)
    alone = Accelerator(mesh.vertices, mesh.faces, "brute")
    o, d = np.random.default_rng(6).normal(size=(2, 500, 3)).astype(np.float32)
    expected = alone.closest(o, d)
    for tree, layout in SPECS:
        assert_equal_to_brute_force(huge, tree, layout, seed=5)
        answer = Accelerator(vertices, faces, f"{tree}:layout={layout}").closest(o, d)
        others = (answer["triangle"] != len(mesh.faces)) & (expected["triangle"] != NO_TRIANGLE)
        assert others.sum() > 200
        assert all(np.array_equal(answer[key][others], expected[key][others]) for key in answer)


def test_what_is_smaller_than_a_number_beside_the_rest_does_no_harm() -> None:
    """A triangle of 1e-40 in a scene of 1e30 has no size there: it is kept, and never hit."""
    vertices = np.float32([(0, 0, 0), (1e-40, 0, 0), (0, 1e-40, 0), (0, 0, 1e30), (1e30, 0, 1e30), (0, 1e30, 1e30)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for tree in ("kd", "normals", "clustered", "ize", "random", "rbsp"):
            accelerator = Accelerator(vertices, [[0, 1, 2], [3, 4, 5]], tree)
            assert accelerator.statistics()["dropped_triangles"] == 0
            answer = accelerator.closest(np.float32([[1e29, 1e29, 0]]), np.float32([[0, 0, 1]]))
            assert answer["triangle"].tolist() == [1] and answer["t"].tolist() == [np.float32(1e30)]
