"""Embree hands rays to our shape: the scene's answers are the tree's own, and no ray is lost on the way."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from ..spec import Spec, parse_spec
from .check import Failure, Outcome, Plan, Unit, check
from .meshes import Mesh
from .oracle import Questions, brute_force, found
from .wrapped import KINDS, PLACES, SCENES, answers, box_rays, first_part, make_mesh, wrong_answers

RAYS = 300_000  #: together

#: Without lamps and with them Mitsuba makes different shapes of a mesh; every tree is wrapped alike.
SPECS = {False: "normals", True: "kd"}


@check("C16", "no ray is lost between a scene and its tree")
def wrapper(plan: Plan) -> Iterator[Unit]:
    count = plan.count(-(-RAYS // (2 * len(PLACES) * len(KINDS))))
    for robust, text in SPECS.items():
        for place in PLACES:
            for kind in KINDS:
                yield Unit(
                    f"{kind} at {place}, Embree {'robust' if robust else 'fast'}",
                    text,
                    lambda k=kind, p=place, r=robust, s=text: _lost(plan, make_mesh(k, p), parse_spec(s), r, count),
                )


def _lost(plan: Plan, mesh: Mesh, spec: Spec, robust: bool, count: int) -> Outcome:
    o, d = box_rays(mesh, count, plan.rng("C16", mesh.name))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the sheet loses its rim to rounding, far out
        ends = np.full(count, np.inf, np.float32)
        expected = brute_force(mesh).closest(o, d, ends)
    asked = Questions(mesh, "box", plan.seed, o, d, ends, expected)
    through = "robust" if robust else "fast"
    given = answers(SCENES[through](mesh, spec), (o, d))
    wrong = wrong_answers(given, expected, first_part(through, mesh))
    hit = found(expected)
    outcome = Outcome(figures={"hits": int(hit.sum()), "lost": int((hit & ~np.isfinite(given[0])).sum())})
    sentence = "answers otherwise in a Mitsuba scene than brute force"

    def failure() -> Failure:
        return asked.failure(int(np.argmax(wrong)), spec.text, sentence, through=through)

    outcome.add("box", count, int(wrong.sum()), failure)
    return outcome
