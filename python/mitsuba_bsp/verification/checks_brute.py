"""Every tree against brute force: the first hit with all its bits, and whether there is one."""

from __future__ import annotations

from collections.abc import Iterator

from .. import _core
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .judge import enter
from .meshes import Mesh
from .oracle import VARIANT_MESHES, Questions, differing, found, plane_questions, questions, small_trees

RAYS_PER_FAMILY = 10_000  #: times 9 families, times 12 meshes: 1.08 million rays


def subject_questions(plan: Plan, subject: Subject) -> Iterator[tuple[_core.Accelerator, Questions]]:
    """The trees of small meshes, and the subject's share of the rays of every family."""
    count, trees = _count(plan, subject), small_trees(subject)
    start = subject.turn % len(trees)  # so that threads begin with different meshes, and find what others computed
    for mesh, tree in (*trees[start:], *trees[:start]):
        for asked in mesh_questions(plan, subject, mesh):
            yield tree, asked.head(count)
        yield tree, plane_questions(mesh, tree, count, plan.seed, subject.triangle_test)


def mesh_questions(plan: Plan, subject: Subject, mesh: Mesh) -> tuple[Questions, ...]:
    """As many of every family as anyone with the triangle test of this subject asks."""
    alike = (other for other in plan.subjects if other.triangle_test == subject.triangle_test)
    return questions(mesh, max(_count(plan, other) for other in alike), plan.seed, subject.triangle_test)


def _count(plan: Plan, subject: Subject) -> int:
    """Rays of a family in one mesh."""
    return plan.count(RAYS_PER_FAMILY * (1 if subject.share == 1 else VARIANT_MESHES), subject)


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
