"""The bounds of results/error-analysis.md against exact rational arithmetic: they hold, and an eighth of them does not.

The floats are computed as the traversal computes them; a fused multiply-add is a product and sum in double precision,
rounded to a float, which differs from a true one by a part in 2^29 of the last digit.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest

U = Fraction(1, 2**24)
COUNT = 3000

F = np.float32


def fma(a: np.float32, b: np.float32, c: np.float32) -> np.float32:
    return F(float(a) * float(b) + float(c))


def exact(x: np.float32) -> Fraction:
    return Fraction(float(x))


def numbers(rng: np.random.Generator, count: int) -> np.ndarray:
    """Floats of either sign, from 2^-12 to 1, some of them powers of two or next to one."""
    found = (rng.choice([-1, 1], count) * 2 ** rng.uniform(-12, 0, count)).astype(F)
    round_ones = rng.random(count) < 0.2
    powers = (2.0 ** rng.integers(-12, 1, count)).astype(F)
    return np.where(round_ones, np.nextafter(powers, F(0)), found).astype(F)


def reach(o: np.ndarray) -> list[Fraction]:
    """R_k where the box is [-1, 1]^3."""
    return [1 + abs(exact(x)) for x in o]


def axis_binary(rng: np.random.Generator) -> Fraction:
    o, d, (c,) = numbers(rng, 3), numbers(rng, 3), numbers(rng, 1)
    t = F(F(c - o[0]) * F(F(1) / d[0]))
    error = abs(exact(t) * exact(d[0]) - (exact(c) - exact(o[0])))
    return error / (3 * U * reach(o)[0])


def axis_wide(rng: np.random.Generator) -> Fraction:
    o, d, (c,) = numbers(rng, 3), numbers(rng, 3), numbers(rng, 1)
    inverse = F(F(1) / d[0])
    t = fma(c, inverse, F(-F(o[0] * inverse)))
    error = abs(exact(t) * exact(d[0]) - (exact(c) - exact(o[0])))
    return error / (U * (2 * abs(exact(o[0])) + 2 * reach(o)[0]))


def oblique(rng: np.random.Generator) -> Fraction:
    o, d, (a, b) = numbers(rng, 3), numbers(rng, 3), numbers(rng, 2)
    p = [exact(x) for x in numbers(rng, 3)]  # the plane goes through a point of the box
    c = F(float(p[0]) + float(a) * float(p[1]) + float(b) * float(p[2]))
    start = fma(b, o[2], fma(a, o[1], o[0]))
    speed = fma(b, d[2], fma(a, d[1], d[0]))
    if abs(speed) < 2.0**-6:
        return Fraction(0)
    t = F(F(c - start) * F(F(1) / speed))
    n = [Fraction(1), exact(a), exact(b)]
    true_speed = sum(x * exact(y) for x, y in zip(n, d, strict=True))
    distance = exact(c) - sum(x * exact(y) for x, y in zip(n, o, strict=True))
    error = abs(exact(t) * true_speed - distance)
    moved = [abs(exact(t) * exact(y)) for y in d]  # |t d_k|, below R_k only where the crossing is in the scene
    if any(m > r for m, r in zip(moved, reach(o), strict=True)):
        return Fraction(0)
    origin = sum(abs(x * exact(y)) for x, y in zip(n, o, strict=True))
    return error / (U * (2 * origin + 5 * sum(abs(x) * r for x, r in zip(n, reach(o), strict=True))))


def shear(rng: np.random.Generator) -> Fraction:
    o, d, p = numbers(rng, 3), numbers(rng, 3), numbers(rng, 3)
    z = int(np.argmax(np.abs(d)))
    x = (z + 1) % 3
    slope = F(d[x] / d[z])
    height = F(p[z] - o[z])
    found = fma(F(-slope), height, F(p[x] - o[x]))
    true = exact(p[x]) - exact(o[x]) - exact(d[x]) / exact(d[z]) * (exact(p[z]) - exact(o[z]))
    return abs(exact(found) - true) / (5 * U * max(reach(o)))


def moment(rng: np.random.Generator) -> Fraction:
    """What tells whether a triangle is hit behind the ray's origin, from its sheared coordinates."""
    x, y, z = (numbers(rng, 3) for _ in range(3))
    pairs = ((2, 1), (0, 2), (1, 0))
    u, v, w = (F(F(x[i] * y[j]) - F(y[i] * x[j])) for i, j in pairs)
    found = fma(w, z[2], fma(v, z[1], F(u * z[0])))
    edges = (exact(x[i]) * exact(y[j]) - exact(y[i]) * exact(x[j]) for i, j in pairs)
    true = sum(edge * exact(height) for edge, height in zip(edges, z, strict=True))
    largest = [max(abs(exact(number)) for number in numbers) for numbers in (x, y, z)]
    return abs(exact(found) - true) / (24 * U * largest[0] * largest[1] * largest[2])


def turned_ray(rng: np.random.Generator) -> Fraction:
    """A point of the ray, turned, against that of the turned ray; the turned box is [-1, 1]^3."""
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    o, d = numbers(rng, 3), numbers(rng, 3)
    seen_o, seen_d = ((axes @ v.astype(float)).astype(F) for v in (o, d))
    k = int(rng.integers(3))
    bound = 1 + abs(exact(seen_o[k]))
    t = bound / max(abs(exact(x)) for x in seen_d)  # as far as the box reaches
    true = sum(Fraction(float(a)) * (exact(x) + t * exact(y)) for a, x, y in zip(axes[k], o, d, strict=True))
    return abs(exact(seen_o[k]) + t * exact(seen_d[k]) - true) / (2 * U * bound)


@pytest.mark.parametrize("share_of_bound", [turned_ray, axis_binary, axis_wide, oblique, shear, moment])
def test_the_bound_holds_and_is_not_idle(share_of_bound: Callable[[np.random.Generator], Fraction]) -> None:
    rng = np.random.default_rng(1)
    worst = max(share_of_bound(rng) for _ in range(COUNT))
    assert worst <= 1
    assert worst > Fraction(1, 8)


def test_a_power_of_two_changes_no_digit() -> None:
    rng = np.random.default_rng(2)
    for exponent in (-100, -1, 60, 126):
        x = numbers(rng, 1000)
        assert np.array_equal(np.ldexp(np.ldexp(x, exponent), -exponent), x)


def test_the_sign_of_an_edge_function_is_exact_in_double_precision() -> None:
    rng = np.random.default_rng(3)
    for _ in range(COUNT):
        a, b, c = (float(x) for x in numbers(rng, 3))
        d = float(np.nextafter(F(b * c / a), F(rng.choice([-1, 1])))) if rng.random() < 0.5 else float(F(b * c / a))
        found = a * d - b * c
        true = Fraction(a) * Fraction(d) - Fraction(b) * Fraction(c)
        assert (found > 0) == (true > 0) and (found < 0) == (true < 0)
