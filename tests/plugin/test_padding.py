"""Embree hands rays to our shape: few are lost on the way from afar. From near by none is, which is C16 of `verify`."""

from __future__ import annotations

import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification.wrapped import answers, box_rays, make_mesh, scene_with

KD = parse_spec("kd")


@pytest.mark.parametrize("sizes", [1e2, 1e3, 1e4])
def test_rays_from_far_away(sizes: float) -> None:
    """Nothing is lost from 1e4 sizes away either, though the promise is ten."""
    mesh = make_mesh("cube", "0")
    scene = scene_with(mesh, KD, robust=False, lamps=False)
    rays = box_rays(mesh, 10_000, np.random.default_rng(8), sizes)
    expected = mitsuba_bsp.Accelerator(mesh.vertices, mesh.faces, "brute").closest(*rays)
    t, _, _ = answers(scene, rays)
    assert np.isfinite(expected["t"]).sum() > 5000
    assert (t.view(np.uint32) != expected["t"].view(np.uint32)).sum() == 0


@pytest.mark.parametrize(
    ("kind", "sizes", "percent"),
    [
        ("cube", 1e4, (0, 0)),
        ("cube", 1e5, (0.6, 0.8)),
        ("cube", 1e6, (2.6, 2.8)),
        ("cube", 1e7, (5.4, 5.9)),
        ("sphere", 1e4, (0, 0)),
        ("sphere", 1e5, (0, 0)),
        ("sphere", 1e6, (0, 0)),
        ("sphere", 1e7, (0.8, 1)),
    ],
)
@pytest.mark.parametrize("robust", [False, True])
def test_how_many_rays_are_lost_from_very_far_away(
    kind: str, sizes: float, percent: tuple[float, float], robust: bool
) -> None:
    """The README's figures: of the rays that should hit, so many never reach the tree, which itself loses none.

    The fewer with Embree's kernels for AVX-512, the more with those for AVX2.
    """
    mesh = make_mesh(kind, "0")
    rays = box_rays(mesh, 20_000, np.random.default_rng(8), sizes)
    brute, tree = (mitsuba_bsp.Accelerator(mesh.vertices, mesh.faces, spec).closest(*rays) for spec in ("brute", "kd"))
    assert all(np.array_equal(brute[key], tree[key]) for key in brute)
    t, _, any_hit = answers(scene_with(mesh, KD, robust, lamps=False), rays)
    hit = np.isfinite(brute["t"])
    lost = hit & ~np.isfinite(t)
    assert hit.sum() > 9000
    assert (t.view(np.uint32) != brute["t"].view(np.uint32)).tolist() == lost.tolist()
    assert (hit & ~any_hit).tolist() == lost.tolist() and not (any_hit & ~hit).any()
    found, (least, most) = 100 * lost.sum() / hit.sum(), percent
    assert found == 0 if most == 0 else 0.9 * least < found < 1.1 * most, f"{found:.2f} %"
