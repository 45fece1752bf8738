"""Families of rays, most of them aimed: random rays prove nothing (they hit no vertex, no edge and no split plane).

Every family is a function of a mesh, a count and a random generator that returns origins and directions, float32
(count, 3) each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .meshes import Mesh, box_turn

Rays = tuple[np.ndarray, np.ndarray]
Generator = np.random.Generator


def _as_float32(origins: np.ndarray, directions: np.ndarray) -> Rays:
    """Rounded, with directions that came out as zero replaced."""
    o = np.ascontiguousarray(origins, np.float32)
    d = np.ascontiguousarray(directions, np.float32)
    d[~d.any(axis=1)] = (1, 0, 0)
    return o, d


def _towards(origins: np.ndarray, targets: np.ndarray) -> Rays:
    """Aimed in float32: the direction is the rounded difference of rounded points."""
    o, p = origins.astype(np.float32), targets.astype(np.float32)
    return _as_float32(o, p - o)


def _sphere_points(count: int, rng: Generator) -> np.ndarray:
    v = rng.normal(size=(count, 3))
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def _around(mesh: Mesh, count: int, rng: Generator) -> np.ndarray:
    """Origins inside and around the mesh."""
    return mesh.centre + mesh.size * rng.uniform(-1, 1, (count, 3)) * rng.choice([0.15, 0.7, 2.0], (count, 1))


def _corners(mesh: Mesh, count: int, rng: Generator) -> np.ndarray:
    """(count, 3, 3): random triangles."""
    return mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=count)]].astype(float)


def _inside(corners: np.ndarray, rng: Generator) -> np.ndarray:
    weights = rng.dirichlet((1, 1, 1), len(corners))
    return np.einsum("ni,nij->nj", weights, corners)


def random_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    return _as_float32(_around(mesh, count, rng), _sphere_points(count, rng))


def camera_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """A pinhole camera that sees the whole mesh, unit directions."""
    eye = mesh.centre + mesh.size * np.array([1.1, 0.7, 1.3])
    forward = (mesh.centre - eye) / np.linalg.norm(mesh.centre - eye)
    right = np.cross(forward, (0, 1, 0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y = rng.uniform(-0.5, 0.5, (2, count, 1))
    directions = forward + x * right + y * up
    return _as_float32(np.broadcast_to(eye, (count, 3)), directions / np.linalg.norm(directions, axis=1, keepdims=True))


def vertex_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    targets = mesh.vertices[rng.integers(len(mesh.vertices), size=count)]
    return _towards(_around(mesh, count, rng), targets)


def edge_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """At midpoints and other points of edges."""
    corners = _corners(mesh, count, rng)
    s = np.where(rng.random(count) < 0.5, 0.5, rng.random(count))[:, None]
    return _towards(_around(mesh, count, rng), corners[:, 0] + s * (corners[:, 1] - corners[:, 0]))


def plane_rays(mesh: Mesh, count: int, rng: Generator, planes: np.ndarray) -> Rays:
    """Origins in split planes, half of the directions too; `planes` (p, 4) are normals and offsets."""
    if len(planes) == 0:
        return random_rays(mesh, count, rng)
    chosen = planes[rng.integers(len(planes), size=count)].astype(float)
    n, offset = chosen[:, :3], chosen[:, 3:]
    squared = (n * n).sum(axis=1, keepdims=True)

    def into_plane(points: np.ndarray) -> np.ndarray:
        return points - n * (((points * n).sum(axis=1, keepdims=True) - offset) / squared)

    origins = into_plane(_around(mesh, count, rng))
    anywhere = _inside(_corners(mesh, count, rng), rng)
    targets = np.where(rng.random((count, 1)) < 0.5, into_plane(anywhere), anywhere)
    return _towards(origins, targets)


def axis_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """Parallel to an axis through vertices, the other components zeros of either sign."""
    vertices = mesh.vertices[rng.integers(len(mesh.vertices), size=count)].astype(np.float32)
    axis, rows = rng.integers(3, size=count), np.arange(count)
    directions = np.where(rng.random((count, 3)) < 0.5, np.float32(0), np.float32(-0.0))
    directions[rows, axis] = rng.choice([-1, 1], count)
    origins = vertices.copy()
    start = mesh.centre[axis] - directions[rows, axis] * mesh.size * rng.uniform(0, 2, count)
    origins[rows, axis] = start
    # A coordinate moved to another vertex's, so that the ray runs along faces rather than through a vertex.
    other = mesh.vertices[rng.integers(len(mesh.vertices), size=count)]
    swap = (axis + 1) % 3
    moved = rng.random(count) < 0.5
    origins[rows[moved], swap[moved]] = other[rows[moved], swap[moved]]
    return np.ascontiguousarray(origins, np.float32), np.ascontiguousarray(directions, np.float32)


def grazing_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """At angles of 1e-7 to 1e-3 to a face."""
    corners = _corners(mesh, count, rng)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = np.cross(e1, e2)
    n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-300)
    along = e1 * rng.normal(size=(count, 1)) + e2 * rng.normal(size=(count, 1))
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    angle = 10 ** rng.uniform(-7, -3, (count, 1)) * rng.choice([-1, 1], (count, 1))
    direction = along + angle * n
    origins = _inside(corners, rng) - direction * mesh.size * rng.uniform(0.1, 2, (count, 1))
    return _as_float32(origins, direction)


def far_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """From 1e2 to 1e6 times the mesh's size away, at vertices and faces."""
    distance = mesh.size * 10 ** rng.uniform(2, 6, (count, 1))
    vertices = mesh.vertices[rng.integers(len(mesh.vertices), size=count)]
    targets = np.where(rng.random((count, 1)) < 0.5, vertices, _inside(_corners(mesh, count, rng), rng))
    return _towards(mesh.centre + distance * _sphere_points(count, rng), targets)


def spawned_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """From points on faces: in random directions, and at vertices (so also along the face they start from)."""
    origins = _inside(_corners(mesh, count, rng), rng)
    o, towards = _towards(origins, mesh.vertices[rng.integers(len(mesh.vertices), size=count)])
    away = _sphere_points(count, rng).astype(np.float32)
    return o, np.where(rng.random((count, 1)) < 0.5, towards, away)


#: Families that do not depend on the tree.
FAMILIES: dict[str, Callable[[Mesh, int, Generator], Rays]] = {
    "random": random_rays,
    "camera": camera_rays,
    "vertex": vertex_rays,
    "edge": edge_rays,
    "axis": axis_rays,
    "grazing": grazing_rays,
    "far": far_rays,
    "spawned": spawned_rays,
}


def in_turns(parts: Sequence[Sequence[np.ndarray]], count: int) -> tuple[np.ndarray, ...]:
    """`count` rays of several families, each a few arrays: the first of each family, the second of each, and so on."""
    together = (np.stack(arrays, axis=1) for arrays in zip(*parts, strict=True))
    return tuple(np.ascontiguousarray(rays.reshape(-1, *rays.shape[2:])[:count]) for rays in together)


#: Families of `interior_rays`.
INTERIOR_FAMILIES = ("random", "edge", "vertex")


def interior_rays(mesh: Mesh, count: int, rng: Generator, family: str) -> Rays:
    """From near the centre of a closed mesh, `random` or aimed at a `vertex` or an `edge`: none may escape."""
    origins = mesh.centre + rng.uniform(-0.5, 0.5, (count, 3))
    if family == "random":
        return _as_float32(origins, _sphere_points(count, rng))
    if family == "vertex":
        return _towards(origins, mesh.vertices[rng.integers(len(mesh.vertices), size=count)])
    corners = _corners(mesh, count, rng)
    return _towards(origins, (corners[:, 0] + corners[:, 1]) / 2)


def grazing_inside(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """From just inside a face of a `tessellated_box`, at angles of 1e-7 to 1e-3 to it: none may escape."""
    axis, side = rng.integers(3, size=count), rng.choice([-1.0, 1.0], count)
    rows = np.arange(count)
    origins = rng.uniform(-0.99, 0.99, (count, 3))
    # Farther from the face than its vertices are moved by rounding.
    closest = max(1e-5, 4 * 2.0**-24 * float(np.abs(mesh.vertices).max()))
    origins[rows, axis] = side * (1 - closest * 10 ** rng.uniform(0, 2, count))
    directions = rng.normal(size=(count, 3))
    directions[rows, axis] = 0
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[rows, axis] = 10 ** rng.uniform(-7, -3, count) * rng.choice([-1, 1], count)
    turn = box_turn()
    return _as_float32(origins @ turn.T + mesh.centre, directions @ turn.T)
