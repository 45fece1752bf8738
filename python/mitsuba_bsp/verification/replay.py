"""Asks the rays of a case again: expected answers and those of every accelerator."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from ..accelerator import NO_TRIANGLE
from ..contenders import Triangles
from ..contenders import build as build_contender
from ..messages import choices
from ..spec import Spec, parse_spec
from .cases import Case, read_case
from .check import Subject
from .exact import ExactRay
from .judge import mt_erred
from .oracle import Answers, Questions, brute_force, build, differing, found
from .subjects import incumbents
from .wrapped import SCENES, answers, first_part, wrong_answers


def replay(file: Path, specs: Sequence[Spec], console: Console) -> int:
    """Print who answers what; returns how many answers break a promise. ValueError if the file is no case."""
    case = read_case(file)
    if case.through and case.through not in SCENES:
        raise ValueError(f'{file} is not a case: there is no scene "{case.through}" (valid: {choices(SCENES)})')
    if case.spec and all(spec.text != case.spec for spec in specs):
        specs = [parse_spec(case.spec), *specs]
    wrong = sum(_replay_ray(case, index, specs, console) for index in range(len(case.origins)))
    console.print(f"{wrong} answers are wrong", markup=False)
    return wrong


def _replay_ray(case: Case, index: int, specs: Sequence[Spec], console: Console) -> int:
    def show(text: str, style: str | None = None) -> None:
        console.print(text, markup=False, soft_wrap=True, style=style)

    one = slice(index, index + 1)
    rays = tuple(part[one] for part in case.rays)
    show(f"{case.describe(index)}: {case.why}")
    expected = {test: brute_force(case.mesh, test).closest(*rays) for test in ("woop", "mt")}
    for test, answer in expected.items():
        show(f"  expected with triangle_test={test}: {_text(answer)}")
    show(f"  exactly: {_exact_text(case, index)}")
    wrong = 0
    for spec in specs:
        tree, subject = build(case.mesh, spec), Subject(spec, 1)
        answer, right = tree.closest(*rays), expected[subject.triangle_test]
        asked = Questions(case.mesh, case.mesh.name, case.seed or 0, *rays, right)
        bad = bool(differing(answer, right)[0]) or bool(tree.any(*rays)[0]) != bool(found(right)[0])
        bad = bad and not (subject.triangle_test == "mt" and mt_erred(asked, 0))
        if case.hits is not None and subject.triangle_test == "woop":
            bad |= bool(found(answer)[0]) != case.hits[index]
        wrong += bad and subject.promises
        show(f"  {spec.text}: {_text(answer)}{' WRONG' if bad else ''}", "red" if bad else None)
    if case.through:
        spec = parse_spec(case.spec)
        given = answers(SCENES[case.through](case.mesh, spec), rays[:2])
        bad = bool(wrong_answers(given, expected["woop"], first_part(case.through, case.mesh))[0])
        wrong += bad and spec.is_exact
        t, triangle = float(given[0][0]), given[1][0]
        said = f"triangle {triangle} of its part, t={t.hex()}" if np.isfinite(t) else "nothing"
        show(f"  {spec.text} in a Mitsuba scene: {said}{' WRONG' if bad else ''}", "red" if bad else None)
    for spec in incumbents():
        tree = build_contender(spec, Triangles(((case.mesh.vertices, case.mesh.faces),))).tree
        t = float(tree.closest(*rays)[0])
        show(f"  {spec.text}: {f't={t.hex()}' if np.isfinite(t) else 'nothing'}")
    return wrong


def _exact_text(case: Case, index: int) -> str:
    o, d, maxt = (part[index] for part in case.rays)
    if not (np.isfinite(o).all() and np.isfinite(d).all() and d.any()):
        return "no ray"
    hit = ExactRay(o, d).closest(case.mesh, float(maxt))
    return f"triangle {hit.triangle}, t={float(hit.t).hex()}" if hit else "nothing"


def _text(answer: Answers) -> str:
    triangle = int(answer["triangle"][0])
    if triangle == NO_TRIANGLE:
        return "nothing"
    t, u, v = (float(answer[key][0]).hex() for key in ("t", "u", "v"))
    return f"triangle {triangle}, t={t} u={u} v={v}"
