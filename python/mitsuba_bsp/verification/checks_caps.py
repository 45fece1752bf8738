"""Trees of pathological meshes: the caps on references and levels hold, builds are quick, and the user is told."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import ceil

from .. import _core
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .checks_audit import depth_allowed
from .judge import enter
from .meshes import Mesh
from .oracle import Questions, build, differing, plane_questions, questions
from .pathological import MESHES, pathological_meshes
from .rays import FAMILIES
from .timing import timed

LEAST = 0.01  #: of the meshes' triangles, however small the counts
RAYS = 10_000  #: of all families, over all meshes

#: Of the rays; those of a mesh whose triangles are all hit at once, and all decided, by every ray that is aimed at one.
SHARE_OF_IDENTICAL = 0.02

#: Seconds that a build may take on two processors.
LIMIT_S = 3.0

#: Where leaves that a cap kept from being split hold this share of all references, there is a warning.
WORTH_A_WARNING = 0.1


@check("C13", "caps on references, depth and time hold")
def caps(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _cap)


def _cap(plan: Plan, subject: Subject) -> Outcome:
    """Variants: one of the meshes, another one each time, of a tenth of the triangles."""
    outcome = Outcome(judged=subject.promises)
    meshes = pathological_meshes(max(LEAST, subject.share * min(1.0, plan.scale)))
    for mesh in subject.part_of(meshes, len(meshes)):
        _compare(outcome, plan, subject, mesh, _build(outcome, subject, mesh))
    return outcome


def _build(outcome: Outcome, subject: Subject, mesh: Mesh) -> _core.Accelerator:
    seconds, tree = timed(lambda: build(mesh, subject.spec), LIMIT_S)
    statistics = json.loads(tree.statistics())
    text = f"{subject.spec.text}, {mesh.name}"
    references, allowed = statistics["references"], subject.spec.settings["max_references"] * statistics["triangles"]
    outcome.expect("references", references <= allowed, f"{text}: {references} references, {allowed:g} are allowed")
    depth, levels = statistics["max_depth"], depth_allowed(subject, statistics["triangles"])
    outcome.expect("depth", depth <= levels, f"{text}: depth {depth}, but {levels} are allowed")
    outcome.expect("time", seconds < LIMIT_S, f"{text}: built in {seconds:.2f} s, not in {LIMIT_S:g} s")
    capped = statistics["capped_references"] >= WORTH_A_WARNING * max(1, references)
    warned = "were not split further" in tree.warning()
    outcome.expect("warning", warned == capped, f'{text}: the warning is "{tree.warning()}"')
    outcome.figures |= {f"{mesh.name}, s": round(seconds, 3), f"{mesh.name}, capped": int(capped)}
    return tree


def _compare(outcome: Outcome, plan: Plan, subject: Subject, mesh: Mesh, tree: _core.Accelerator) -> None:
    """As C01 does, with fewer rays."""
    share = SHARE_OF_IDENTICAL if mesh.name == "identical" else (1 - SHARE_OF_IDENTICAL) / (MESHES - 1)
    most, count = (ceil(share * n / (len(FAMILIES) + 1)) for n in (plan.most(RAYS, subject), plan.count(RAYS, subject)))
    for asked in questions(mesh, most, plan.seed, subject.triangle_test):
        _ask(outcome, subject, tree, asked.head(count))
    _ask(outcome, subject, tree, plane_questions(mesh, tree, count, plan.seed, subject.triangle_test))


def _ask(outcome: Outcome, subject: Subject, tree: _core.Accelerator, asked: Questions) -> None:
    wrong = differing(tree.closest(*asked.rays), asked.expected)
    enter(outcome, subject, asked, wrong, "answers something else than brute force")
