"""The audit of trees sees what is wrong with them, and measures cells rightly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification.audit import NeutralTree, missing, neutral_tree
from mitsuba_bsp.verification.meshes import Mesh, boxes, sphere
from mitsuba_bsp.verification.polygons import Real, cut, heights
from mitsuba_bsp.verification.volumes import cell_volumes

SPHERE = sphere("sphere", 6)
EVERYTHING = np.arange(len(SPHERE.faces))


@pytest.fixture(params=["kd", "normals", "ize"])
def tree(request: pytest.FixtureRequest) -> NeutralTree:
    return neutral_tree(SPHERE, parse_spec(f"{request.param}:intersection_cost=2"))


def test_a_tree_is_complete(tree: NeutralTree) -> None:
    assert missing(tree, SPHERE, EVERYTHING) == []
    assert len(tree.is_leaf) > 30


def test_references_that_are_left_out_are_missed(tree: NeutralTree) -> None:
    """All but those of triangles that lie in a plane or only touch their cell."""
    seen = 0
    for position in range(0, len(tree.references), 2):
        references = tree.references.copy()
        lost, references[position] = int(references[position]), 2**31
        absent = missing(replace(tree, references=references), SPHERE, EVERYTHING)
        assert [triangle for _, triangle in absent] in ([], [lost])
        seen += len(absent)
    assert seen > 3


def test_a_moved_plane_is_seen(tree: NeutralTree) -> None:
    """By a thousandth of the sphere's size, at the root."""
    offsets = tree.offsets.copy()
    offsets[0] += 4e-3
    assert missing(replace(tree, offsets=offsets), SPHERE, EVERYTHING) != []


def test_the_cells_of_a_tree_fill_the_root(tree: NeutralTree) -> None:
    (volumes,) = cell_volumes(tree)
    size = np.prod(tree.box[1] - tree.box[0])
    assert volumes[0] == pytest.approx(size, rel=1e-12)
    assert volumes[tree.is_leaf].sum() == pytest.approx(size, rel=1e-9)
    inner = np.flatnonzero(~tree.is_leaf)
    assert np.allclose(volumes[inner], volumes[inner + 1] + volumes[tree.above[inner]], rtol=1e-9, atol=1e-9)


def test_volumes_of_known_cells() -> None:
    """A cube of side 2 cut in half by an oblique plane, and one half at a quarter."""
    cube = boxes("cube", [((0, 0, 0), (2, 2, 2))])
    tree = neutral_tree(cube, parse_spec("kd:max_depth=1"))
    tree = replace(
        tree,
        is_leaf=np.array([False, True, False, True, True]),
        normals=np.array([[1, 1, 0], [0, 0, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]], float),
        offsets=np.array([2, 0, 0.5, 0, 0], float),
        above=np.array([2, 0, 4, 0, 0], np.uint32),
        box=np.array([[0, 0, 0], [2, 2, 2]], float),
    )
    assert cell_volumes(tree)[0].tolist() == pytest.approx([8, 4, 4, 1, 3], rel=1e-12)


def test_polygons_are_cut() -> None:
    square = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]], Real)
    squares = np.repeat(square, 4, axis=0)
    normals = np.array([[1.0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 1, 0]])
    parts, kept = cut(squares, heights(squares, normals, np.array([-1, 2, 0.25, 0.5])))
    assert kept.tolist() == [False, True, True, True]
    corners = [{tuple(map(float, p)) for p in part} for part in parts]
    assert corners[0] == {(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)}
    assert corners[1] == {(0, 0, 0), (0.25, 0, 0), (0.25, 1, 0), (0, 1, 0)}
    assert corners[2] == {(0, 0, 0), (0.5, 0, 0), (0, 0.5, 0)}


def test_a_mesh_without_triangles_is_one_leaf() -> None:
    empty = Mesh("empty", np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    tree = neutral_tree(empty, parse_spec("kd"))
    assert tree.is_leaf.tolist() == [True] and missing(tree, empty, np.arange(0)) == []
