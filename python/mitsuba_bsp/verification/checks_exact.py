"""Nightly: the triangle test itself against exact arithmetic, which the other checks take for granted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .check import Failure, Outcome, Plan, Unit, check
from .exactness import against_exact, exactness_tables, publish
from .meshes import Mesh, small_meshes
from .oracle import Questions, brute_force
from .rays import FAMILIES, INTERIOR_FAMILIES, Generator, Rays, interior_rays

RAYS = 100_000  #: over all meshes and families

#: Among so many rays for each wanted one those are looked for on which the two triangle tests disagree.
SEARCHED = 30


@check("N03", "Woop's test against exact arithmetic", exactness_tables("Woop's test against exact arithmetic"))
def woop_against_exact(plan: Plan) -> Iterator[Unit]:
    meshes = small_meshes()
    count = plan.count(RAYS / (2 * len(meshes)))
    for mesh in meshes:
        yield Unit(f"{mesh.name}, from all sides", "", lambda m=mesh: _sample(plan, m, count))
        if mesh.closed:
            yield Unit(f"{mesh.name}, from inside", "", lambda m=mesh: _inside(plan, m, count))


def _sample(plan: Plan, mesh: Mesh, count: int) -> Outcome:
    """Reported only: at the borders of triangles either answer may be the better one."""
    outcome = Outcome(judged=False)
    each = -(-count // (len(FAMILIES) + 1))
    for family, make in FAMILIES.items():
        rng = plan.rng("N03", mesh.name, family)
        _hold_against_exact(outcome, plan, mesh, family, make(mesh, each, rng))
    _hold_against_exact(outcome, plan, mesh, "disputed", disputed_rays(mesh, each, plan.rng("N03", mesh.name)))
    return outcome


def disputed_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """Rays of all families on which Woop's test and that of Moeller and Trumbore find different triangles.

    At most `count`; fewer where there are not so many.
    """
    parts = []
    for make in FAMILIES.values():
        o, d = make(mesh, -(-SEARCHED * count // len(FAMILIES)), rng)
        ends = np.full(len(o), np.inf, np.float32)
        woop, mt = (brute_force(mesh, test).closest(o, d, ends)["triangle"] for test in ("woop", "mt"))
        parts.append((o[woop != mt], d[woop != mt]))
    o, d = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    chosen = rng.permutation(len(o))[:count]
    return o[chosen], d[chosen]


def _inside(plan: Plan, mesh: Mesh, count: int) -> Outcome:
    """Judged: what exact arithmetic lets hit must hit, for the mesh is closed."""
    outcome = Outcome()
    for family in INTERIOR_FAMILIES:
        rng = plan.rng("N03 inside", mesh.name, family)
        rays = interior_rays(mesh, -(-count // len(INTERIOR_FAMILIES)), rng, family)
        _hold_against_exact(outcome, plan, mesh, family, rays)
    return outcome


def _hold_against_exact(outcome: Outcome, plan: Plan, mesh: Mesh, family: str, rays: Rays) -> None:
    """Count false misses as wrong; all else is published."""
    o, d = rays
    ends = np.full(len(o), np.inf, np.float32)
    asked = Questions(mesh, family, plan.seed, o, d, ends, brute_force(mesh).closest(o, d, ends))
    exactness = against_exact(asked)

    def failure() -> Failure:
        sentence = "the triangle test misses what exact arithmetic hits"
        first = exactness.missed[0]
        case = asked.case(first, "brute", sentence, hit=True).to_json()
        return Failure(f"{sentence}: {asked.describe(first)}", case)

    outcome.add(family, len(o), len(exactness.missed), failure)
    publish(outcome, asked, exactness)
