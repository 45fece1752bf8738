"""How building grows with the number of triangles: meshes of any size from one scene, and the exponent of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .intervals import CONFIDENCE, Interval

#: Triangles that a scene's meshes are tessellated to, unless the user says otherwise.
SIZES = (100_000, 300_000, 1_000_000, 3_000_000)

#: An exponent and its interval need so many sizes.
MIN_SIZES = 3

_SEED = 0


@dataclass(frozen=True)
class PowerLaw:
    """seconds = factor * triangles ** exponent; `linearithmic` is the exponent that n log n has over the same sizes."""

    factor: float
    exponent: Interval
    linearithmic: float

    def seconds(self, triangles: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the law says."""
        return self.factor * triangles**self.exponent.value


def sizes_from(triangles: int, wanted: Sequence[int]) -> list[int]:
    """The sizes that a mesh can be tessellated to: none is below its own. ValueError if they are too few for a fit."""
    sizes = sorted({max(size, triangles) for size in wanted})
    if len(sizes) < MIN_SIZES:
        raise ValueError(
            f"a fit needs {MIN_SIZES} sizes of at least the scene's own {triangles:,} triangles, but there are only "
            f"{', '.join(f'{size:,}' for size in sizes)}: give larger --sizes, or a smaller scene"
        )
    return sizes


def tessellate(corners: NDArray[np.float32], wanted: int) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    """Vertices and faces of about `wanted` triangles on the same surface; `corners` is (n, 3, 3), n at most `wanted`.

    Every triangle is quartered at the midpoints of its edges as long as they all fit, then a random choice of them.
    """
    while 4 * len(corners) <= wanted:
        corners = _quartered(corners)
    chosen = np.zeros(len(corners), bool)
    count = round((wanted - len(corners)) / 3)
    chosen[np.random.default_rng(_SEED).permutation(len(corners))[:count]] = True
    corners = np.concatenate([corners[~chosen], _quartered(corners[chosen])])
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.uint32).reshape(-1, 3)


def fit_growth(triangles: Sequence[float], seconds: Sequence[float]) -> PowerLaw:
    """The line through the logarithms of both, by least squares; ValueError for fewer than MIN_SIZES points."""
    from scipy.stats import linregress, t

    if len(triangles) < MIN_SIZES:
        raise ValueError(f"a fit needs {MIN_SIZES} sizes, but there are {len(triangles)}")
    n = np.log(np.asarray(triangles, float))
    found = linregress(n, np.log(seconds))
    margin = float(t.ppf((1 + CONFIDENCE) / 2, len(n) - 2) * found.stderr)
    exponent = float(found.slope)
    return PowerLaw(
        float(np.exp(found.intercept)),
        Interval(exponent, exponent - margin, exponent + margin),
        float(linregress(n, n + np.log(n)).slope),
    )


def _quartered(corners: NDArray[np.float32]) -> NDArray[np.float32]:
    """Four triangles for each."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    # Neighbours agree on the midpoint of their edge to the last bit: a sum of two does not depend on their order.
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])
