"""Meshes that break builders and rays that break traversals: no crash, no delay, and still the right answers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..accelerator import NO_TRIANGLE
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .judge import enter
from .meshes import Mesh
from .oracle import Answers, Questions, brute_force, build, differing, found
from .rays import FAMILIES, in_turns
from .timing import least, timed
from .zoo import has_area, zoo

RAYS = 1_000
FAMILIES_USED = ("random", "vertex", "edge", "grazing", "axis")

#: A build and its rays may take so long, in the best of three tries.
LIMIT_S = 0.1


@check("C08", "degenerate meshes")
def degenerate_meshes(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _visit_zoo)


def _visit_zoo(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    slowest = 0.0
    for mesh in zoo():
        asked = _questions(mesh, plan.count(RAYS), plan.seed, subject.triangle_test)
        asked = asked.head(plan.count(RAYS, subject))
        seconds, (tree, answers) = timed(lambda m=mesh, a=asked: _build_and_ask(m, subject, a), LIMIT_S)
        slowest = max(slowest, seconds)
        wrong = differing(answers, asked.expected)
        for key in ("t", "u", "v"):
            wrong |= np.isnan(answers[key])
        enter(outcome, subject, asked, wrong, "answers something else than brute force over the valid triangles")
        dropped = json.loads(tree.statistics())["dropped_triangles"]
        expected = int((~has_area(mesh)).sum())
        outcome.expect("dropped", dropped == expected, f"{mesh.name}: {dropped} dropped, but {expected} are invalid")
        outcome.expect("time", seconds <= LIMIT_S, f"{subject.spec.text}, {mesh.name}: {seconds:.3f} s")
    outcome.figures["slowest_s"] = round(slowest, 4)
    return outcome


def _build_and_ask(mesh: Mesh, subject: Subject, asked: Questions) -> tuple[_core.Accelerator, Answers]:
    tree = build(mesh, subject.spec)
    return tree, tree.closest(*asked.rays)


@cache
def _questions(mesh: Mesh, count: int, seed: int, triangle_test: str) -> Questions:
    """Rays in the finite part of a mesh; the answers are those of brute force over its valid triangles alone."""
    valid = np.flatnonzero(has_area(mesh))
    usable = Mesh(mesh.name, np.nan_to_num(mesh.vertices, nan=0, posinf=0, neginf=0), mesh.faces[valid])
    rng = np.random.default_rng([seed, *mesh.name.encode()])
    aims = (
        usable if len(valid) else Mesh("point", np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.uint32([[0, 1, 2]]))
    )
    parts = [FAMILIES[family](aims, count, rng) for family in FAMILIES_USED]
    o, d = in_turns(parts, count)
    maxt = np.full(len(o), np.inf, np.float32)
    answers = dict(brute_force(usable, triangle_test).closest(o, d, maxt))
    hit = answers["triangle"] != NO_TRIANGLE
    answers["triangle"] = answers["triangle"].copy()
    answers["triangle"][hit] = valid[answers["triangle"][hit]]
    return Questions(mesh, "zoo", seed, o, d, maxt, answers)


#: What an invalid ray may cost, relative to a valid one: the rule of Embree's own tests.
TIME_RATIO = 2.5
TIMINGS = 10

Bad = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]


@check("C09", "rays that are not finite, too short or too long")
def bad_rays(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _fire_bad_rays)


def _fire_bad_rays(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    mesh = next(mesh for mesh in zoo() if mesh.name == "soup")
    tree = build(mesh, subject.spec)
    count = plan.count(RAYS, subject)
    good = _good_rays(mesh, plan.count(RAYS), plan.seed)
    worst, worst_kind = 0.0, ""
    for kind, rays in _bad_rays(good, plan.seed).items():
        o, d, maxt = (part[:count] for part in rays)
        answers = brute_force(mesh, subject.triangle_test).closest(o, d, maxt)
        asked = Questions(mesh, kind, plan.seed, o, d, maxt, answers)
        mine = tree.closest(*asked.rays)
        wrong = differing(mine, answers) | (tree.any(*asked.rays).astype(bool) != found(answers))
        usable = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & d.any(axis=1) & ~(maxt < 0)
        wrong |= found(mine) & ~(usable & ~np.isnan(maxt))
        for key in ("t", "u", "v"):
            wrong |= np.isnan(mine[key])
        enter(outcome, subject, asked, wrong, f"answers wrongly ({kind})")
        # All of them, that there is something to time.
        ratio = least(lambda r=rays: _time_ratio(tree, r, good), TIME_RATIO, tries=5)
        worst, worst_kind = max((worst, worst_kind), (ratio, kind))
        sentence = f"{subject.spec.text}: {kind} rays take {ratio:.2f} times as long as valid ones"
        outcome.expect("time", ratio <= TIME_RATIO, sentence)
    outcome.figures |= {"slowest": f"{worst:.2f} ({worst_kind})"}
    return outcome


def _time_ratio(tree: object, bad: Bad, good: Bad) -> float:
    """Processor times, each the best of several that take turns."""
    times = [(tree.time(*bad, False)[0], tree.time(*good, False)[0]) for _ in range(TIMINGS)]
    slow, usual = (min(values) for values in zip(*times, strict=True))
    return slow / usual


@cache
def _good_rays(mesh: Mesh, count: int, seed: int) -> Bad:
    o, d = FAMILIES["random"](mesh, count, np.random.default_rng(seed))
    return o, d, np.full(len(o), np.inf, np.float32)


def _bad_rays(good: Bad, seed: int) -> dict[str, Bad]:
    """Fourteen kinds; where one component is bad, it is each of the three in turn."""
    rng = np.random.default_rng([seed, 9])
    nan, inf = np.float32(np.nan), np.float32(np.inf)
    slot = rng.integers(3, size=len(good[0]))

    def with_(part: int, value: np.float32, everywhere: bool = False) -> Bad:
        changed = [array.copy() for array in good]
        if part == 2 or everywhere:
            changed[part][:] = value
        else:
            changed[part][np.arange(len(slot)), slot] = value
        return changed[0], changed[1], changed[2]

    denormal = (good[0], (good[1] * np.float32(1e-41)).astype(np.float32), good[2])
    long = (good[0], (good[1] * np.float32(1e30)).astype(np.float32), good[2])
    far = ((good[0] * np.float32(1e30)).astype(np.float32), good[1], good[2])
    return {
        "o NaN": with_(0, nan),
        "o infinite": with_(0, inf),
        "o -infinite": with_(0, -inf),
        "d NaN": with_(1, nan),
        "d infinite": with_(1, inf),
        "d -infinite": with_(1, -inf),
        "maxt NaN": with_(2, nan),
        "maxt -infinite": with_(2, -inf),
        "maxt -1": with_(2, np.float32(-1)),
        "all NaN": (with_(0, nan, True)[0], with_(1, nan, True)[1], with_(2, nan)[2]),
        "d zero": with_(1, np.float32(0), True),
        "d denormal": denormal,
        "d 1e30": long,
        "o 1e30": far,
    }
