"""What the checks of `mitsuba-bsp verify` are made of: rays that are aimed, differences that are seen."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from mitsuba_bsp import _core
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification.meshes import Mesh, large_mesh, small_meshes, sphere
from mitsuba_bsp.verification.oracle import Questions, build, differing, family_rng, found, questions
from mitsuba_bsp.verification.rays import FAMILIES
from mitsuba_bsp.verification.subjects import trees

RAYS_PER_FAMILY = 10_000


@pytest.fixture(scope="module")
def trees_of_large_mesh() -> tuple[Mesh, tuple[Questions, ...]]:
    """The questions' answers are those of a kd-tree: brute force would take too long."""
    mesh = large_mesh()
    assert 99_000 <= len(mesh.faces) <= 101_000
    kd = build(mesh, parse_spec("kd"))
    asked = []
    for family, make in FAMILIES.items():
        o, d = make(mesh, RAYS_PER_FAMILY, family_rng(2, family))
        maxt = np.full(len(o), np.inf, np.float32)
        asked.append(Questions(mesh, family, 2, o, d, maxt, kd.closest(o, d, maxt)))
    return mesh, tuple(asked)


@pytest.mark.parametrize("spec", [s for tree in trees()[1:] for s in (tree, f"{tree}:layout=binary")])
def test_trees_of_a_large_mesh_agree(trees_of_large_mesh: tuple[Mesh, tuple[Questions, ...]], spec: str) -> None:
    mesh, asked = trees_of_large_mesh
    tree = build(mesh, parse_spec(spec))
    for stream in asked:
        wrong = differing(tree.closest(*stream.rays), stream.expected)
        assert not wrong.any(), stream.describe(int(np.argmax(wrong)))


@pytest.mark.parametrize("layout", ["binary", "wide"])
@pytest.mark.parametrize("given_up", ["precision=fast", "precision=epsilon", "early_exit=plane"])
@pytest.mark.parametrize("tree", ["kd", "rbsp", "ize", "normals"])
def test_less_precision_loses_only_rays_that_are_aimed(tree: str, given_up: str, layout: str) -> None:
    """It answers every ray, ordinary ones as it should but for ties, and fails where it must."""
    spec = parse_spec(f"{tree}:{given_up},layout={layout}")
    rays, wrong = Counter(), Counter()
    for mesh in small_meshes():
        accelerator = build(mesh, spec)
        for asked in questions(mesh, 2000, seed=1):
            rays[asked.family] += len(asked)
            wrong[asked.family] += int(differing(accelerator.closest(*asked.rays), asked.expected).sum())
    assert wrong["random"] + wrong["camera"] < 1e-3 * (rays["random"] + rays["camera"])
    least = 0 if given_up == "early_exit=plane" else 1e-4 * rays.total()  # it gives up the least
    assert least < wrong.total() < 2e-2 * rays.total()


def test_rays_are_aimed() -> None:
    """Where they hit, barycentric coordinates are 0 or sum to 1 (the far half is behind other triangles)."""
    mesh = sphere("aimed", 15)
    brute = _core.Accelerator(mesh.vertices, mesh.faces, "brute")
    shares = {}
    for family in ("vertex", "edge", "random"):
        o, d = FAMILIES[family](mesh, 2000, np.random.default_rng(4))
        hit = brute.closest(o, d, np.full(len(o), np.inf, np.float32))
        u, v = hit["u"][found(hit)], hit["v"][found(hit)]
        shares[family] = (np.minimum(np.minimum(u, v), 1 - u - v) < 1e-5).mean()
    assert shares["vertex"] > 0.5
    assert shares["edge"] > 0.5
    assert shares["random"] < 0.01


def test_a_difference_is_a_difference_of_bits() -> None:
    one = {
        "t": np.float32([1, 0, 2]),
        "u": np.float32([0, 0, 0]),
        "v": np.float32([0, 0, 0]),
        "triangle": np.uint32([1, 2, 3]),
    }
    two = {**one, "t": np.float32([1, -0.0, 2.0000002])}
    assert differing(one, two).tolist() == [False, True, True]


def test_a_fault_is_planted_in_the_tree_that_auto_chooses() -> None:
    """For no rays it is the one that is built soonest, which has other planes than kd."""
    mesh = large_mesh()
    quick = parse_spec("auto:expected_rays=0")
    planes = [build(mesh, spec, fault).planes().tolist() for spec, fault in ((quick, ""), (quick, "no_bound"))]
    assert planes[0] == planes[1] != build(mesh, parse_spec("kd")).planes().tolist()
