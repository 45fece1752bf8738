"""Small meshes on which accelerators go wrong: each is (vertices (n, 3) float32, faces (m, 3) uint32)."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .threads import shared


@dataclass(frozen=True, eq=False)
class Mesh:
    """Equal to itself only, so that answers about it can be kept."""

    name: str
    vertices: np.ndarray
    faces: np.ndarray
    closed: bool = False  #: a ray from inside must hit something

    @cached_property
    def size(self) -> float:
        """Longest side of the bounding box."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def centre(self) -> np.ndarray:
        return (self.vertices.min(axis=0) + self.vertices.max(axis=0)) / 2


def _mesh(name: str, vertices: np.ndarray, faces: np.ndarray, closed: bool = False) -> Mesh:
    return Mesh(name, np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.uint32), closed)


def of_corners(name: str, corners: np.ndarray) -> Mesh:
    """Triangles (n, 3, 3) that share no vertex."""
    return _mesh(name, corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def sphere(name: str, steps: int, centre: tuple[float, float, float] = (0, 0, 0), bumps: float = 0.0) -> Mesh:
    """A closed sphere of radius 2, `steps` rings of 2 `steps` segments, poles merged; with bumps, uneven."""
    rng = np.random.default_rng(1)
    theta = np.pi * np.arange(1, steps) / steps
    phi = np.pi * np.arange(2 * steps) / steps
    t, p = np.meshgrid(theta, phi, indexing="ij")
    rings = np.stack([np.sin(t) * np.cos(p), np.cos(t), np.sin(t) * np.sin(p)], axis=-1).reshape(-1, 3)
    points = np.concatenate([rings, [[0, 1, 0], [0, -1, 0]]])
    points *= 2 * (1 + bumps * rng.uniform(-1, 1, (len(points), 1)))
    segments, rows = 2 * steps, steps - 1
    top, bottom = rows * segments, rows * segments + 1
    i = np.arange(segments)
    j = (i + 1) % segments
    faces = [np.stack([np.full(segments, top), j, i], axis=-1)]
    for row in range(rows - 1):
        a, b, c, d = row * segments + i, row * segments + j, (row + 1) * segments + i, (row + 1) * segments + j
        faces += [np.stack([a, b, c], axis=-1), np.stack([b, d, c], axis=-1)]
    last = (rows - 1) * segments
    faces.append(np.stack([last + i, last + j, np.full(segments, bottom)], axis=-1))
    return _mesh(name, points + np.asarray(centre), np.concatenate(faces), closed=True)


def grid(name: str, cells: int) -> Mesh:
    """A flat square in the plane y = 0 with vertices at lattice points: all planes and vertices coincide."""
    x, z = np.meshgrid(np.arange(cells + 1.0), np.arange(cells + 1.0), indexing="ij")
    vertices = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    i, j = (v.ravel() for v in np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij"))
    a = i * (cells + 1) + j
    b, c, d = a + 1, a + cells + 1, a + cells + 2
    return _mesh(name, vertices, np.concatenate([np.stack([a, b, c], -1), np.stack([b, d, c], -1)]))


def boxes(name: str, corners: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> Mesh:
    """Axis-aligned boxes, 12 triangles each."""
    vertices, faces = [], []
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    for index, (lower, upper) in enumerate(corners):
        bounds = np.array([lower, upper], float)
        vertices += [[bounds[k >> 2 & 1, 0], bounds[k >> 1 & 1, 1], bounds[k & 1, 2]] for k in range(8)]
        for a, b, c, d in quads:
            faces += [[8 * index + v for v in triple] for triple in ((a, b, c), (a, c, d))]
    return _mesh(name, np.array(vertices), np.array(faces), closed=len(corners) == 1)


def tessellated_box(name: str, cells: int, centre: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    """A closed cube of side 2, turned so that no face lies along an axis, each face cut into `cells` squared."""
    flat = grid("", cells)
    square = flat.vertices[:, [0, 2]].astype(float) * 2 / cells - 1
    sides = []
    for axis in range(3):
        for height in (-1.0, 1.0):
            points = np.empty((len(square), 3))
            points[:, axis] = height
            points[:, [(axis + 1) % 3, (axis + 2) % 3]] = square
            sides.append(points)
    faces = np.concatenate([flat.faces.astype(int) + side * len(square) for side in range(6)])
    return _mesh(name, np.concatenate(sides) @ box_turn().T + np.asarray(centre), faces, closed=True)


def box_turn() -> np.ndarray:
    """The rotation of `tessellated_box`: its columns are the normals of the faces."""
    return np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))[0]


def stairs(name: str, steps: int) -> Mesh:
    """Boxes that share faces, edges and vertices with their neighbours."""
    return boxes(name, [((i, 0, 0), (i + 1, i + 1, 4)) for i in range(steps)])


def cornell(name: str) -> Mesh:
    """A box seen from inside with two smaller ones standing on its floor, one of them turned."""
    room = boxes("", [((0, 0, 0), (5.5, 5.5, 5.6)), ((3.2, 0, 3), (4.5, 3.3, 4.4)), ((1, 0, 1), (2.5, 1.65, 2.5))])
    vertices = room.vertices.astype(float)
    angle, middle = 0.3, np.array([1.75, 0, 1.75])
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    vertices[16:] = (vertices[16:] - middle) @ turn.T + middle
    return _mesh(name, vertices, room.faces)


def soup(name: str, count: int, offset: float = 0.0, edge: float = 0.4, seed: int = 2) -> Mesh:
    """Random triangles in a cube of side 2 around (offset, offset, offset)."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-edge, edge, (count, 3, 3)) + offset
    return of_corners(name, corners)


def slivers(name: str, count: int, aspect: float) -> Mesh:
    """Long thin triangles in random directions."""
    rng = np.random.default_rng(3)
    a = rng.uniform(-1, 1, (count, 3))
    b = a + rng.normal(size=(count, 3))
    c = a + (b - a) * rng.uniform(0.3, 0.7, (count, 1)) + rng.normal(size=(count, 3)) / aspect
    return of_corners(name, np.stack([a, b, c], axis=1))


def fan(name: str, count: int) -> Mesh:
    """A cone of triangles that all share one vertex."""
    phi = 2 * np.pi * np.arange(count) / count
    rim = np.stack([np.cos(phi), 0.3 * np.sin(3 * phi), np.sin(phi)], axis=-1)
    i = np.arange(count)
    faces = np.stack([np.full(count, count), i, (i + 1) % count], axis=-1)
    return _mesh(name, np.concatenate([rim, [[0, 1, 0]]]), faces)


def split_square(name: str, triangles: int, seed: int) -> Mesh:
    """The unit square in the plane z = 0, split at random until there are so many triangles, or one more.

    A triangle is split at a point inside, or two are at a point of the edge between them, both alike: the point is
    rounded, but it is the same for all that share it, so that there are no gaps. After the watertightness test of the
    Vulkan conformance suite.
    """
    rng = np.random.default_rng([seed, triangles])
    points = [np.float32(p) for p in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))]
    faces = [(0, 1, 2), (0, 2, 3)]  # in order
    edges = {edge: face for face in faces for edge in _edges(face)}  # directed, so each has one face

    def replace(old: tuple[int, int, int], new: list[tuple[int, int, int]]) -> None:
        faces.pop(bisect_left(faces, old))
        for face in new:
            insort(faces, face)
        for edge in _edges(old):
            edges.pop(edge)
        edges.update((edge, face) for face in new for edge in _edges(face))

    while len(faces) < triangles:
        face = faces[rng.integers(len(faces))]
        weights = rng.dirichlet((1, 1, 1))
        a, b, c = face
        p = len(points)
        other = edges.get((b, a))
        if other is not None and rng.random() < 0.5:
            weights = np.array([weights[0], 1 - weights[0], 0])
            d = next(v for v in other if v not in (a, b))
            replace(other, [(b, p, d), (p, a, d)])
            replace(face, [(a, p, c), (p, b, c)])
        else:
            replace(face, [(a, b, p), (b, c, p), (c, a, p)])
        points.append(sum(np.float64(w) * points[v] for w, v in zip(weights, face, strict=True)).astype(np.float32))
    return _mesh(name, np.array(points), np.array(faces))


def _edges(face: tuple[int, int, int]) -> list[tuple[int, int]]:
    a, b, c = face
    return [(a, b), (b, c), (c, a)]


#: Twelve meshes of at most 1000 triangles.
SMALL: dict[str, Callable[[str], Mesh]] = {
    "sphere": lambda name: sphere(name, 15),
    "sphere_at_1e3": lambda name: sphere(name, 15, (1e3, -1e3, 7e2)),
    "sphere_at_2.7e5": lambda name: sphere(name, 15, (148376, 1234, -223423)),
    "bumpy_sphere": lambda name: sphere(name, 11, bumps=0.1),
    "lattice": lambda name: grid(name, 20),
    "stairs": lambda name: stairs(name, 7),
    "cube": lambda name: boxes(name, [((-1, -1, -1), (1, 1, 1))]),
    "soup": lambda name: soup(name, 500),
    "soup_at_1e4": lambda name: soup(name, 500, offset=1e4),
    "slivers": lambda name: slivers(name, 300, 1e5),
    "fan": lambda name: fan(name, 500),
    "cornell": cornell,
}


@shared()
def small_meshes() -> tuple[Mesh, ...]:
    return tuple(make(name) for name, make in SMALL.items())


def large_mesh() -> Mesh:
    """A bumpy sphere of 100,000 triangles: too many for brute force, so trees are held against each other."""
    return sphere("large", 158, bumps=0.02)
