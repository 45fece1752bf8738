"""What a ray of floats hits in triangles of floats, without any rounding: the oracle for disputed answers.

A float is a whole number times a power of two, so after scaling all decisions are signs of whole numbers. With a, b, c
the corners as seen from the origin, the ray's side of the edges is the sign of the determinants of d with two corners
each. The direction enters as it is: o + d is never formed, for it would have to be rounded or grow by hundreds of bits.

The rules where the ray touches the border: triangles are closed, so that a ray through a shared edge or vertex hits
every triangle there, and of equal t the smallest id counts. A ray within a triangle's plane does not hit that triangle,
whose edge it sees; on a closed surface it then meets a neighbour. The interval is closed too: 0 <= t <= maxt.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .meshes import Mesh

Integers = tuple[int, int, int]

#: Relative error of a determinant of differences computed in double precision is below 8 * 2^-53 of the sum of the
#: absolute values of its terms: one rounding for each difference, two products and three sums on the longest path.
_FILTER = 16 * 2.0**-53


@dataclass(frozen=True)
class ExactHit:
    t: Fraction
    triangle: int


class ExactRay:
    """A ray with finite floats and a direction that is not zero."""

    def __init__(self, origin: ArrayLike, direction: ArrayLike) -> None:
        self.o = np.asarray(origin, np.float64)
        self.d = np.asarray(direction, np.float64)
        self._d_shift = _shift(self.d)
        self._d_whole = _whole(self.d, self._d_shift)
        self._o_shift = _shift(self.o)

    def hit(self, corners: NDArray[np.float32]) -> Fraction | None:
        """t where the line of the ray, backwards too, meets the closed triangle `corners` (3, 3); None if nowhere."""
        shift = max(self._o_shift, _shift(corners))
        origin = _whole(self.o, shift)
        a, b, c = (_minus(_whole(corner, shift), origin) for corner in corners)
        bc, ca, ab = _cross(b, c), _cross(c, a), _cross(a, b)
        u, v, w = _dot(self._d_whole, bc), _dot(self._d_whole, ca), _dot(self._d_whole, ab)
        if (u < 0 or v < 0 or w < 0) and (u > 0 or v > 0 or w > 0):
            return None
        if u + v + w == 0:
            return None
        return Fraction(_dot(a, bc), u + v + w) * Fraction(2) ** (self._d_shift - shift)

    def closest(self, mesh: Mesh, maxt: float = math.inf) -> ExactHit | None:
        """The first hit, of equal ones that of the smallest id."""
        best: ExactHit | None = None
        for triangle in self.candidates(mesh):
            t = self.hit(mesh.vertices[mesh.faces[triangle]])
            if t is not None and 0 <= t <= maxt and (best is None or t < best.t):
                best = ExactHit(t, triangle)
        return best

    def candidates(self, mesh: Mesh) -> list[int]:
        """Ids of the triangles, in ascending order, that double precision cannot prove to be missed."""
        with np.errstate(invalid="ignore"):
            corners = mesh.vertices[mesh.faces].astype(np.float64) - self.o
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        edges = np.stack([_determinants(self.d, *pair) for pair in ((b, c), (c, a), (a, b))])
        value, error = edges[:, 0], edges[:, 1]
        missed = (value < -error).any(axis=0) & (value > error).any(axis=0)
        return np.flatnonzero(~missed & np.isfinite(corners).all(axis=(1, 2))).tolist()


def _determinants(d: NDArray, p: NDArray, q: NDArray) -> tuple[NDArray, NDArray]:
    """d . (p x q) of many p and q, and bounds on the errors."""
    value, size = np.zeros(len(p)), np.zeros(len(p))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        value += d[k] * (p[:, i] * q[:, j] - p[:, j] * q[:, i])
        size += np.abs(d[k]) * (np.abs(p[:, i] * q[:, j]) + np.abs(p[:, j] * q[:, i]))
    return value, _FILTER * size


def _shift(values: NDArray) -> int:
    """The least power of two (its exponent, at least 0) that makes every value a whole number."""
    return max(float(x).as_integer_ratio()[1].bit_length() - 1 for x in values.flat)


def _whole(point: Iterable[float], shift: int) -> Integers:
    """A point times 2^shift."""
    x, y, z = ((n << shift) // m for n, m in (float(x).as_integer_ratio() for x in point))
    return x, y, z


def _minus(p: Integers, q: Integers) -> Integers:
    return p[0] - q[0], p[1] - q[1], p[2] - q[2]


def _cross(p: Integers, q: Integers) -> Integers:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


def _dot(p: Integers, q: Integers) -> int:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


def normal_is_zero(corners: NDArray[np.float32]) -> bool:
    """Whether a triangle with finite corners has no area at all."""
    shift = _shift(corners)
    a, b, c = (_whole(corner, shift) for corner in corners)
    return not any(_cross(_minus(b, a), _minus(c, a)))
