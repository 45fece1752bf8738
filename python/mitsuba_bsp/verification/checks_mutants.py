"""Proof that the checks can see: mistakes planted in the traversal must be found by the rays of C01 and C05."""

from __future__ import annotations

from collections.abc import Iterator

from .. import _core
from ..spec import parse_spec
from .check import Outcome, Plan, Unit, check
from .meshes import small_meshes
from .oracle import build, differing, found, plane_questions, questions

RAYS_PER_FAMILY = 2_000
LEAST_RAYS = 1_000  #: however small the counts: fewer do not see all mistakes
LAYOUTS = ("wide", "binary")


@check("C02", "mistakes planted in the traversal are seen", at_once=True)
def mutants_are_seen(plan: Plan) -> Iterator[Unit]:
    for layout in LAYOUTS:
        for fault in _core.faults():
            spec = f"normals:layout={layout}"
            yield Unit(f"{fault}, {layout}", spec, lambda spec=spec, fault=fault: _hunt(plan, spec, fault))


def _hunt(plan: Plan, spec: str, fault: str) -> Outcome:
    """Look for the mistake mesh by mesh, until it is seen."""
    outcome = Outcome(what="mutants")
    seen, rays = "", 0
    for mesh in small_meshes():
        tree = build(mesh, parse_spec(spec), fault)
        count = max(LEAST_RAYS, plan.count(RAYS_PER_FAMILY))
        for asked in (*questions(mesh, count, plan.seed), plane_questions(mesh, tree, count, plan.seed)):
            wrong = differing(tree.closest(*asked.rays), asked.expected)
            wrong |= tree.any(*asked.rays).astype(bool) != found(asked.expected)
            rays += len(asked)
            if wrong.any():
                seen = f"{mesh.name}, {asked.family}, {int(wrong.sum())} of {len(asked)}"
                break
        if seen:
            break
    outcome.expect("unseen", bool(seen), f"{spec} with the fault {fault} passes for right, seed {plan.seed}")
    outcome.figures = {"rays": rays, "seen": seen}
    return outcome
