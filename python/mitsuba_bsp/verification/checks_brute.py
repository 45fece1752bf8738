"""Every tree against brute force: the first hit with all its bits, and whether there is one."""

from __future__ import annotations

from collections.abc import Iterator

from .. import _core
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .judge import enter
from .oracle import Questions, differing, found, plane_questions, questions, small_trees

RAYS_PER_FAMILY = 10_000  #: times 9 families, times 12 meshes: 1.08 million rays


def subject_questions(plan: Plan, subject: Subject) -> Iterator[tuple[_core.Accelerator, Questions]]:
    """Every small mesh's tree, and its share of the rays of every family."""
    count, trees = plan.count(RAYS_PER_FAMILY, subject), small_trees(subject.spec)
    start = subject.turn % len(trees)  # so that threads begin with different meshes, and find what others computed
    for mesh, tree in (*trees[start:], *trees[:start]):
        for asked in questions(mesh, plan.most(RAYS_PER_FAMILY, subject), plan.seed, subject.triangle_test):
            yield tree, asked.head(count)
        yield tree, plane_questions(mesh, tree, count, plan.seed, subject.triangle_test)


@check("C01", "equal to brute force, bit for bit", at_once=True)
def equal_to_brute_force(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _compare)


def _compare(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    for tree, asked in subject_questions(plan, subject):
        wrong = differing(tree.closest(*asked.rays), asked.expected)
        enter(outcome, subject, asked, wrong, "answers something else than brute force")
    return outcome


@check("C05", "any hit is found where a closest hit is", at_once=True)
def any_as_closest(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _any_as_closest)


def _any_as_closest(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    for tree, asked in subject_questions(plan, subject):
        wrong = tree.any(*asked.rays).astype(bool) != found(asked.expected)
        enter(outcome, subject, asked, wrong, "finds any hit where there is none, or none where there is one")
    return outcome
