"""Many trees asked the same rays at once, so that the right answers are found once for all of them."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .. import _core
from . import judge
from .check import Outcome, Plan, Subject
from .meshes import Mesh
from .oracle import Questions, build, differing, found
from .rays import FAMILIES, Generator, Rays, plane_rays

#: Rays asked at once: enough for all threads, little memory.
BATCH = 200_000


@dataclass(frozen=True)
class Contestant:
    """A tree over the mesh of a contest, and its share of the rays."""

    subject: Subject
    tree: _core.Accelerator


def judged_subjects(plan: Plan) -> tuple[Subject, ...]:
    """Those that promise the answers of a loop over all triangles with the watertight test."""
    return tuple(s for s in plan.subjects if s.promises and s.triangle_test == "woop")


def main_subjects(plan: Plan) -> tuple[Subject, ...]:
    """One for each tree: those with full counts if there are others, by name only once."""
    first: dict[str, Subject] = {}
    for subject in judged_subjects(plan):
        if subject.share == 1:
            first.setdefault(subject.spec.name, subject)
    return tuple(first.values())


def names(subjects: Sequence[Subject]) -> str:
    """A short name for these subjects, to tell units of other subjects apart."""
    text = " ".join(f"{subject.spec.full} {subject.share}" for subject in subjects)
    return f"{len(subjects)} specs {hashlib.sha256(text.encode()).hexdigest()[:6]}"


def enter(mesh: Mesh, subjects: Sequence[Subject]) -> list[Contestant]:
    """Builds everyone's tree."""
    return [Contestant(subject, build(mesh, subject.spec)) for subject in subjects]


def family_rays(
    mesh: Mesh, count: int, rng: Generator, contestants: Sequence[Contestant], shares: Mapping[str, float]
) -> Iterator[tuple[str, Rays]]:
    """`count` rays over all families, in batches, those in planes in the planes of one tree after the other.

    A family gets `shares`, 1 if it is not there, of what the others get.
    """
    families = {name: shares.get(name, 1.0) for name in (*FAMILIES, "plane")}
    unit = count / sum(families.values())
    for turn, (family, share) in enumerate(families.items()):
        left = max(1, round(unit * share))
        while left > 0:
            size = min(left, BATCH)
            left -= size
            if family == "plane":
                tree = contestants[(turn + left) % len(contestants)].tree
                yield family, plane_rays(mesh, size, rng, tree.planes().reshape(-1, 4))
            else:
                yield family, FAMILIES[family](mesh, size, rng)


def compare(outcome: Outcome, asked: Questions, contestants: Sequence[Contestant]) -> None:
    """Enter where someone's closest hit or any hit is another one."""
    for contestant in contestants:
        part = asked.head(max(1, round(len(asked) * contestant.subject.share)))
        wrong = differing(contestant.tree.closest(*part.rays), part.expected)
        wrong |= contestant.tree.any(*part.rays).astype(bool) != found(part.expected)
        report(outcome, contestant.subject, part, wrong)


def report(outcome: Outcome, subject: Subject, asked: Questions, wrong: np.ndarray) -> None:
    """Enter the wrong rays of one tree, and how many it was asked."""
    judge.enter(outcome, subject, asked, wrong, "answers otherwise than the oracle")
    rays = f"rays of {subject.spec.name}"
    outcome.figures[rays] = int(outcome.figures.get(rays, 0)) + len(asked)
