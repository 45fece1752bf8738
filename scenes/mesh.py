"""Triangle meshes built from boxes and bent grids of points, and their PLY files.

All lengths are in metres, z points up. Everything is computed in double precision and rounded when it is written.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Indexed triangles: vertices (n, 3), faces (m, 3), and per vertex normals (n, 3) and texture uv (n, 2) or None."""

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array | None = None
    uv: Array | None = None

    def moved(self, offset: ArrayLike) -> Mesh:
        """The same mesh shifted by `offset` (3,)."""
        return Mesh(self.vertices + np.asarray(offset), self.faces, self.normals, self.uv)


def join(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of several; normals and uv are kept if every part has them."""
    parts = list(meshes)
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]

    def stack(name: str) -> Array | None:
        values = [getattr(part, name) for part in parts]
        return None if any(value is None for value in values) else np.concatenate(values)

    return Mesh(np.concatenate([part.vertices for part in parts]), np.concatenate(faces), stack("normals"), stack("uv"))


def unit(vectors: ArrayLike) -> Array:
    """`vectors` (..., 3) scaled to length one."""
    vectors = np.asarray(vectors, dtype=float)
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def quads(corners: ArrayLike) -> Mesh:
    """Flat quadrilaterals, corners (n, 4, 3) counter-clockwise seen from outside; each spans the unit square in uv."""
    corners = np.asarray(corners, dtype=float).reshape(-1, 4, 3)
    first = 4 * np.arange(len(corners))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    uv = np.tile([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], (len(corners), 1))
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).repeat(4, axis=0)
    return Mesh(corners.reshape(-1, 3), faces, normals, uv)


def boxes(low: ArrayLike, high: ArrayLike) -> Mesh:
    """Axis-aligned boxes between the opposite corners `low` and `high`, each (3,) or (n, 3); 12 triangles each."""
    bounds = np.stack(np.broadcast_arrays(np.atleast_2d(low), np.atleast_2d(high)), axis=1)
    sides = np.array(
        [
            [(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)],
            [(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
            [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)],
            [(0, 1, 0), (0, 1, 1), (1, 1, 1), (1, 1, 0)],
            [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)],
            [(1, 0, 0), (1, 1, 0), (1, 1, 1), (1, 0, 1)],
        ]
    )
    return quads(bounds[:, sides, np.arange(3)])


def intervals(edges: Array, gap: float) -> Array:
    """Start and end (n, 2) of the intervals between consecutive `edges` (n + 1,), `gap` left free at both ends."""
    return np.stack([edges[:-1] + gap, edges[1:] - gap], axis=1)


def grid(points: ArrayLike, closed: bool = False) -> Mesh:
    """Smooth surfaces through grids of points (..., rows, columns, 3), two triangles a cell.

    The normal is (along a row) x (from row to row); `closed` joins the last column to the first. Cells that have
    shrunk to a line, as at a pole, lose their empty triangles.
    """
    points = np.asarray(points, dtype=float)
    rows, columns = points.shape[-3:-1]
    index = np.arange(points.size // 3).reshape(-1, rows, columns)
    if closed:
        index = np.concatenate([index, index[..., :1]], axis=-1)
    a, b, c, d = index[:, :-1, :-1], index[:, :-1, 1:], index[:, 1:, 1:], index[:, 1:, :-1]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    vertices = points.reshape(-1, 3)
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    kept = np.linalg.norm(area, axis=-1) > 1e-12
    faces, area = faces[kept], area[kept]
    normals = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], area)
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3), unit(normals[used]))


def revolved(profile: ArrayLike, sides: int) -> Mesh:
    """A profile (k, 2) of (radius, height), walked upwards along the outside, turned about the z axis."""
    radius, height = np.asarray(profile, dtype=float).T[:, :, None]
    angle = 2 * np.pi * np.arange(sides) / sides
    return grid(np.stack(np.broadcast_arrays(radius * np.cos(angle), radius * np.sin(angle), height), -1), closed=True)


def tubes(centres: ArrayLike, radii: ArrayLike, sides: int) -> Mesh:
    """Round tubes about the curves `centres` (n, k, 3), `radii` broadcast to (n, k); the ends stay open."""
    centres = np.asarray(centres, dtype=float)
    tangent = unit(np.gradient(centres, axis=1))
    chord = np.abs(centres[:, -1] - centres[:, 0])
    across = np.eye(3)[chord.argmin(axis=1)][:, None]
    first = unit(across - tangent * (across * tangent).sum(-1, keepdims=True))
    second = np.cross(tangent, first)
    angle = 2 * np.pi * np.arange(sides)[:, None] / sides
    ring = first[:, :, None] * np.cos(angle) + second[:, :, None] * np.sin(angle)
    thickness = np.broadcast_to(radii, centres.shape[:2])[..., None, None]
    return grid(centres[:, :, None] + thickness * ring, closed=True)


def write_ply(mesh: Mesh, path: Path) -> None:
    """Writes `mesh` as little-endian binary PLY: float32 per vertex, int32 triangles.

    Values are rounded to 2^-20 (about a micrometre), so that a last bit of sin or cos that differs between machines
    does not reach the file.
    """
    columns = [(mesh.vertices, "xyz"), (mesh.normals, ("nx", "ny", "nz")), (mesh.uv, "uv")]
    present = [(values, names) for values, names in columns if values is not None]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    header += [f"property float {name}" for _, names in present for name in names]
    header += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(len(mesh.faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    vertices = np.concatenate([values for values, _ in present], axis=1)
    vertices = (np.round(vertices * 2**20) / 2**20 + 0.0).astype("<f4")
    path.write_bytes("\n".join(header).encode("ascii") + vertices.tobytes() + faces.tobytes())
