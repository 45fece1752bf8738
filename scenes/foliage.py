"""A clump of bamboo on a bumpy slope: long thin leaves, twigs and canes, none of it axis-aligned. Metres, z up."""

from __future__ import annotations

import numpy as np
from mesh import Array, Mesh, grid, tubes, unit

CANES, JOINTS = 8, 17
DOWN = np.array([0.0, 0.0, -1.0])


def ground_height(x: Array, y: Array) -> Array:
    """The ground: a slope steeper than its bumps, so that no part of it is level."""
    bumps = 0.05 * np.sin(1.7 * x + 0.6 * y) + 0.04 * np.sin(2.3 * y - 1.1 * x) + 0.012 * np.sin(7 * x) * np.sin(6 * y)
    return 0.5 * y + bumps


def directions(azimuth: Array, elevation: Array) -> Array:
    """Unit vectors (..., 3) from angles in radians."""
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=-1)


def curves(
    start: Array, heading: Array, lengths: Array, droops: tuple[float, float], points: int, rng: np.random.Generator
) -> Array:
    """Curves (n, points, 3) that leave `start` (n, 3) along `heading` (n, 3) and sag under their weight.

    The length is drawn between `lengths` (2,) or (2, n), and the sag, as a share of the length, between `droops`.
    """
    n, s = len(start), np.linspace(0, 1, points)[:, None]
    length, droop = rng.uniform(*lengths, n)[:, None, None], rng.uniform(*droops, n)[:, None, None]
    return start[:, None] + length * (heading[:, None] * s + droop * DOWN * s**2)


def sprout(places: Array, azimuth: Array, count: int, rise: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """`count` starts and headings at each of `places` (n, 3), spread about `azimuth` (n,), rising by `rise` radians."""
    n = len(places)
    turn = azimuth[:, None] + np.linspace(-1, 1, count) * 1.1 + 0.35 * rng.normal(size=(n, count))
    heading = directions(turn, rise + 0.25 * rng.normal(size=(n, count)))
    return places.repeat(count, axis=0), heading.reshape(-1, 3)


def azimuths(curve: Array) -> Array:
    """The compass angle from start to end of each curve (n, points, 3), in radians."""
    along = curve[:, -1] - curve[:, 0]
    return np.arctan2(along[:, 1], along[:, 0])


def canes(rng: np.random.Generator) -> tuple[Array, Array]:
    """The canes' centre lines (n, 5 * JOINTS + 1, 3), a joint at every fifth point, and their radii in this order."""
    angle, distance = rng.uniform(0, 2 * np.pi, CANES), 0.75 * np.sqrt(rng.random(CANES))
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    foot = np.stack([x, y, ground_height(x, y) - 0.05], axis=1)
    lean = unit((foot + 0.25 * rng.normal(size=(CANES, 3))) * [1, 1, 0])
    height, bend = rng.uniform(2.6, 4.2, (CANES, 1)), rng.uniform(0.15, 0.4, (CANES, 1))
    s = np.linspace(0, 1, 5 * JOINTS + 1)
    level = height * (0.12 * s + bend * s**3)
    upright = height * (s - 0.35 * bend * s**4)
    centre = foot[:, None] + level[..., None] * lean[:, None] - upright[..., None] * DOWN
    return centre, rng.uniform(0.02, 0.032, (CANES, 1)) * (1 - 0.8 * s)


def leaves(start: Array, heading: Array, rng: np.random.Generator) -> Mesh:
    """Lance-shaped leaves folded along the midrib, four quads long, from stalks at `start` (n, 3) along `heading`."""
    n = len(start)
    midrib = curves(start, heading, np.array([0.18, 0.34]), (0.15, 0.6), 5, rng)
    along = unit(np.gradient(midrib, axis=1))
    side = unit(np.cross(along, DOWN + 0.7 * rng.normal(size=(n, 1, 3))))
    lift = 0.3 * np.cross(side, along)
    half_width = rng.uniform(0.010, 0.016, (n, 1, 1)) * np.array([0.12, 0.95, 0.95, 0.55, 0.04])[:, None]
    return grid(np.stack([midrib + half_width * (lift - side), midrib, midrib + half_width * (lift + side)], axis=2))


def bamboo(rng: np.random.Generator) -> dict[str, Mesh]:
    """Canes; from their upper joints branches, from these twigs, and on the twigs leaves of two kinds."""
    cane, radius = canes(rng)
    rings = 1 + 0.16 * (np.arange(cane.shape[1]) % 5 == 0)
    upper = np.arange(6, JOINTS + 1)
    joints, thickness = cane[:, 5 * upper].reshape(-1, 3), radius[:, 5 * upper].ravel()

    start, heading = sprout(joints, rng.uniform(0, 2 * np.pi, len(joints)), 2, 0.7, rng)
    shorter = np.tile(1.15 - 0.7 * upper / JOINTS, CANES).repeat(2)
    branch = curves(start, heading, np.outer([0.5, 0.8], shorter), (0.2, 0.5), 6, rng)
    branch_radius = np.clip(0.3 * thickness.repeat(2), 0.002, 0.006)[:, None] * np.linspace(1, 0.4, 6)

    start, heading = sprout(branch[:, [2, 4, 5]].reshape(-1, 3), azimuths(branch).repeat(3), 2, 0.1, rng)
    twig = curves(start, heading, np.array([0.12, 0.25]), (0.1, 0.5), 3, rng)

    stalks = np.stack([twig[:, 1], twig[:, 1:].mean(axis=1), twig[:, 2]], axis=1).reshape(-1, 3)
    start, heading = sprout(stalks, azimuths(twig).repeat(3), 1, -0.2, rng)
    young = rng.random(len(start)) < 0.3
    return {
        "canes": tubes(cane, radius * rings, 8),
        "branches": tubes(branch, branch_radius, 4),
        "twigs": tubes(twig, 0.0016 * np.linspace(1, 0.5, 3), 3),
        "leaves_old": leaves(start[~young], heading[~young], rng),
        "leaves_young": leaves(start[young], heading[young], rng),
    }


def fallen_leaves(count: int, rng: np.random.Generator) -> Mesh:
    """Leaves on the ground around the clump."""
    x, y = 1.1 * rng.normal(size=(2, count))
    start = np.stack([x, y, ground_height(x, y) + 0.03], axis=1)
    return leaves(start, directions(rng.uniform(0, 2 * np.pi, count), 0.4 * rng.normal(size=count)), rng)


def meshes() -> dict[str, Mesh]:
    """Every mesh of the scene by its shape's id."""
    rng = np.random.default_rng(7)
    x, y = np.meshgrid(np.linspace(-9, 9, 61), np.linspace(-7, 12, 61))
    return bamboo(rng) | {
        "leaves_fallen": fallen_leaves(400, rng),
        "ground": grid(np.stack([x, y, ground_height(x, y)], axis=-1)),
    }
