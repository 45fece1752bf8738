"""Trees over arrays: answers in the shape that is promised, and clear errors for arrays that make no sense."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_bsp import NO_TRIANGLE, Accelerator, survey_planes
from mitsuba_bsp.verification.meshes import sphere

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], np.float32)
FACES = np.array([[0, 1, 2], [3, 4, 5]], np.int32)

DOWN = np.array([[0, 0, -1]] * 3, np.float32)
ABOVE = np.array([[0.25, 0.25, 3], [0.25, 0.25, 0.5], [2, 2, 3]], np.float32)

SPECS = ["kd", "ize", "random", "normals:k=4", "clustered", "brute"]


@pytest.mark.parametrize("spec", SPECS)
def test_closest_hits(spec: str) -> None:
    found = Accelerator(CORNERS, FACES, spec).closest(ABOVE, DOWN)
    assert found["triangle"].tolist() == [1, 0, NO_TRIANGLE]
    assert found["t"].tolist() == [2.0, 0.5, np.inf]
    assert found["u"][:2].tolist() == found["v"][:2].tolist() == [0.25, 0.25]


@pytest.mark.parametrize("spec", SPECS)
def test_any_hit_and_ends_of_rays(spec: str) -> None:
    tree = Accelerator(CORNERS, FACES, spec)
    assert tree.any(ABOVE, DOWN).tolist() == [True, True, False]
    assert tree.any(ABOVE, DOWN).dtype == np.bool_
    assert tree.any(ABOVE, DOWN, 1.0).tolist() == [False, True, False]
    assert tree.any(ABOVE, DOWN, [2.0, 0.25, np.inf]).tolist() == [True, False, False]


def test_counts_are_per_ray() -> None:
    counted = Accelerator(CORNERS, FACES, "brute").count(ABOVE, DOWN)
    assert counted["triangle_tests"].tolist() == [2, 2, 2]
    assert counted["axis_steps"].tolist() == [0, 0, 0]


@pytest.mark.parametrize("dtype", [np.int8, np.uint16, np.int32, np.uint32, np.int64, np.uint64])
def test_faces_of_any_integer_type(dtype: type) -> None:
    assert Accelerator(CORNERS.tolist(), FACES.astype(dtype)).any(ABOVE, DOWN)[0]


def test_arrays_need_not_be_contiguous() -> None:
    wide = np.zeros((6, 6))
    wide[:, ::2] = CORNERS
    found = Accelerator(wide[:, ::2], np.asfortranarray(FACES)).closest(ABOVE, np.asfortranarray(DOWN))
    assert found["triangle"].tolist() == [1, 0, NO_TRIANGLE]


def test_triangles_that_are_not_finite_are_left_out_and_the_others_keep_their_numbers() -> None:
    corners = CORNERS.copy()
    corners[0, 0] = np.nan
    with pytest.warns(UserWarning, match="1 of 2 triangles"):
        tree = Accelerator(corners, FACES)
    assert tree.statistics()["dropped_triangles"] == 1
    assert tree.closest(ABOVE, DOWN)["triangle"].tolist() == [1, NO_TRIANGLE, NO_TRIANGLE]


def test_no_triangles_at_all() -> None:
    tree = Accelerator(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32))
    assert tree.any(ABOVE, DOWN).tolist() == [False] * 3
    assert tree.statistics()["triangles"] == 0


def test_split_planes() -> None:
    planes = Accelerator(CORNERS, FACES, "kd").planes()
    assert planes.ndim == 2 and planes.shape[1] == 4
    assert Accelerator(CORNERS, FACES, "brute").planes().shape == (0, 4)


WRONG_TRIANGLES = pytest.mark.parametrize(
    ("vertices", "faces", "kind", "sentence"),
    [
        (CORNERS[:, :2], FACES, ValueError, r"vertices must have the shape \(n, 3\), but has \(6, 2\)"),
        (CORNERS.ravel(), FACES, ValueError, r"vertices must have the shape \(n, 3\), but has \(18,\)"),
        (CORNERS.astype(int), FACES, TypeError, "vertices must be float32 or float64, but is int64"),
        (CORNERS, FACES.astype(float), TypeError, "faces must be integers, but are float64"),
        (CORNERS, FACES.ravel(), ValueError, r"faces must have the shape \(n, 3\), but has \(6,\)"),
        (CORNERS, [[0, 1, 6]], IndexError, "face 0 refers to vertex 6, but there are 6 vertices"),
        (CORNERS, [[0, 1, 2], [0, -1, 2]], IndexError, "face 1 refers to vertex -1, but there are 6 vertices"),
    ],
)


@WRONG_TRIANGLES
def test_wrong_triangles(vertices: object, faces: object, kind: type[Exception], sentence: str) -> None:
    with pytest.raises(kind, match=sentence):
        Accelerator(vertices, faces)


@WRONG_TRIANGLES
def test_wrong_triangles_of_a_survey(vertices: object, faces: object, kind: type[Exception], sentence: str) -> None:
    with pytest.raises(kind, match=sentence):
        survey_planes(vertices, faces, "kd")


@pytest.mark.parametrize(
    ("origins", "directions", "maxt", "kind", "sentence"),
    [
        (ABOVE[0], DOWN, np.inf, ValueError, r"origins must have the shape \(n, 3\), but has \(3,\)"),
        (ABOVE, DOWN[:2], np.inf, ValueError, r"directions must have the shape \(3, 3\), but has \(2, 3\)"),
        (ABOVE, DOWN, [1.0, 2.0], ValueError, r"maxt must have the shape \(3,\), but has \(2,\)"),
        (ABOVE, DOWN.astype(complex), np.inf, TypeError, "directions must be float32 or float64, but is complex128"),
    ],
)
@pytest.mark.parametrize("query", ["closest", "any", "count"])
def test_wrong_rays(
    query: str, origins: object, directions: object, maxt: object, kind: type[Exception], sentence: str
) -> None:
    with pytest.raises(kind, match=sentence):
        getattr(Accelerator(CORNERS, FACES), query)(origins, directions, maxt)


@pytest.mark.parametrize("spec", ["embree", "native"])
def test_mitsubas_accelerators_need_a_scene(spec: str) -> None:
    with pytest.raises(ValueError, match=f'"{spec}" exists only inside Mitsuba .*kd'):
        Accelerator(CORNERS, FACES, spec)


@pytest.mark.parametrize(
    ("spec", "planes"),
    [
        ("kd", (6, 6)),  # x, y and z, each at 0 and at 1
        ("random:axes=none,k=4", (16, 16)),  # along four directions, both ends of both triangles
        ("ize", (14, 7)),  # those of kd; each triangle's own and three along its edges, where only x + y = 1 is new
    ],
)
def test_the_planes_of_a_single_split(spec: str, planes: tuple[int, int]) -> None:
    separator = "," if ":" in spec else ":"
    assert survey_planes(CORNERS, FACES, f"{spec}{separator}intersection_cost=100") == ([planes], planes)


def test_where_nothing_is_split_there_are_no_planes() -> None:
    assert survey_planes(CORNERS, FACES, "kd:leaf_size=2") == ([], (0, 0))
    assert survey_planes(CORNERS[:0], FACES[:0], "kd") == ([], (0, 0))


@pytest.mark.parametrize("tree", ["kd", "random", "normals", "clustered", "rbsp", "ize"])
def test_the_planes_of_a_whole_tree(tree: str) -> None:
    mesh = sphere("ball", 12)
    spec = f"{tree}:exact_below={len(mesh.faces)}"
    levels, (considered, different) = survey_planes(mesh.vertices, mesh.faces, spec)
    priced = [level["planes"] for level in Accelerator(mesh.vertices, mesh.faces, spec).statistics()["levels"]]
    assert len(levels) == sum(count > 0 for count in priced) > 5
    assert all(0 < fresh <= total <= most for (total, fresh), most in zip(levels, priced, strict=False))
    assert considered == sum(total for total, _ in levels)
    assert max(fresh for _, fresh in levels) <= different <= sum(fresh for _, fresh in levels)
    # Planes along fixed directions, and those of triangles, come back in node after node; others mostly do not.
    assert different > considered / 2 if tree in ("random", "normals", "clustered") else different < considered / 8


def test_a_survey_without_large_exact_sweeps_sees_fewer_planes() -> None:
    mesh = sphere("ball", 12)
    whole = [survey_planes(mesh.vertices, mesh.faces, f"kd:exact_below={n}")[0][0][0] for n in (1, 100_000)]
    assert 0 < whole[0] < whole[1]


@pytest.mark.parametrize("spec", ["brute", "embree", "embree:robust=true", "native"])
def test_a_survey_needs_a_tree_of_ours(spec: str) -> None:
    sentence = f'^spec "{spec}": "{spec.partition(":")[0]}" sweeps no planes here \\(valid here: auto, kd, [a-z, ]+\\)$'
    with pytest.raises(ValueError, match=sentence) as caught:
        survey_planes(CORNERS, FACES, spec)
    assert "brute" not in str(caught.value).partition("valid here")[2]
