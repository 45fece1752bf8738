"""What Mitsuba's own accelerators lose where ours may lose nothing: the same rays, through Mitsuba, under each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..spec import Spec
from ..text_table import TextTable
from .cases import Case
from .check import Failure, Outcome, Plan, Record, Unit, check
from .incumbents import missed, rays_inside, targets

RAYS = 20_000
OURS = ("kd", "normals")


def tables(records: Sequence[Record]) -> list[TextTable]:
    """A row for each family, a column for each accelerator."""
    specs = [row["spec"] for row in records]
    rows = []
    for family in records[0]["wrong"]:
        tried = records[0]["figures"][family]
        rows.append((family, f"{tried:,}", *(_share(row["wrong"].get(family, 0), tried) for row in records)))
    title = "Rays from inside a closed mesh that hit nothing, through Mitsuba"
    return [TextTable(title, ("mesh and target", "rays", *specs), tuple(rows))]


@check("incumbents", "what Mitsuba's own accelerators lose", tables)
def fire_at_incumbents(plan: Plan) -> Iterator[Unit]:
    """Two of our trees beside them, through Mitsuba as well."""
    ours = [subject.spec for subject in plan.subjects if subject.spec.text in OURS]
    for spec in (*plan.incumbents, *(ours or [plan.subjects[0].spec])):
        yield Unit(spec.text, spec.text, lambda spec=spec: _fire(plan, spec))


def _fire(plan: Plan, spec: Spec) -> Outcome:
    outcome = Outcome(judged=spec.is_tree)
    for name, (mesh, family) in targets().items():
        o, d = rays = rays_inside(mesh, family, plan.count(RAYS), plan.rng("inside", name))
        lost = missed(mesh, spec, rays)

        def failure(mesh=mesh, o=o, d=d, lost=lost, name=name) -> Failure:
            one = slice(int(np.argmax(lost)), int(np.argmax(lost)) + 1)
            why = f"{spec.text} loses it in a Mitsuba scene, {name}"
            end = np.full(1, np.inf, np.float32)
            case = Case(why, mesh, o[one], d[one], end, (True,), spec.text, plan.seed, through="alone")
            return Failure(f"{why}, seed {plan.seed}: {case.describe(0)}", case.to_json())

        outcome.add(name, len(o), int(lost.sum()), failure if spec.is_tree else None)
        outcome.figures[name] = len(o)
    return outcome


def _share(lost: int, tried: int) -> str:
    return f"{100 * lost / tried:.2g} %" if lost else "0"
