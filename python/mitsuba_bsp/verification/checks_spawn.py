"""Nightly: rays that leave a surface do not hit it again (after pbrt's test Reintersect), as Mitsuba spawns them.

Mitsuba's offset grows with the point's coordinates, not with the triangle. Where a corner is some hundred times farther
away than that, the offset is less than what rounding may move. Such hits are counted, and may be few.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..contenders import Asked, Triangles
from ..contenders import build as build_contender
from ..scalar import mitsuba
from ..spec import parse_spec
from ..text_table import TextTable
from .cases import Case
from .check import Failure, Outcome, Plan, Record, Unit, check
from .meshes import Mesh, of_corners
from .rays import Generator
from .wrapped import group, to_mitsuba

TRIANGLES, RAYS = 1000, 10_000
PER_UNIT = 50
SPEC = "normals"

#: Of the largest coordinate that Mitsuba moves a spawned ray's origin by, and of one (render/interaction.h).
MITSUBA_OFFSET = 1500 * 2.0**-24

#: Shares of Mitsuba's offset that are tried: 1, 1/2, 1/4, ...
_HALVINGS = 16


#: Figures of a unit: the least of these shares with which no ray of its triangles hits where it comes from; hits that
#: rounding explains; and of rays with Mitsuba's offset, in one direction, those that hit, under each accelerator.
LEAST = "least offset without a hit, of Mitsuba's"
ROUNDED = "hits within rounding"
HITS = "hits under"

#: By how much a hit may be beside the ray, per axis: of the farthest coordinate from its origin (error-analysis.md).
_HIT_ERROR = 8 * 2.0**-24

#: Share of the rays that may hit within it.
_MAY_BE_ROUNDED = 1e-5


def tables(records: Sequence[Record]) -> list[TextTable]:
    """The least offset for all triangles together."""
    least = max((row["figures"].get(LEAST, 0.0) for row in records), default=0.0)
    rays = sum(row["tried"] for row in records)
    under = list(dict.fromkeys(key for row in records for key in row["figures"] if key.startswith(HITS)))
    sums = [sum(int(row["figures"].get(key, 0)) for row in records) for key in (ROUNDED, *under)]
    head = ("spawned rays", "Mitsuba's offset", LEAST, ROUNDED, *(f"{key}, of half as many" for key in under))
    cells = (f"{rays:,}", f"{MITSUBA_OFFSET:.3g} (1 + max |p|)", f"{least:.3g}", *(f"{count:,}" for count in sums))
    return [TextTable("Offsets of spawned rays", head, (cells,))]


@check("N06", "spawned rays do not hit where they come from", tables)
def spawned_rays(plan: Plan) -> Iterator[Unit]:
    triangles, rays = plan.count(TRIANGLES), plan.count(RAYS)
    for start in range(0, triangles, PER_UNIT):
        numbers = range(start, min(start + PER_UNIT, triangles))
        yield Unit(f"triangles {numbers.start} to {numbers.stop - 1}", SPEC, lambda n=numbers: _spawn(plan, n, rays))


def _spawn(plan: Plan, numbers: range, count: int) -> Outcome:
    outcome = Outcome()
    least, hits = 0.0, dict.fromkeys((SPEC, *(spec.text for spec in plan.incumbents)), 0)
    outcome.figures[ROUNDED] = 0
    for number in numbers:
        rng = plan.rng("N06", number)
        mesh = random_triangle(number, rng)
        points, directions = _leaving(mesh, count, rng)
        trees = {
            text: build_contender(parse_spec(text), Triangles(((mesh.vertices, mesh.faces),))).tree for text in hits
        }
        least = max(least, _least_offset(trees[SPEC], mesh, points, directions))
        for text, tree in trees.items():
            hits[text] += int(_hits(tree, mesh, points, directions, 1.0).sum())
        _through_mitsuba(outcome, plan, mesh, points, directions)
    rounded = int(outcome.figures[ROUNDED])
    allowed = max(1, round(_MAY_BE_ROUNDED * outcome.tried))
    text = f"triangles {numbers.start} to {numbers.stop - 1}: {rounded} rays hit within rounding, {allowed} may"
    outcome.add("rounded", 0, int(rounded > allowed), lambda: Failure(text))
    outcome.figures |= {LEAST: least, **{f"{HITS} {text}": count for text, count in hits.items()}}
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


def _hits(tree: Asked, mesh: Mesh, points: np.ndarray, directions: np.ndarray, share: float) -> np.ndarray:
    """Which rays hit the triangle that they leave, moved off it by a share of Mitsuba's offset."""
    normal = _normal(mesh)
    side = np.sign(directions.astype(float) @ normal)
    reach = MITSUBA_OFFSET * (1 + np.abs(points).max(axis=1).astype(float))
    origins = (points + (side * reach * share)[:, None] * normal).astype(np.float32)
    return tree.any(origins, directions, np.full(len(points), np.inf, np.float32)).astype(bool)


def _least_offset(tree: Asked, mesh: Mesh, points: np.ndarray, directions: np.ndarray) -> float:
    """The smallest of the tried shares of Mitsuba's offset with which no ray hits the triangle; 2 if all of them do."""
    best = 2.0
    for halving in range(_HALVINGS):
        if _hits(tree, mesh, points, directions, 2.0**-halving).any():
            break
        best = 2.0**-halving
    return best


def _within_rounding(mesh: Mesh, origin: np.ndarray) -> bool:
    """Whether the triangle's plane is no farther from the ray's origin than rounding may move a hit."""
    corners = mesh.vertices[mesh.faces[0]].astype(float) - origin
    normal, sizes = _normal(mesh), np.abs(corners).max(axis=1)
    return bool(abs(normal @ corners[sizes.argmin()]) <= _HIT_ERROR * np.abs(normal).sum() * sizes.max())


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
            if hit and _within_rounding(mesh, np.array(ray.o, float)):
                outcome.figures[ROUNDED] += 1
                hit = False
            outcome.add(kind, 1, int(hit), lambda ray=ray, kind=kind: _failure(plan, mesh, kind, ray))


def _failure(plan: Plan, mesh: Mesh, kind: str, ray: Any) -> Failure:
    """A ray that hits the triangle that it leaves."""
    o, d = (np.array([part], np.float32) for part in (ray.o, ray.d))
    why = f"{kind}, seed {plan.seed}: it hits the triangle that it leaves"
    case = Case(why, mesh, o, d, np.array([ray.maxt], np.float32), (False,), SPEC, plan.seed)
    corners = " ".join("({})".format(", ".join(float(x).hex() for x in corner)) for corner in mesh.vertices)
    return Failure(f"{why}: {case.describe(0)}, {corners}", case.to_json())
