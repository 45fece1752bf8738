"""HDR-FLIP, how different two images look when flipped between, by its authors' package (Andersson et al. 2021)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

#: Luminance below which FLIP finds no exposure in a reference by itself.
_DARK = 1e-6

#: The exposures (start, stop in stops) under which images are looked at that FLIP finds none for.
_EXPOSURES = {"startExposure": -2.0, "stopExposure": 2.0}


def flip(image: Mapping[str, np.ndarray], reference: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """The error of each pixel, 0 to 1, at FLIP's own default viewing distance; what is not finite counts as black.

    None if the package is not installed (there is no wheel of it for Python 3.14).
    """
    try:
        import flip_evaluator
    except ImportError:
        return None
    first, second = rgb(image), rgb(reference)
    parameters = {} if second.max() > _DARK else _EXPOSURES  # without them FLIP would end this process
    error, _, _ = flip_evaluator.evaluate(second, first, "HDR", applyMagma=False, parameters=parameters)
    return error[..., 0]


def rgb(image: Mapping[str, np.ndarray]) -> np.ndarray:
    """The colours to look at, (height, width, 3) float32 without negative values; grey if there is but one channel."""
    names = [name for name in "RGB" if name in image]
    if len(names) < 3:
        names = ["Y" if "Y" in image else sorted(image)[0]] * 3
    pixels = np.stack([np.asarray(image[name], np.float32) for name in names], axis=2)
    return np.ascontiguousarray(np.maximum(np.nan_to_num(pixels, nan=0.0, posinf=0.0, neginf=0.0), 0.0))
