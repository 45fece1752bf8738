"""A fluted knot on a round plinth, finely tessellated, on a floor a thousand times its size. Metres, z up."""

from __future__ import annotations

import numpy as np
from mesh import Mesh, grid, join, quads, revolved, unit

FLOOR = 2000.0
PLINTH = 0.45


def knot(rows: int = 800, sides: int = 64) -> Mesh:
    """A trefoil knot about 1.7 m high with twisted flutes that the columns follow, standing upright on the plinth."""
    t = 2 * np.pi * np.arange(rows + 1) / rows
    ring = 1 + 0.42 * np.cos(3 * t)
    centre = 0.5 * np.stack([ring * np.cos(2 * t), 0.8 * np.sin(3 * t), ring * np.sin(2 * t)], axis=-1)
    tangent = unit(np.gradient(np.concatenate([centre[-2:-1], centre, centre[1:2]]), axis=0)[1:-1])
    across = unit(np.cross(tangent, [0.0, 1.0, 0.0]))
    second = np.cross(across, tangent)
    column = 2 * np.pi * np.arange(sides) / sides
    radius = 0.15 + 0.045 * np.abs(np.cos(4 * column)) ** 0.7
    angle = (column - 2 * t[:, None])[..., None]
    circle = across[:, None] * np.cos(angle) + second[:, None] * np.sin(angle)
    points = centre[:, None] + radius[:, None] * circle
    return grid(points, closed=True).moved([0, 0, PLINTH - points[..., 2].min() - 0.01])


def meshes() -> dict[str, Mesh]:
    """Every mesh of the scene by its shape's id."""
    radius, height = (
        [0.62, 0.62, 0.54, 0.51, 0.51, 0.56, 0.56, 0],
        [0.001, 0.08, 0.10, 0.14, 0.36, 0.40, PLINTH, PLINTH],
    )
    step = np.stack([radius, height], axis=1)
    corners = FLOOR * np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    return {
        "knot": knot(),
        "plinth": join(revolved(ends, 96) for ends in zip(step, step[1:], strict=False)),
        "floor": quads([corners]),
    }
