"""Every ray that an accelerator is known to have answered wrongly, here or elsewhere, asked again."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .cases import permanent_cases
from .check import Failure, Outcome, Plan, Subject, Unit, check, subject_units
from .judge import enter
from .oracle import Questions, brute_force, build, differing, found


@check("cases", "rays that were answered wrongly once", at_once=True)
def known_cases(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _ask_again)


def _ask_again(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    for name, case in permanent_cases().items():
        tree = build(case.mesh, subject.spec)
        expected = brute_force(case.mesh, subject.triangle_test).closest(*case.rays)
        asked = Questions(case.mesh, name, plan.seed, *case.rays, expected)
        answers = tree.closest(*asked.rays)
        wrong = differing(answers, expected) | (tree.any(*asked.rays).astype(bool) != found(expected))
        enter(outcome, subject, asked, wrong, "answers something else than brute force")
        if case.hits is not None and subject.triangle_test == "woop":
            false = found(answers) != np.array(case.hits)
            text = f"{subject.spec.text}, {name}: rays {np.flatnonzero(false).tolist()} are wrong about hit or miss"
            outcome.add(
                f"{name}, exactly", 0, int(false.sum()), lambda case=case, text=text: Failure(text, case.to_json())
            )
    return outcome
