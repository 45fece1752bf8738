"""Every tree against brute force, bit for bit, with rays aimed where trees fail; and proof that the tests can see."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_bsp import _core
from mitsuba_bsp.verification.meshes import Mesh, large_mesh, small_meshes, sphere
from mitsuba_bsp.verification.oracle import NO_TRIANGLE, Oracle, differing
from mitsuba_bsp.verification.rays import FAMILIES, interior_rays

RAYS_PER_FAMILY = 10_000  #: times 9 families, times 12 meshes: 1.08 million rays a spec
AXES = ("none", "plain", "fast")


def is_valid(tree: str, options: dict[str, str]) -> bool:
    try:
        _core.settings(tree, options)
    except ValueError:
        return False
    return True


#: Every tree there is, a new one included, with every axes policy it has, and those that leave the usual rules.
SPECS = [
    (tree, {"axes": axes} if axes else {})
    for tree in _core.trees()
    if tree != "brute"
    for axes in (AXES if "axes" in _core.settings(tree, {}) else ("",))
    if not axes or is_valid(tree, {"axes": axes})
]
SPECS += [(tree, {"layout": "binary"}) for tree in _core.trees() if tree != "brute"]
SPECS += [("rbsp", {"directions": "spiral", "k": "8"}), ("normals", {"cost": "thesis"}), ("kd", {"cost": "thesis"})]
SPEC_IDS = [":".join([tree, *options.values()]) for tree, options in SPECS]


@pytest.fixture(scope="module")
def oracles() -> list[Oracle]:
    return [Oracle(mesh, RAYS_PER_FAMILY, seed=1) for mesh in small_meshes()]


@pytest.mark.parametrize(("tree", "options"), SPECS, ids=SPEC_IDS)
def test_equal_to_brute_force(oracles: list[Oracle], tree: str, options: dict[str, str]) -> None:
    found = [oracle.compare(tree, options) for oracle in oracles]
    assert sum(differences.rays for differences in found) >= 1_000_000
    assert [str(differences) for differences in found if differences.total] == []


@pytest.mark.parametrize(
    "options",
    [
        {"k": "3"},
        {"k": "32"},
        {"axes": "none", "k": "1"},
        {"intersection_cost": "100"},
        {"leaf_size": "64"},
        {"max_depth": "3"},
    ],
    ids=lambda options: ",".join(f"{key}={value}" for key, value in options.items()),
)
def test_other_settings_equal_brute_force(oracles: list[Oracle], options: dict[str, str]) -> None:
    found = [oracle.compare("normals", options) for oracle in oracles[::3]]
    assert [str(differences) for differences in found if differences.total] == []


@pytest.mark.parametrize("layout", ["binary", "wide"])
@pytest.mark.parametrize("fault", _core.faults())
def test_planted_faults_are_seen(oracles: list[Oracle], fault: str, layout: str) -> None:
    assert sum(oracle.compare("normals", {"layout": layout}, fault).total for oracle in oracles) > 0


def test_there_are_enough_faults() -> None:
    assert len(_core.faults()) >= 8


@pytest.fixture(scope="module")
def trees_of_large_mesh() -> tuple[Mesh, Oracle]:
    mesh = large_mesh()
    assert 99_000 <= len(mesh.faces) <= 101_000
    return mesh, Oracle(mesh, RAYS_PER_FAMILY, seed=2, tree="kd")


@pytest.mark.parametrize(("tree", "options"), SPECS[1:], ids=SPEC_IDS[1:])
def test_trees_of_a_large_mesh_agree(
    trees_of_large_mesh: tuple[Mesh, Oracle], tree: str, options: dict[str, str]
) -> None:
    differences = trees_of_large_mesh[1].compare(tree, options)
    assert differences.total == 0, str(differences)


@pytest.mark.parametrize("centre", [(0, 0, 0), (1e3, -1e3, 7e2), (148376, 1234, -223423)], ids=["0", "1e3", "2.7e5"])
@pytest.mark.parametrize("family", ["random", "edge", "vertex"])
@pytest.mark.parametrize("tree", ["kd", "normals"])
def test_no_ray_escapes_a_closed_sphere(tree: str, family: str, centre: tuple[float, float, float]) -> None:
    mesh = sphere("closed", 50, centre)
    o, d = interior_rays(mesh, 100_000, np.random.default_rng(3), family)
    found = _core.Accelerator(mesh.vertices, mesh.faces, tree).closest(o, d, np.full(len(o), np.inf, np.float32))
    assert int((found["triangle"] == NO_TRIANGLE).sum()) == 0


def test_rays_are_aimed() -> None:
    """Where they hit, barycentric coordinates are 0 or sum to 1 (the far half is behind other triangles)."""
    mesh = sphere("aimed", 15)
    brute = _core.Accelerator(mesh.vertices, mesh.faces, "brute")
    shares = {}
    for family in ("vertex", "edge", "random"):
        o, d = FAMILIES[family](mesh, 2000, np.random.default_rng(4))
        hit = brute.closest(o, d, np.full(len(o), np.inf, np.float32))
        found = hit["triangle"] != NO_TRIANGLE
        u, v = hit["u"][found], hit["v"][found]
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


def test_moller_trumbore_differs_from_brute_force_rarely() -> None:
    """No promise is made for mt: its t on a sliver can be far outside the sliver's cell. What is left is counted here:
    on the meshes made of slivers 0.8 % of these aimed rays, on every other mesh less than 1 in 1000."""
    for mesh in small_meshes():
        differences = Oracle(mesh, 1000, seed=5, triangle_test="mt").compare("normals")
        allowed = 0.01 if mesh.name in ("slivers", "fan") else 0.001
        assert differences.total <= allowed * differences.rays, str(differences)
