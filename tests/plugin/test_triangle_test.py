"""`triangle_test=mt` is the arithmetic of Mitsuba's own meshes, to the last bit."""

from __future__ import annotations

import warnings

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.verification.meshes import Mesh, small_meshes
from mitsuba_bsp.verification.oracle import cut_intervals
from mitsuba_bsp.verification.rays import FAMILIES

from .plugin_scenes import from_verification, ray

TRIANGLES, RAYS = 10, 1060  # of each mesh; of each family at each triangle: 1,000,640 in all
SMALL = {mesh.name: mesh for mesh in small_meshes()}


def test_there_are_a_million_rays() -> None:
    assert len(SMALL) * TRIANGLES * len(FAMILIES) * RAYS > 1_000_000


@pytest.mark.parametrize("name", SMALL)
def test_mt_is_mitsubas_triangle_test(name: str) -> None:
    """Hit or miss, t, u and v of rays aimed at single triangles; intervals end at, before and behind the hit."""
    whole = SMALL[name]
    mesh = from_verification(whole)
    rng = np.random.default_rng([11, *name.encode()])
    hits = 0
    for triangle in rng.choice(len(whole.faces), TRIANGLES).tolist():
        alone = Mesh(name, whole.vertices[whole.faces[triangle]], np.array([[0, 1, 2]], np.uint32))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # some triangles have no area
            ours = mitsuba_bsp.Accelerator(alone.vertices, alone.faces, "brute:triangle_test=mt")
        for family, make in FAMILIES.items():
            o, d = make(alone, RAYS, rng)
            maxt = cut_intervals(ours.closest(o, d)["t"], rng)
            expected = theirs(mesh, triangle, o, d, maxt)
            found = ours.closest(o, d, maxt)
            hit = np.isfinite(expected[:, 0])
            assert np.array_equal(found["triangle"] != mitsuba_bsp.NO_TRIANGLE, hit), (triangle, family)
            numbers = np.stack([found[key] for key in "tuv"], axis=1)
            assert np.array_equal(numbers[hit].view(np.uint32), expected[hit].view(np.uint32)), (triangle, family)
            hits += int(hit.sum())
    assert hits > 0.1 * TRIANGLES * RAYS * len(FAMILIES)


def theirs(mesh: mi.Mesh, triangle: int, o: np.ndarray, d: np.ndarray, maxt: np.ndarray) -> np.ndarray:
    """(r, 3) rows of t, u, v by `Mesh::ray_intersect_triangle`; t is infinite where it misses."""
    rows = []
    for origin, direction, end in zip(o.tolist(), d.tolist(), maxt.tolist(), strict=True):
        pi = mesh.ray_intersect_triangle(triangle, ray(origin, direction, end))
        uv = pi.prim_uv
        rows.append((pi.t, uv.x, uv.y))
    return np.array(rows, np.float32)
