"""The interval of a ray is closed at both ends, as in Mitsuba: 0 <= t <= maxt."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .checks_brute import mesh_questions
from .judge import enter
from .meshes import Mesh
from .oracle import Answers, Questions, brute_force, ended, found, small_trees
from .rays import Rays

HITS = 10_000

Floats = NDArray[np.float32]

#: Ends of intervals as functions of t of the first hit.
ENDS: dict[str, Callable[[Floats], Floats]] = {
    "t": lambda t: t,
    "just below t": lambda t: np.nextafter(t, np.float32(-np.inf)),
    "0": np.zeros_like,
    "-1": lambda t: np.full_like(t, -1),
    "infinite": lambda t: np.full_like(t, np.inf),
}


@check("C06", "intervals are closed", at_once=True)
def intervals_are_closed(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _cut)


def _cut(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    for mesh, tree in small_trees(subject):
        (o, d), hits = _hits(plan, subject, mesh)
        t = hits["t"]
        for name, end in ENDS.items():
            maxt = end(t)
            expected = ended(brute_force(mesh, subject.triangle_test), (o, d), hits, maxt)
            asked = Questions(mesh, f"maxt {name}", plan.seed, o, d, maxt, expected)
            answers = tree.closest(*asked.rays)
            # The rule itself, and the same answer from any-hit rays: brute force is not asked about either.
            wrong = found(answers) != (t <= maxt)
            wrong |= tree.any(*asked.rays).astype(bool) != (t <= maxt)
            wrong |= found(answers) & (answers["t"].view(np.uint32) != t.view(np.uint32))
            enter(outcome, subject, asked, wrong, "does not end the interval at maxt")
    return outcome


def _hits(plan: Plan, subject: Subject, mesh: Mesh) -> tuple[Rays, Answers]:
    """Rays of all families that hit, in equal parts, and what."""
    count = plan.count(HITS, subject) // len(small_trees(subject)) + 1
    asked = mesh_questions(plan, subject, mesh)
    each = count // len(asked) + 1
    parts = []
    for family in asked:
        hit = np.flatnonzero(found(family.expected) & np.isinf(family.maxt))[:each]
        parts.append((family.origins[hit], family.directions[hit], *(v[hit] for v in family.expected.values())))
    o, d, *values = (np.concatenate(arrays)[:count] for arrays in zip(*parts, strict=True))
    return (o, d), dict(zip(asked[0].expected, values, strict=True))
