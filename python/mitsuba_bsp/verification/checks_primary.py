"""Nightly: what a camera sees first, ours, Mitsuba's kd-tree and Embree; exact arithmetic judges their disputes.

A ray along the outline of a mesh may miss it by rounding in the triangle test itself. Trees are wrong where they answer
otherwise than brute force with the same test; where that errs is counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ..contenders import Triangles
from ..contenders import build as build_contender
from ..spec import parse_spec
from ..text_table import TextTable
from .check import Outcome, Plan, Record, Subject, Unit, check
from .contest import main_subjects, names
from .exact import ExactRay
from .judge import enter
from .meshes import Mesh, small_meshes
from .oracle import Questions, brute_force, build, found
from .rays import camera_rays

RAYS = 1_000_000  #: in each mesh
OTHERS = ("native", "embree:robust=true")

#: Figures of a unit.
_KEYS = ("disputed", "brute force wrong", *(f"{text} wrong" for text in OTHERS))


def tables(records: Sequence[Record]) -> list[TextTable]:
    """A row for each mesh: of how many rays they disagree whether there is a hit, and who is wrong."""
    rows = tuple(
        (row["unit"].partition(",")[0], f"{row['figures']['rays']:,}", *(f"{row['figures'][key]:,}" for key in _KEYS))
        for row in records
    )
    return [TextTable("Hit or miss, of camera rays", ("mesh", "rays", *_KEYS), rows)]


@check("N12p", "primary hits: disputes with native and Embree, exact arithmetic judges", tables)
def primary_hits(plan: Plan) -> Iterator[Unit]:
    subjects = main_subjects(plan)
    for mesh in small_meshes():
        yield Unit(f"{mesh.name}, {names(subjects)}", "", lambda m=mesh: _disputes(plan, m, subjects))


def _disputes(plan: Plan, mesh: Mesh, subjects: Sequence[Subject]) -> Outcome:
    count = plan.count(RAYS)
    o, d = camera_rays(mesh, count, plan.rng("N12p", mesh.name))
    ends = np.full(count, np.inf, np.float32)
    triangles = Triangles(((mesh.vertices, mesh.faces),))
    hits = {subject.spec.text: found(build(mesh, subject.spec).closest(o, d, ends)) for subject in subjects}
    for text in OTHERS:
        hits[text] = np.isfinite(build_contender(parse_spec(text), triangles).tree.closest(o, d, ends))
    said = np.array(list(hits.values()))
    disputed = np.flatnonzero(said.any(axis=0) != said.all(axis=0))
    right = np.array([ExactRay(o[i], d[i]).closest(mesh) is not None for i in disputed], bool)

    expected = brute_force(mesh).closest(o[disputed], d[disputed], ends[disputed])
    asked = Questions(mesh, "camera", plan.seed, o[disputed], d[disputed], ends[disputed], expected)

    outcome = Outcome()
    for subject in subjects:
        wrong = hits[subject.spec.text][disputed] != found(expected)
        enter(outcome, subject, asked, wrong, "answers otherwise than brute force, and than others")
    outcome.tried = count * len(subjects)
    outcome.figures |= {"rays": count, "disputed": len(disputed)}
    outcome.figures["brute force wrong"] = int((found(expected) != right).sum())
    outcome.figures |= {f"{text} wrong": int((hits[text][disputed] != right).sum()) for text in OTHERS}
    return outcome
