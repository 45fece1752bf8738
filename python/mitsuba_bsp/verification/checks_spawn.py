"""Nightly: rays that leave a surface do not hit it again (after pbrt's test Reintersect), as Mitsuba spawns them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..scalar import mitsuba
from ..spec import parse_spec
from ..text_table import TextTable
from .check import Failure, Outcome, Plan, Record, Unit, check
from .meshes import Mesh, of_corners
from .oracle import build
from .rays import Generator
from .wrapped import group, to_mitsuba

TRIANGLES, RAYS = 1000, 10_000
PER_UNIT = 50
SPEC = "normals"

#: Of the largest coordinate that Mitsuba moves a spawned ray's origin by, and of one (render/interaction.h).
MITSUBA_OFFSET = 1500 * 2.0**-24

#: Shares of Mitsuba's offset that are tried: 1, 1/2, 1/4, ...
_HALVINGS = 16


#: The figure of a unit: the least of these shares with which no ray of its triangles hits where it comes from.
LEAST = "least offset without a hit, of Mitsuba's"


def tables(records: Sequence[Record]) -> list[TextTable]:
    """The least offset for all triangles together."""
    least = max((row["figures"].get(LEAST, 0.0) for row in records), default=0.0)
    rays = sum(row["tried"] for row in records)
    head = ("spawned rays", "Mitsuba's offset", LEAST)
    cells = (f"{rays:,}", f"{MITSUBA_OFFSET:.3g} (1 + max |p|)", f"{least:.3g}")
    return [TextTable("Offsets of spawned rays", head, (cells,))]


@check("N06", "spawned rays do not hit where they come from", tables)
def spawned_rays(plan: Plan) -> Iterator[Unit]:
    triangles, rays = plan.count(TRIANGLES), plan.count(RAYS)
    for start in range(0, triangles, PER_UNIT):
        numbers = range(start, min(start + PER_UNIT, triangles))
        yield Unit(f"triangles {numbers.start} to {numbers.stop - 1}", SPEC, lambda n=numbers: _spawn(plan, n, rays))


def _spawn(plan: Plan, numbers: range, count: int) -> Outcome:
    outcome = Outcome()
    least = 0.0
    for number in numbers:
        rng = plan.rng("N06", number)
        mesh = random_triangle(number, rng)
        points, directions = _leaving(mesh, count, rng)
        least = max(least, _least_offset(mesh, points, directions))
        _through_mitsuba(outcome, plan, mesh, points, directions)
    outcome.figures[LEAST] = least
    return outcome


def random_triangle(number: int, rng: Generator) -> Mesh:
    """Each coordinate of any sign and size from 1e-8 to 1e8."""
    corners = rng.choice([-1.0, 1.0], (1, 3, 3)) * 10 ** rng.uniform(-8, 8, (1, 3, 3))
    return of_corners(f"triangle {number}", corners)


def _leaving(mesh: Mesh, count: int, rng: Generator) -> tuple[np.ndarray, np.ndarray]:
    """Points of the triangle as floats have them, and directions to either side of it, all alike."""
    a, b, c = mesh.vertices[mesh.faces[0]].astype(np.float32)
    u, v = rng.random((2, count)).astype(np.float32)
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    points = ((1 - u - v)[:, None] * a + u[:, None] * b + v[:, None] * c).astype(np.float32)
    directions = rng.normal(size=(count, 3))
    return points, (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)


def _normal(mesh: Mesh) -> np.ndarray:
    a, b, c = mesh.vertices[mesh.faces[0]].astype(float)
    found = np.cross(b - a, c - a)
    return found / np.linalg.norm(found)


def _least_offset(mesh: Mesh, points: np.ndarray, directions: np.ndarray) -> float:
    """The smallest of the tried shares of Mitsuba's offset with which no ray hits the triangle; 2 if all of them do."""
    tree = build(mesh, parse_spec(SPEC))
    normal = _normal(mesh)
    side = np.sign(directions.astype(float) @ normal)
    reach = MITSUBA_OFFSET * (1 + np.abs(points).max(axis=1).astype(float))
    ends = np.full(len(points), np.inf, np.float32)
    best = 2.0
    for halving in range(_HALVINGS):
        origins = points + (side * reach * 2.0**-halving)[:, None] * normal
        if tree.any(origins.astype(np.float32), directions, ends).any():
            break
        best = 2.0**-halving
    return best


def _through_mitsuba(outcome: Outcome, plan: Plan, mesh: Mesh, points: np.ndarray, directions: np.ndarray) -> None:
    """Two kinds: in a direction, and to a point."""
    mi = mitsuba()
    scene = mi.load_dict({"type": "scene", "group": group(parse_spec(SPEC), {"mesh": to_mitsuba(mesh)})})
    si = mi.SurfaceInteraction3f()
    si.t, si.n = 1.0, mi.Normal3f(*_normal(mesh).tolist())
    for place, way in zip(points.tolist(), directions.tolist(), strict=True):
        si.p = mi.Point3f(place)
        target = si.p + mi.Vector3f(way) * 2 * mesh.size
        for kind, ray in (("spawn_ray", si.spawn_ray(mi.Vector3f(way))), ("spawn_ray_to", si.spawn_ray_to(target))):
            hit = scene.ray_test(ray)
            text = (
                f"{kind}, seed {plan.seed}, {mesh.name}: from {[x.hex() for x in place]} along {[x.hex() for x in way]}"
            )
            outcome.add(kind, 1, int(hit), lambda text=text: Failure(f"{text} hits the triangle that it leaves"))
