"""Every tree of C01 and C08, looked into: is each triangle wherever a ray may look for it?"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .audit import NeutralTree, depths, missing, neutral_tree
from .check import Failure, Outcome, Plan, Subject, Unit, check, subject_units
from .meshes import Mesh, small_meshes
from .volumes import cell_volumes
from .zoo import has_area, zoo

#: The traversal stack has room for a tree of this depth.
DEPTH_LIMIT = 60


@check("C12", "trees list every triangle wherever it must be", at_once=True)
def audit_trees(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _audit)


def _audit(plan: Plan, subject: Subject) -> Outcome:
    """Variants: a tenth of the meshes, others for each of them."""
    outcome = Outcome(what="nodes")
    filled = []
    for mesh in subject.part_of((*small_meshes(), *zoo()), 10):
        tree = neutral_tree(mesh, subject.spec)
        _audit_tree(outcome, plan, subject, mesh, tree)
        root = float(np.prod(tree.box[1] - tree.box[0]))
        if has_area(mesh).any() and np.isfinite(root):
            filled.append((mesh, tree, root))
    for (mesh, tree, root), volumes in zip(filled, cell_volumes(*(tree for _, tree, _ in filled)), strict=True):
        leaves = float(volumes[tree.is_leaf].sum())
        text = f"{subject.spec.text}, {mesh.name}: leaves fill {leaves / root:.9f} of the root"
        outcome.expect("volume", abs(leaves - root) <= 1e-6 * root, text)
    return outcome


def _audit_tree(outcome: Outcome, plan: Plan, subject: Subject, mesh: Mesh, tree: NeutralTree) -> None:
    valid = np.flatnonzero(has_area(mesh))
    absent = missing(tree, mesh, valid)
    text = f"{subject.spec.text}, {mesh.name}"

    def failure() -> Failure:
        leaf, triangle = absent[0]
        corners = " ".join(str([float(x).hex() for x in v]) for v in mesh.vertices[mesh.faces[triangle]])
        return Failure(f"{text}: leaf {leaf} does not list triangle {triangle}, {corners}, which is in its cell")

    outcome.add("references", len(tree.is_leaf), len(absent), failure)
    outcome.figures["references"] = int(outcome.figures.get("references", 0)) + len(tree.references)
    deepest = int(depths(tree).max())
    allowed = depth_allowed(subject, len(valid))
    outcome.expect("depth", deepest == tree.depth <= allowed, f"{text}: depth {deepest}, but {allowed} are allowed")


def depth_allowed(subject: Subject, triangles: int) -> int:
    """What the settings allow: `max_depth`, or if that is 0 a margin and 1.6 levels for each doubling."""
    settings = subject.spec.settings
    if settings["max_depth"]:
        return int(settings["max_depth"])
    return min(DEPTH_LIMIT, math.floor(settings["depth_margin"] + 1.6 * math.log2(max(1, triangles)) + 0.5))
