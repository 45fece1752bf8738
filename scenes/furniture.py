"""The furniture of the room, each piece at its place: see room.py for the axes."""

from __future__ import annotations

import numpy as np
from mesh import Array, Mesh, boxes, intervals, join, revolved

SHELF_X, SHELF_Z = np.linspace(0.35, 2.85, 5), np.linspace(0.12, 2.44, 7)
TABLE = np.array([2.45, 2.35])
BOOK_COLOURS = ("red", "blue", "green", "cream", "ochre")


def shelves() -> Mesh:
    """The bookcase without its books."""
    uprights = [boxes([x - 0.015, 4.66, 0], [x + 0.015, 4.97, 2.5]) for x in SHELF_X]
    boards = [boxes([SHELF_X[0], 4.67, z - 0.014], [SHELF_X[-1], 4.968, z + 0.014]) for z in SHELF_Z]
    return join(uprights + boards + [boxes([SHELF_X[0] - 0.03, 4.63, 2.5], [SHELF_X[-1] + 0.03, 4.975, 2.54])])


def book(low: Array, size: Array) -> tuple[Mesh, Mesh]:
    """Cover and pages of a standing book whose spine faces -y."""
    high, t = low + size, 0.003
    x0, x1 = low[0], high[0]
    cover = join(
        [
            boxes(low, [x0 + t, *high[1:]]),
            boxes([x1 - t, *low[1:]], high),
            boxes([x0 + t, *low[1:]], [x1 - t, low[1] + t, high[2]]),
        ]
    )
    return cover, boxes(low + [t, t, 0.006], high - [t, 0.006, 0.006])


def books(rng: np.random.Generator) -> dict[str, Mesh]:
    """The books, one mesh for each colour of cover and one for all pages."""
    parts: dict[str, list[Mesh]] = {f"books_{name}": [] for name in (*BOOK_COLOURS, "pages")}
    for x0, x1 in intervals(SHELF_X, 0.03):
        for z0, z1 in intervals(SHELF_Z, 0.016):
            x, end = x0 + 0.1 * rng.random(), x1 - 0.2 * rng.random()
            colour, height = rng.choice(BOOK_COLOURS), z1 - z0
            while (width := rng.uniform(0.018, 0.05)) < end - x:
                colour = rng.choice(BOOK_COLOURS) if rng.random() < 0.5 else colour
                size = np.array([width, rng.uniform(0.17, 0.24), height * rng.uniform(0.6, 0.9)])
                cover, pages = book(np.array([x, 4.7 + rng.uniform(0, 0.03), z0]), size)
                parts[f"books_{colour}"].append(cover)
                parts["books_pages"].append(pages)
                x += width + 0.002
    return {name: join(meshes) for name, meshes in parts.items()}


def turned(height: float, radius: float, sides: int) -> Mesh:
    """A leg or spindle as from a lathe: beads and a long swelling, `radius` at the widest."""
    s = np.linspace(0, 1, 2 * sides + 1)
    swelling = 0.45 + 0.4 * np.sin(np.pi * np.clip((s - 0.2) / 0.6, 0, 1)) ** 2
    beads = sum(0.5 * np.exp(-(((s - centre) / 0.018) ** 2)) for centre in (0.06, 0.16, 0.2, 0.84, 0.88))
    block = np.where(s > 0.92, 0.95, 0.0)
    return revolved(np.stack([radius * np.maximum(np.minimum(swelling + beads, 1), block), s * height], axis=1), sides)


def table() -> Mesh:
    """The table with its four turned legs."""
    half = np.array([0.85, 0.5])
    leg = turned(0.70, 0.05, 24)
    feet = [leg.moved([*(TABLE + (half - 0.1) * (i, j)), 0.013]) for i in (-1, 1) for j in (-1, 1)]
    top = boxes([*(TABLE - half), 0.725], [*(TABLE + half), 0.765])
    apron = [
        boxes([*(TABLE - half + 0.06), 0.63], [*(TABLE + half * (1, -1) + (-0.06, 0.085)), 0.724]),
        boxes([*(TABLE + half * (-1, 1) - (-0.06, 0.085)), 0.63], [*(TABLE + half - 0.06), 0.724]),
    ]
    return join([top, *apron, *feet])


def chair(facing: int) -> Mesh:
    """A chair at the origin whose back is at y = -0.2 `facing`: turned legs, spindles, flat seat."""
    legs = [turned(0.44, 0.024, 16).moved([x, y, 0.013]) for x in (-0.18, 0.18) for y in (-0.18, 0.18)]
    spindles = [turned(0.42, 0.013, 12).moved([x, -0.2 * facing, 0.49]) for x in np.linspace(-0.19, 0.19, 7)]
    rail = np.array([-0.21, -0.2 * facing - 0.015, 0.905])
    return join(
        [*legs, *spindles, boxes([-0.22, -0.22, 0.452], [0.22, 0.22, 0.488]), boxes(rail, rail + [0.42, 0.03, 0.07])]
    )


def chairs() -> Mesh:
    """Four chairs, two on each long side of the table, pulled out a little."""
    places = [(-0.4, -0.62, 1), (0.42, -0.72, 1), (-0.42, 0.66, -1), (0.4, 0.6, -1)]
    return join([chair(facing).moved([*(TABLE + (x, y)), 0]) for x, y, facing in places])


def mirror() -> tuple[Mesh, Mesh]:
    """The mirror's glass and its stepped frame."""
    low, high = np.array([3.25, 4.99, 1.1]), np.array([4.45, 4.995, 2.3])
    frame = []
    for step, depth in ((0.0, 0.03), (0.03, 0.05), (0.06, 0.035)):
        x0, z0, x1, z1 = low[0] - step, low[2] - step, high[0] + step, high[2] + step
        y = 4.999 - depth
        frame += [
            boxes([x0 - 0.03, y, z0 - 0.03], [x1 + 0.03, 4.998, z0]),
            boxes([x0 - 0.03, y, z1], [x1 + 0.03, 4.998, z1 + 0.03]),
            boxes([x0 - 0.03, y, z0], [x0, 4.998, z1]),
            boxes([x1, y, z0], [x1 + 0.03, 4.998, z1]),
        ]
    return boxes(low, high), join(frame)


def ball(radius: float, sides: int = 32) -> Mesh:
    """A sphere about the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    return revolved(radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), sides)


def cabinet() -> tuple[Mesh, Mesh]:
    """A chest of drawers under the mirror, and its knobs."""
    columns, rows = intervals(np.linspace(3.15, 4.55, 4), 0.012), intervals(np.linspace(0.1, 0.84, 4), 0.012)
    drawers = [boxes([a, 4.5, c], [b, 4.9, d]) for a, b in columns for c, d in rows]
    body = [boxes([3.15, 4.52, 0.08], [4.55, 4.97, 0.84]), boxes([3.11, 4.47, 0.841], [4.59, 4.975, 0.875])]
    feet = [boxes([x, y, 0.001], [x + 0.06, y + 0.06, 0.08]) for x in (3.17, 4.47) for y in (4.54, 4.89)]
    knobs = [ball(0.018, 16).moved([(a + b) / 2, 4.485, (c + d) / 2]) for a, b in columns for c, d in rows]
    return join(drawers + body + feet), join(knobs)


def vessel(radius: Array, height: Array, wall: float) -> Mesh:
    """An open vessel: its outside from the base up, closed by an inside at the distance `wall`."""
    outer = np.stack([radius, height], axis=1)
    inner = np.maximum(outer[::-1] - [wall, 0], [0, wall])
    return revolved(np.concatenate([[[0, outer[0, 1]]], outer, inner, [[0, wall]]]), 64)


def on_table(mesh: Mesh, x: float, y: float) -> Mesh:
    """`mesh` put on the table, `x` and `y` from the middle."""
    return mesh.moved([TABLE[0] + x, TABLE[1] + y, 0.766])


def bowl() -> Mesh:
    """A bowl for the fruit."""
    angle = np.linspace(0, np.pi / 2, 33)
    return vessel(0.06 + 0.14 * np.sin(angle), 0.11 * (1 - np.cos(angle)), 0.006)


def urn() -> Mesh:
    """A tall vase with a narrow neck."""
    s = np.linspace(0, 1, 33)
    return vessel(0.05 + 0.09 * np.sin(np.pi * s**0.7) ** 2 + 0.03 * s**6, 0.42 * s, 0.005)


def carafe() -> Mesh:
    """A carafe, empty."""
    s = np.linspace(0, 1, 33)
    return vessel(0.055 + 0.03 * np.sin(5.2 * s) * (1 - 0.3 * s), 0.3 * s, 0.004)


def meshes() -> dict[str, Mesh]:
    """Every mesh of the furniture by its shape's id."""
    glass, frame = mirror()
    chest, knobs = cabinet()
    places = [(0.0, 0.0, 0.065), (0.1, 0.02, 0.07), (-0.06, 0.09, 0.075), (-0.07, -0.08, 0.075), (0.02, -0.01, 0.15)]
    fruit = join(ball(0.05).moved(place) for place in places)
    return {
        "shelves": shelves(),
        **books(np.random.default_rng(1)),
        "rug": boxes([*(TABLE - (1.4, 1.1)), 0.001], [*(TABLE + (1.4, 1.1)), 0.012]),
        "table": table(),
        "chairs": chairs(),
        "mirror": glass,
        "mirror_frame": frame,
        "cabinet": chest,
        "knobs": knobs,
        "copperware": join([on_table(bowl(), -0.25, 0.02), urn().moved([4.25, 4.72, 0.876])]),
        "fruit": on_table(fruit, -0.25, 0.02),
        "carafe": on_table(carafe(), 0.35, 0.1),
    }
