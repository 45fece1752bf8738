"""A furnished room: almost all of its area lies in axis-aligned planes.

It spans x 0..6, y 0..5, z 0..3 metres; shelves and a mirror stand at the wall y = 5. Light comes through
the window in the wall x = 0 and the glazed doors in the wall y = 0.
"""

from __future__ import annotations

import furniture
import numpy as np
from mesh import Mesh, boxes, intervals, join, quads

WINDOW_Y, WINDOW_Z = (1.3, 3.9), (0.85, 2.55)
DOOR_X, DOOR_Z = (0.5, 2.3), (0.02, 2.4)


def walls() -> Mesh:
    """The ceiling, and the walls around the window and the doors."""
    (y0, y1), (z0, z1), (x0, x1) = WINDOW_Y, WINDOW_Z, DOOR_X
    return join(
        [
            boxes([-0.2, -0.2, 3], [6.2, 5.2, 3.2]),
            boxes([0, 5, 0], [6, 5.2, 3]),
            boxes([6, -0.2, 0], [6.2, 5.2, 3]),
            boxes([0, -0.2, 0], [x0, 0, 3]),
            boxes([x1, -0.2, 0], [6, 0, 3]),
            boxes([x0, -0.2, DOOR_Z[1]], [x1, 0, 3]),
            boxes([-0.2, -0.2, 0], [0, y0, 3]),
            boxes([-0.2, y1, 0], [0, 5.2, 3]),
            boxes([-0.2, y0, 0], [0, y1, z0]),
            boxes([-0.2, y0, z1], [0, y1, 3]),
        ]
    )


def tiles() -> tuple[Mesh, Mesh, Mesh]:
    """Light tiles, dark tiles and the mortar bed under them."""
    x, y = intervals(np.linspace(0, 6, 25), 0.003), intervals(np.linspace(0, 5, 21), 0.003)
    i, j = (index.ravel() for index in np.meshgrid(np.arange(24), np.arange(20)))
    low = np.stack([x[i, 0], y[j, 0], np.full(i.size, -0.02)], axis=1)
    high = np.stack([x[i, 1], y[j, 1], np.zeros(i.size)], axis=1)
    dark = (i + j) % 2 == 1
    return boxes(low[~dark], high[~dark]), boxes(low[dark], high[dark]), boxes([0, 0, -0.1], [6, 5, -0.004])


def trim() -> Mesh:
    """Skirting boards and ceiling beams."""
    beams = [boxes([0, y - 0.07, 2.78], [6, y + 0.07, 3]) for y in np.arange(0.5, 5, 0.8)]
    skirting = [
        boxes([0, 4.98, 0], [6, 5, 0.12]),
        boxes([0, 0.021, 0], [0.02, 4.98, 0.12]),
        boxes([5.98, 0.021, 0], [6, 4.98, 0.12]),
    ]
    return join(beams + skirting)


def bars(first: float, last: float, panes: int) -> list[tuple[float, float]]:
    """Start and end of the bars around and between `panes` panes: thick at the sides and in the middle."""
    half = np.full(panes + 1, 0.015)
    half[[0, panes // 2, -1] if panes % 2 == 0 else [0, -1]] = 0.045
    centres = np.linspace(first, last, panes + 1)
    return list(zip(centres - half, centres + half, strict=True))


def window() -> Mesh:
    """Frames and glazing bars of the window and of the doors, and the window's sill."""
    (y0, y1), (z0, z1) = WINDOW_Y, WINDOW_Z
    parts = [boxes([-0.2, y0 - 0.1, z0 - 0.1], [0.16, y1 + 0.1, z0 - 0.046])]
    parts += [boxes([-0.14, a, z0], [-0.07, b, z1]) for a, b in bars(y0, y1, 8)]
    parts += [boxes([-0.13, y0, a], [-0.08, y1, b]) for a, b in bars(z0, z1, 5)]
    parts += [boxes([a, -0.14, DOOR_Z[0]], [b, -0.07, DOOR_Z[1]]) for a, b in bars(*DOOR_X, 6)]
    parts += [boxes([DOOR_X[0], -0.13, a], [DOOR_X[1], -0.08, b]) for a, b in bars(*DOOR_Z, 5)]
    return join(parts)


def blinds() -> Mesh:
    """Slatted blinds let down over the upper third of the window, their cords and head rail."""
    (y0, y1), (_, z1) = WINDOW_Y, WINDOW_Z
    slat_z = np.arange(1.9, z1 - 0.08, 0.035)[:, None] * [0, 0, 1]
    cord_y = np.linspace(y0 + 0.2, y1 - 0.2, 5)[:, None] * [0, 1, 0]
    return join(
        [
            boxes([-0.065, y0 + 0.02, -0.004] + slat_z, [-0.005, y1 - 0.02, 0.004] + slat_z),
            boxes([-0.037, -0.003, 1.88] + cord_y, [-0.033, 0.003, z1 - 0.07] + cord_y),
            boxes([-0.066, y0 + 0.01, z1 - 0.07], [-0.004, y1 - 0.01, z1 - 0.001]),
        ]
    )


def radiator() -> Mesh:
    """A ribbed radiator under the window."""
    y = np.arange(1.6, 3.6, 0.05)[:, None] * [0, 1, 0]
    return join(
        [
            boxes([0.05, -0.018, 0.16] + y, [0.13, 0.018, 0.74] + y),
            boxes([0.075, 1.55, 0.2], [0.105, 3.6, 0.24]),
            boxes([0.075, 1.55, 0.66], [0.105, 3.6, 0.7]),
        ]
    )


def sky() -> Mesh:
    """What shines: the openings of the window and of the doors."""
    (y0, y1), (z0, z1), (x0, x1), (z2, z3) = WINDOW_Y, WINDOW_Z, DOOR_X, DOOR_Z
    return quads(
        [
            [[-0.19, y0, z0], [-0.19, y1, z0], [-0.19, y1, z1], [-0.19, y0, z1]],
            [[x1, -0.19, z2], [x0, -0.19, z2], [x0, -0.19, z3], [x1, -0.19, z3]],
        ]
    )


def meshes() -> dict[str, Mesh]:
    """Every mesh of the room by its shape's id."""
    light, dark, mortar = tiles()
    building = {
        "walls": walls(),
        "tiles_light": light,
        "tiles_dark": dark,
        "mortar": mortar,
        "trim": trim(),
        "window": window(),
        "blinds": blinds(),
        "radiator": radiator(),
        "sky": sky(),
    }
    return building | furniture.meshes()
