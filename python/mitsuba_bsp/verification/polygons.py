"""Convex polygons cut by planes, many at once, in the precision that they are given in.

Polygons of different numbers of vertices are rows of one array (m, k, 3); the shorter ones repeat a vertex at the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: 64 bits of precision on x86, 11 more than the builder has; for what must be decided closer than the builder does.
Real = np.longdouble

Polygons = NDArray[np.floating]


def heights(polygons: Polygons, normals: NDArray, offsets: NDArray) -> NDArray[np.floating]:
    """(m, k): normal . vertex - offset, with a plane for each polygon."""
    real = polygons.dtype
    return np.einsum("mkj,mj->mk", polygons, normals.astype(real)) - offsets.astype(real)[:, None]


def cut(polygons: Polygons, above: NDArray[np.floating]) -> tuple[Polygons, NDArray[np.bool_]]:
    """The parts of polygons where `above` (m, k), which is linear on each of them, is not positive, and which exist.

    Those that do not exist are left out of the first result; the second has an entry for every polygon given.
    """
    inside = above <= 0
    kept = inside.any(axis=1)
    whole = inside.all(axis=1)
    crossed = kept & ~whole
    if not crossed.any():
        return polygons[kept], kept
    parts = _cut_crossed(polygons[crossed], above[crossed])
    width = max(parts.shape[1], polygons.shape[1])
    result = np.empty((len(polygons), width, 3), polygons.dtype)
    result[whole] = _widened(polygons[whole], width)
    result[crossed] = _widened(parts, width)
    return result[kept], kept


def _cut_crossed(polygons: Polygons, above: NDArray[np.floating]) -> Polygons:
    """Of polygons that have vertices on both sides."""
    following, above_following = np.roll(polygons, -1, axis=1), np.roll(above, -1, axis=1)
    inside, inside_following = above <= 0, above_following <= 0
    crossing = inside != inside_following
    step = np.where(crossing, above - above_following, above.dtype.type(1))
    points = polygons + (following - polygons) * (above / step)[..., None]
    count, width = above.shape
    vertices = np.stack([polygons, points], axis=2).reshape(count, 2 * width, 3)
    chosen = np.stack([inside, crossing], axis=2).reshape(count, 2 * width)
    order = np.argsort(~chosen, axis=1, kind="stable")
    numbers = chosen.sum(axis=1)
    columns = np.arange(numbers.max())
    order = np.where(columns < numbers[:, None], order[:, : len(columns)], order[:, :1])
    return np.take_along_axis(vertices, order[..., None], axis=1)


def joined(*parts: Polygons) -> Polygons:
    """All of them in one array."""
    width = max(polygons.shape[1] for polygons in parts)
    return np.concatenate([_widened(polygons, width) for polygons in parts])


def _widened(polygons: Polygons, width: int) -> Polygons:
    """With the last vertex repeated up to `width` vertices."""
    missing = width - polygons.shape[1]
    return np.concatenate([polygons, np.repeat(polygons[:, -1:], missing, axis=1)], axis=1) if missing else polygons
