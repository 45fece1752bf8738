"""Compare two renderings of one scene with one seed: the same, rounded differently, or biased?"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

#: A pixel counts as different if it is off by more than this, relative to the larger value.
RELATIVE_TOLERANCE = 1e-3

#: Below this share of the image's mean, differences are taken relative to that instead of to the (dark) pixel.
DARK = 1e-3

#: The mean difference is called bias if chance alone would produce it less often than this (3.3 standard errors).
BIAS_P_VALUE = 1e-3

#: A mean difference below this share of the image's mean (a few float32 roundings) is never called bias.
ROUNDING = 1e-6

Image = Mapping[str, np.ndarray]
Verdict = Literal["identical", "rounding", "bias", "not comparable"]


@dataclass(frozen=True)
class ImageDifference:
    """How one image differs from a reference.

    `differing_pixels`: pixels with any bit different. `share`: share of pixels off by more than 1e-3 relative.
    `largest`: largest absolute difference. `mean`: mean signed difference, over the colour channels.
    `p_value`: paired test of that mean against zero. `non_finite_pixels`: left out of everything but the bit test.
    """

    differing_pixels: int
    share: float
    largest: float
    mean: float
    p_value: float
    non_finite_pixels: int
    verdict: Verdict


def compare_images(image: Image, reference: Image) -> ImageDifference:
    """Compare images given as channels (height, width) float32 by name."""
    if {name: plane.shape for name, plane in image.items()} != {n: p.shape for n, p in reference.items()}:
        return ImageDifference(0, 0.0, 0.0, 0.0, 1.0, 0, "not comparable")
    first, second = _stack(image), _stack(reference)
    differing = int(np.any(first.view(np.uint32) != second.view(np.uint32), axis=1).sum())
    finite = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    one, two = first[finite].astype(np.float64), second[finite].astype(np.float64)
    gap = np.abs(one - two)
    floor = DARK * np.abs(two).mean(axis=0) if len(two) else 0.0
    scale = np.maximum(np.maximum(np.abs(one), np.abs(two)), floor)
    off = np.any(gap > RELATIVE_TOLERANCE * scale, axis=1)
    signed = (one - two)[:, _colours(image)].mean(axis=1)
    mean, p_value = float(signed.mean()) if len(signed) else 0.0, _paired_test(signed)
    level = float(np.abs(two[:, _colours(image)]).mean()) if len(signed) else 0.0
    biased = p_value < BIAS_P_VALUE and abs(mean) > ROUNDING * level
    return ImageDifference(
        differing_pixels=differing,
        share=float(off.mean()) if len(off) else 0.0,
        largest=float(gap.max(initial=0.0)),
        mean=mean,
        p_value=p_value,
        non_finite_pixels=int((~finite).sum()),
        verdict="identical" if not differing else "bias" if biased else "rounding",
    )


def _stack(image: Image) -> np.ndarray:
    """All channels as (pixels, channels)."""
    return np.stack([np.asarray(image[name], np.float32).ravel() for name in sorted(image)], axis=1)


def _colours(image: Image) -> list[int]:
    """Indices of the colour channels in `_stack`; all of them if none has a usual name."""
    names = sorted(image)
    return [i for i, name in enumerate(names) if name in ("R", "G", "B", "Y")] or list(range(len(names)))


def _paired_test(signed: np.ndarray) -> float:
    """Probability of a mean this far from zero if the differences had no preferred sign."""
    if len(signed) < 2 or np.ptp(signed) == 0.0:
        return 0.0 if len(signed) and signed[0] != 0.0 else 1.0
    standard_errors = abs(signed.mean()) / (signed.std(ddof=1) / math.sqrt(len(signed)))
    return math.erfc(standard_errors / math.sqrt(2))  # an image has enough pixels for the normal distribution
