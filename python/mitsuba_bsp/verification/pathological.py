"""Meshes on which builders without caps list every triangle everywhere, split for ever, or take for ever."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .meshes import Mesh, of_corners, slivers

MESHES, TRIANGLES = 5, 100_000


@lru_cache(maxsize=2)
def pathological_meshes(share: float = 1.0) -> tuple[Mesh, ...]:
    """Five of them, of `share` times 100,000 triangles, the slivers of a tenth of that."""
    count = round(share * TRIANGLES)
    rng = np.random.default_rng(13)
    return (
        _identical(count),
        _through_one_point(count, rng),
        slivers("long slivers", count // 10, 1e5),
        _coplanar(count, rng),
        _two_clusters(count, rng),
    )


def _identical(count: int) -> Mesh:
    corners = np.float32([[-0.5, 0, -0.3], [0.7, 0.1, 0], [0, 0.9, 0.4]])
    return Mesh("identical", corners, np.tile(np.arange(3, dtype=np.uint32), (count, 1)))


def _through_one_point(count: int, rng: np.random.Generator) -> Mesh:
    """A ball of triangles that share their first vertex."""
    rim = rng.normal(size=(count, 2, 3))
    rim /= np.linalg.norm(rim, axis=2, keepdims=True)
    centre = np.broadcast_to([0.1, 0.2, 0.3], (count, 1, 3))
    return of_corners("through one point", np.concatenate([centre, rim], axis=1))


def _coplanar(count: int, rng: np.random.Generator) -> Mesh:
    """Overlapping triangles in one plane."""
    plane = rng.uniform(size=(count, 1, 2)) + rng.uniform(-0.02, 0.02, (count, 3, 2))
    return of_corners("coplanar", np.concatenate([plane, np.full((count, 3, 1), 0.25)], axis=2))


def _two_clusters(count: int, rng: np.random.Generator) -> Mesh:
    """Two clouds of size 100 that are 1e6 apart."""
    corners = rng.uniform(-50, 50, (count, 1, 3)) + rng.uniform(-2.5, 2.5, (count, 3, 3))
    corners[count // 2 :] += np.array([0.6e6, -0.48e6, 0.64e6])
    return of_corners("two clusters", corners)
