"""The plugins work in the three scalar variants, and in any other say so."""

from __future__ import annotations

import subprocess
import sys

import mitsuba as mi
import numpy as np
import pytest

from .plugin_scenes import TREES, assert_same_up_to_rounding, ball, facing_down, group, load, pixels, place, view

SCALAR = ("scalar_rgb", "scalar_spectral", "scalar_spectral_polarized")


@pytest.mark.parametrize("variant", SCALAR)
def test_images(variant: str) -> None:
    mi.set_variant(variant)
    description = {
        **view(),
        "floor": {"type": "rectangle", "to_world": place(4)},
        "ball": ball(mi.load_dict({"type": "roughconductor"}), centre=(0, 0, 1)),
        "cube": {"type": "cube", "to_world": place(0.4, 20, (-1.5, 0, 0.4)), "bsdf": {"type": "dielectric"}},
        "lamp": {"type": "rectangle", "to_world": facing_down(1, (0, 0, 4)), "emitter": {"type": "area"}},
        "sky": {"type": "constant", "radiance": 0.1},
    }
    images = {spec: pixels(load(description, spec), spp=16) for spec in (*TREES, "native", "embree")}
    assert images["brute"][..., :3].std() > 0.02
    for tree in TREES:
        assert np.array_equal(images[tree], images["brute"]), tree
    assert_same_up_to_rounding(images["brute"], images["embree"], share=0.04)
    assert_same_up_to_rounding(images["brute"], images["native"], share=0.04)


@pytest.mark.parametrize("variant", SCALAR)
def test_rays(variant: str) -> None:
    mi.set_variant(variant)
    for spec in ("kd", "native"):
        scene = mi.load_dict({"type": "scene", "g": group(spec, {"ball": ball()})})
        assert scene.ray_intersect(mi.Ray3f([0, 0.01, 5], [0, 0, -1])).t == pytest.approx(4, abs=0.1)


REFUSED = """
import mitsuba as mi
mi.set_variant({variant!r})
import mitsuba_bsp
for plugin in ("bsptree", "nativekdtree", "bspmember"):
    try:
        mi.load_dict({{"type": plugin}})
    except RuntimeError as error:
        print(error)
"""


@pytest.mark.parametrize("variant", ["llvm_ad_rgb", "llvm_ad_spectral"])
def test_other_variants_are_refused(variant: str) -> None:
    """Registering is enough for that: LLVM itself is not needed, nor is it started."""
    assert variant in mi.variants()
    result = subprocess.run(
        [sys.executable, "-c", REFUSED.format(variant=variant)], capture_output=True, text=True, timeout=60, check=False
    )
    if result.returncode != 0 and "LLVM" in result.stderr:
        pytest.skip(f"Mitsuba cannot set {variant} here, because LLVM is not installed")
    assert result.returncode == 0, result.stderr
    for plugin in ("bsptree", "nativekdtree", "bspmember"):
        sentence = (
            f'the plugin "{plugin}" works in the scalar variants only, which have no gradients: set scalar_rgb, '
            "scalar_spectral or scalar_spectral_polarized"
        )
        assert sentence in result.stdout
