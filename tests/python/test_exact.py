"""The exact oracle against fractions, solved another way, on random and degenerate input."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from mitsuba_bsp.verification.exact import ExactRay
from mitsuba_bsp.verification.meshes import Mesh, boxes, sphere
from mitsuba_bsp.verification.rays import vertex_rays


def solve(o: np.ndarray, d: np.ndarray, corners: np.ndarray) -> Fraction | None:
    """Cramer's rule for o + t d = a + u (b - a) + v (c - a) in fractions."""
    fractions = [[Fraction(float(x)) for x in row] for row in (o, d, *corners)]
    start, along, a, b, c = fractions
    e1, e2, s = ([x - y for x, y in zip(p, a, strict=True)] for p in (b, c, start))

    def det(p: list[Fraction], q: list[Fraction], r: list[Fraction]) -> Fraction:
        return sum(p[k] * (q[k - 2] * r[k - 1] - q[k - 1] * r[k - 2]) for k in range(3))

    whole = det(along, e1, e2)
    if whole == 0:
        return None
    u, v = det(along, s, e2) / whole, det(along, e1, s) / whole
    return -det(s, e1, e2) / whole if u >= 0 and v >= 0 and u + v <= 1 else None


@pytest.mark.parametrize("kind", ["random", "lattice", "wide", "denormal"])
def test_equal_to_fractions(kind: str) -> None:
    rng = np.random.default_rng([3, *kind.encode()])
    hits = 0
    for _ in range(1500):
        numbers = rng.normal(size=(5, 3))
        if kind == "lattice":  # many on edges, in vertices and in planes
            numbers = rng.integers(-2, 3, (5, 3)).astype(float)
        elif kind == "wide":
            numbers *= 10.0 ** rng.uniform(-30, 30, (5, 3))
        elif kind == "denormal":
            numbers *= 1e-41
        o, d, *corners = numbers.astype(np.float32)
        if not d.any():
            continue
        expected = solve(o, d, np.array(corners))
        assert ExactRay(o, d).hit(np.array(corners)) == expected
        hits += expected is not None
    assert hits > 20


def test_a_ray_through_a_shared_edge_or_vertex_hits_the_triangles_there() -> None:
    cube = boxes("cube", [((-1, -1, -1), (1, 1, 1))])
    diagonal = ExactRay((0.25, 0.25, -3), (0, 0, 1))
    assert sorted(k for k in range(12) if diagonal.hit(cube.vertices[cube.faces[k]]) == 2) != []
    corner = ExactRay((3, 3, 3), (-1, -1, -1))
    touching = [k for k in range(12) if corner.hit(cube.vertices[cube.faces[k]]) == 2]
    assert len(touching) >= 3
    found = corner.closest(cube)
    assert found is not None and (found.t, found.triangle) == (2, min(touching))


def test_a_ray_in_the_plane_of_a_triangle_does_not_hit_it() -> None:
    corners = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert ExactRay((-1, 0.25, 0), (1, 0, 0)).hit(corners) is None


def test_the_interval_is_closed() -> None:
    mesh = Mesh("one", np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.uint32([[0, 1, 2]]))
    ray = ExactRay((0.25, 0.25, -1), (0, 0, 2))
    assert ray.closest(mesh, 0.5) is not None
    assert ray.closest(mesh, np.nextafter(np.float32(0.5), np.float32(0))) is None
    assert ExactRay((0.25, 0.25, 0), (0, 0, 2)).closest(mesh, 0) is not None


def test_the_filter_loses_nothing() -> None:
    """Rays at vertices: double precision leaves few triangles, every exact hit among them."""
    mesh = sphere("sphere", 8, (148376, 1234, -223423))
    o, d = vertex_rays(mesh, 20, np.random.default_rng(5))
    for i in range(len(o)):
        ray = ExactRay(o[i], d[i])
        left = ray.candidates(mesh)
        hit = [k for k in range(len(mesh.faces)) if ray.hit(mesh.vertices[mesh.faces[k]]) is not None]
        assert set(hit) <= set(left) and len(left) < 40
