"""Nightly: at the extremes `precision=auto` loses nothing, and is as fast as the fastest mode that loses nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import geometric_mean

import numpy as np

from .. import _core
from ..spec import parse_spec, with_setting
from ..text_table import TextTable
from .check import Outcome, Plan, Record, Subject, Unit, check
from .checks_contests import extreme_meshes
from .contest import Contestant, family_rays, main_subjects
from .meshes import Mesh
from .oracle import brute_force, build, differing
from .rays import Rays
from .timing import least

RAYS, LEAST_RAYS = 25_000, 2_500  #: of all families, in each mesh; fewer could not be timed
TREES = ("kd", "normals")
AUTO, MODES = "auto", ("auto", "fast", "epsilon")
RATIO = "time of auto over fast"

#: The best of so many runs in turns counts.
RUNS = 7

#: So much slower than the fastest mode that loses nothing it may be, in the best of three tries.
SLOWER = 1.05


def tables(records: Sequence[Record]) -> list[TextTable]:
    """A row for each tree: over how many meshes a mode loses nothing, and what `auto` costs over `fast`."""
    rows = []
    for spec in dict.fromkeys(row["spec"] for row in records):
        own = [row["figures"] for row in records if row["spec"] == spec]
        clean = (f"{sum(figures[mode] == 0 for figures in own)} of {len(own)}" for mode in MODES)
        ratios = [figures[RATIO] for figures in own if RATIO in figures]
        times = (f"{geometric_mean(ratios):.2f}", f"{max(ratios):.2f}") if ratios else ("-", "-")
        rows.append((spec, *clean, *times))
    head = ("spec", *(f"{mode} loses nothing" for mode in MODES), RATIO, "at most")
    return [TextTable("Modes of precision at the extremes", head, tuple(rows))]


@check("N07p", "precision=auto loses nothing at the extremes, as fast as any mode that does", tables)
def cheapest_that_is_safe(plan: Plan) -> Iterator[Unit]:
    for subject in main_subjects(plan):
        if subject.spec.name in TREES:
            for mesh in extreme_meshes():
                yield Unit(
                    f"{mesh.name} under {subject.spec.text}",
                    subject.spec.text,
                    lambda m=mesh, s=subject: _compare(plan, m, s),
                )


def _compare(plan: Plan, mesh: Mesh, subject: Subject) -> Outcome:
    trees = {mode: build(mesh, parse_spec(with_setting(subject.spec.text, f"precision={mode}"))) for mode in MODES}
    rays = _rays(plan, mesh, Contestant(subject, trees[AUTO]))
    expected = brute_force(mesh).closest(*rays)
    wrong = {mode: int(differing(tree.closest(*rays), expected).sum()) for mode, tree in trees.items()}
    safe = [mode for mode in MODES if not wrong[mode]]
    times: dict[str, float] = {}

    def slower() -> float:
        times.update(_times(trees, rays))
        return times[AUTO] / min(times[mode] for mode in safe)

    outcome = Outcome(figures=dict(wrong))
    text = f"{subject.spec.text} with precision=auto, {mesh.name}"
    outcome.add("answers", len(rays[0]))
    outcome.expect("lost", AUTO in safe, f"{text}: {wrong[AUTO]} answers are not those of brute force")
    if AUTO in safe:
        ratio = least(slower, SLOWER)
        outcome.expect("time", ratio <= SLOWER, f"{text}: {ratio:.2f} times as long as a mode that loses nothing")
        outcome.figures[RATIO] = round(times[AUTO] / times["fast"], 3)
    return outcome


def _rays(plan: Plan, mesh: Mesh, contestant: Contestant) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of all families, without ends."""
    rng = plan.rng("N07p", mesh.name)
    parts: list[Rays] = [
        rays for _, rays in family_rays(mesh, max(LEAST_RAYS, plan.count(RAYS)), rng, [contestant], {})
    ]
    o, d = (np.ascontiguousarray(np.concatenate(arrays)) for arrays in zip(*parts, strict=True))
    return o, d, np.full(len(o), np.inf, np.float32)


def _times(trees: dict[str, _core.Accelerator], rays: tuple[np.ndarray, ...]) -> dict[str, float]:
    """Processor seconds, each the best of several that take turns."""
    runs = [{mode: tree.time(*rays, False)[0] for mode, tree in trees.items()} for _ in range(RUNS)]
    return {mode: min(run[mode] for run in runs) for mode in trees}
