"""The volumes of the cells of trees, which are convex polyhedra kept as lists of faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .audit import NeutralTree
from .polygons import Polygons, cut, heights, joined


def cell_volumes(*trees: NeutralTree) -> list[NDArray[np.float64]]:
    """Of every node's cell of each tree; a root's is its box. Works downward, all cells of a depth at once."""
    if not trees:
        return []
    starts = np.cumsum([0, *(len(tree.is_leaf) for tree in trees)])
    is_leaf = np.concatenate([tree.is_leaf for tree in trees])
    above = np.concatenate([tree.above.astype(int) + start for tree, start in zip(trees, starts[:-1], strict=True)])
    normals = np.concatenate([tree.normals for tree in trees])
    offsets = np.concatenate([tree.offsets for tree in trees])
    volumes = np.zeros(len(is_leaf))
    owners, faces = np.repeat(starts[:-1], 6), np.concatenate([_box_faces(tree.box) for tree in trees])
    while len(owners):
        _add_volumes(volumes, owners, faces)
        inner = ~is_leaf[owners]
        owners, faces = owners[inner], faces[inner]
        if not len(owners):
            break
        height = heights(faces, normals[owners], offsets[owners])
        caps, cap_owners = _caps(normals, owners, faces, height)
        parts = []
        for sign, child in ((1, lambda nodes: nodes + 1), (-1, lambda nodes: above[nodes])):
            kept, exists = cut(faces, sign * height)
            parts += [(child(owners[exists]), kept), (child(cap_owners), caps)]
        owners = np.concatenate([nodes for nodes, _ in parts])
        faces = joined(*(polygons for _, polygons in parts))
    return np.split(volumes, starts[1:-1])


def _box_faces(box: NDArray[np.float64]) -> Polygons:
    faces = []
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        for side in box:
            face = np.tile(side, (4, 1))
            face[:, i] = box[[0, 1, 1, 0], i]
            face[:, j] = box[[0, 0, 1, 1], j]
            faces.append(face)
    return np.array(faces)


def _add_volumes(volumes: NDArray[np.float64], owners: NDArray[np.intp], faces: Polygons) -> None:
    """Pyramids from a point inside each cell over its faces."""
    cells, cell = np.unique(owners, return_inverse=True)
    middle = np.zeros((len(cells), 3))
    np.add.at(middle, cell, faces.mean(axis=1))
    middle /= np.bincount(cell)[:, None]
    seen = faces - middle[cell][:, None]
    fans = np.einsum("mkj,mkj->mk", np.cross(seen[:, :1], seen[:, 1:-1]), seen[:, 2:])
    np.add.at(volumes, owners, np.abs(fans.sum(axis=1)) / 6)


def _caps(
    normals: NDArray[np.float64], owners: NDArray[np.intp], faces: Polygons, height: NDArray[np.float64]
) -> tuple[Polygons, NDArray[np.intp]]:
    """The polygon in which each cell meets its own plane: where the plane crosses edges, in order of the angle."""
    following, height_following = np.roll(faces, -1, axis=1), np.roll(height, -1, axis=1)
    crossing = (height <= 0) != (height_following <= 0)
    step = np.where(crossing, height - height_following, 1.0)
    points = (faces + (following - faces) * (height / step)[..., None])[crossing]
    cell_of_point = np.repeat(owners, crossing.sum(axis=1))
    if not len(points):
        return np.empty((0, 3, 3)), np.empty(0, int)
    cells, cell, numbers = np.unique(cell_of_point, return_inverse=True, return_counts=True)
    middle = np.zeros((len(cells), 3))
    np.add.at(middle, cell, points)
    middle /= numbers[:, None]
    normal = normals[cells]
    first = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    second = np.cross(normal / np.linalg.norm(normal, axis=1, keepdims=True), first)
    seen = points - middle[cell]
    angle = np.arctan2((seen * second[cell]).sum(axis=1), (seen * first[cell]).sum(axis=1))
    order = np.lexsort((angle, cell))
    starts = np.concatenate([[0], np.cumsum(numbers)[:-1]])
    columns = np.minimum(np.arange(max(3, numbers.max()))[None], numbers[:, None] - 1)
    return points[order][starts[:, None] + columns], cells
