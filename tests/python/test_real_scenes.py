"""Real scenes, where they lie beside the checkout: every tree renders the same pixels, and Embree's up to rounding."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp

SHARED = Path(__file__).resolve().parents[3] / "shared" / "scenes"

pytestmark = pytest.mark.skipif(not SHARED.is_dir(), reason="the folder of real scenes is not beside the checkout")


def render(scene: str, spec: str) -> np.ndarray:
    """96 x 96 pixels in nine blocks, more than there are threads, so that their seeds are the same everywhere."""
    loaded = mitsuba_bsp.load_file(str(SHARED / f"{scene}.xml"), spec, res=96, spp=2)
    return np.array(mi.render(loaded, seed=1))


@pytest.mark.parametrize("scene", ["feet", "conference", "sibenik"])
def test_trees_render_identical_pixels(scene: str) -> None:
    expected = render(scene, "kd")
    assert np.isfinite(expected).all()
    assert expected.max() > 0
    for spec in ("normals", "clustered:axes=none", "random:axes=plain,k=4"):
        assert np.array_equal(render(scene, spec), expected), spec
    share = np.mean(np.abs(render(scene, "embree") - expected).max(axis=2) > 1e-3 * expected.max(axis=2))
    assert share < 0.05
