"""Nightly: the triangle test itself against exact arithmetic, which the other checks take for granted."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from .check import Failure, Outcome, Plan, Unit, check
from .exact import ExactRay
from .meshes import Mesh, small_meshes
from .oracle import Questions, brute_force, found
from .rays import FAMILIES, INTERIOR_FAMILIES, Rays, interior_rays

RAYS = 100_000  #: over all meshes and families


@check("N03", "Woop's test against exact arithmetic")
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
    for family, make in FAMILIES.items():
        rng = plan.rng("N03", mesh.name, family)
        _hold_against_exact(outcome, plan, mesh, family, make(mesh, -(-count // len(FAMILIES)), rng))
    return outcome


def _inside(plan: Plan, mesh: Mesh, count: int) -> Outcome:
    """Judged: what exact arithmetic lets hit must hit, for the mesh is closed."""
    outcome = Outcome()
    for family in INTERIOR_FAMILIES:
        rng = plan.rng("N03 inside", mesh.name, family)
        rays = interior_rays(mesh, -(-count // len(INTERIOR_FAMILIES)), rng, family)
        _hold_against_exact(outcome, plan, mesh, family, rays)
    return outcome


def _hold_against_exact(outcome: Outcome, plan: Plan, mesh: Mesh, family: str, rays: Rays) -> None:
    """Count false misses as wrong; false hits, other triangles and the largest error of t are figures."""
    o, d = rays
    ends = np.full(len(o), np.inf, np.float32)
    answers = brute_force(mesh).closest(o, d, ends)
    asked = Questions(mesh, family, plan.seed, o, d, ends, answers)
    hits, missed = found(answers), []
    figures = {"false hits": 0, "other triangles": 0, "largest error of t, ulp": 0.0}
    for index in range(len(o)):
        ray = ExactRay(o[index], d[index])
        exact = ray.closest(mesh)
        if exact is not None and not hits[index]:
            missed.append(index)
        if not hits[index]:
            continue
        triangle, t = int(answers["triangle"][index]), answers["t"][index]
        figures["false hits"] += exact is None
        figures["other triangles"] += exact is not None and exact.triangle != triangle and exact.t != Fraction(float(t))
        own = ray.hit(mesh.vertices[mesh.faces[triangle]])
        if own is not None and t > 0:
            error = abs(float(own - Fraction(float(t)))) / float(np.spacing(t))
            figures["largest error of t, ulp"] = max(figures["largest error of t, ulp"], round(error, 2))

    def failure() -> Failure:
        sentence = "the triangle test misses what exact arithmetic hits"
        case = asked.case(missed[0], "brute", sentence, hit=True).to_json()
        return Failure(f"{sentence}: {asked.describe(missed[0])}", case)

    outcome.add(family, len(o), len(missed), failure)
    for key, value in figures.items():
        kept = outcome.figures.get(key, 0)
        outcome.figures[key] = max(kept, value) if key.startswith("largest") else kept + value
