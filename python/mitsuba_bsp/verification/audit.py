"""Whether a tree lists every triangle wherever it must, found by cutting the triangles once more.

Nothing of the builder is used but its result: planes and lists. Triangles go down the tree, each cut by every plane on
its way in extended precision; a part that reaches a leaf's cell must be listed in that leaf. Cells are taken smaller by
a slack: what lies in a plane, give or take the slack, may be on either side of it, for rays are followed on both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..spec import Spec
from .meshes import Mesh
from .polygons import Real, cut, heights, joined

#: Of the largest coordinate. The builder rounds at 2^-53 of it, a few times; the traversal allows for 2^-24.
SLACK = 2.0**-45


@dataclass(frozen=True)
class NeutralTree:
    """A tree before packing: nodes depth first, the child below follows its parent. Planes and box are as seen in the
    tree's own axes."""

    is_leaf: NDArray[np.bool_]
    normals: NDArray[np.float64]  #: (n, 3)
    offsets: NDArray[np.float64]
    above: NDArray[np.uint32]  #: node of the child above
    first: NDArray[np.uint32]  #: of a leaf's part of `references`
    count: NDArray[np.uint32]
    references: NDArray[np.uint32]
    box: NDArray[np.float64]  #: lower and upper corner of the root's cell
    plane_tolerance: float  #: by which triangles may lie beyond oblique planes
    depth: int
    axes: NDArray[np.float64]  #: (3, 3), a row an axis
    origin: NDArray[np.float64]  #: the point that is seen as 0

    def seen(self, points: NDArray[np.floating]) -> NDArray[np.floating]:
        """Points (..., 3) in the tree's axes, rounded to floats as the builder does if these are not the user's."""
        if np.array_equal(self.axes, np.eye(3)):
            return points
        x, y, z = np.moveaxis(points.astype(float) - self.origin, -1, 0)
        along = [x * axis[0] + y * axis[1] + z * axis[2] for axis in self.axes]
        return np.stack(along, axis=-1).astype(np.float32)

    def unseen(self, points: NDArray[np.floating]) -> NDArray[np.floating]:
        """Points (..., 3) of the tree's axes in the user's."""
        return points @ self.axes.astype(points.dtype) + self.origin.astype(points.dtype)

    def seen_plane(self, plane: NDArray[np.float64]) -> NDArray[np.float64]:
        """The plane (normal, offset) in the tree's axes."""
        return np.append(self.axes @ plane[:3], plane[3] - plane[:3] @ self.origin)

    def listed(self) -> set[tuple[int, int]]:
        """Every (leaf, triangle) in the lists."""
        leaves = np.flatnonzero(self.is_leaf)
        owners = np.repeat(leaves, self.count[leaves])
        return set(zip(owners.tolist(), self.references.tolist(), strict=True))


def neutral_tree(mesh: Mesh, spec: Spec) -> NeutralTree:
    """Build a tree and leave it unpacked."""
    parts = _core.neutral_tree(mesh.vertices, mesh.faces, spec.name, dict(spec.options))
    planes = parts.pop("planes").reshape(-1, 4).astype(float)
    is_leaf, box, axes = parts.pop("is_leaf").astype(bool), parts.pop("box").reshape(2, 3), parts.pop("axes")
    return NeutralTree(
        is_leaf=is_leaf, normals=planes[:, :3], offsets=planes[:, 3], box=box, axes=axes.reshape(3, 3), **parts
    )


def depths(tree: NeutralTree) -> NDArray[np.int64]:
    """Interior nodes above each node."""
    depth = np.zeros(len(tree.is_leaf), int)
    for node in np.flatnonzero(~tree.is_leaf):
        depth[node + 1] = depth[tree.above[node]] = depth[node] + 1
    return depth


def missing(tree: NeutralTree, mesh: Mesh, valid: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Every (leaf, triangle) that must be listed and is not."""
    slack = SLACK * float(np.abs(tree.box).max()) if len(valid) else 0.0
    oblique = (tree.normals != 0).sum(axis=1) > 1
    slacks = np.where(oblique, tree.plane_tolerance + 3 * slack, slack)
    triangles = np.asarray(valid)
    polygons = tree.seen(mesh.vertices[mesh.faces[triangles]]).astype(Real)
    nodes = np.zeros(len(triangles), int)
    listed, absent = tree.listed(), []
    while len(nodes):
        at_leaf = tree.is_leaf[nodes]
        pairs = zip(nodes[at_leaf].tolist(), triangles[at_leaf].tolist(), strict=True)
        absent += [pair for pair in pairs if pair not in listed]
        nodes, triangles, polygons = nodes[~at_leaf], triangles[~at_leaf], polygons[~at_leaf]
        height = heights(polygons, tree.normals[nodes], tree.offsets[nodes])
        margin = slacks[nodes].astype(Real)[:, None]
        below, goes_below = cut(polygons, height + margin)
        above, goes_above = cut(polygons, margin - height)
        nodes = np.concatenate([nodes[goes_below] + 1, tree.above[nodes[goes_above]].astype(int)])
        triangles = np.concatenate([triangles[goes_below], triangles[goes_above]])
        polygons = joined(below, above)
    return absent
