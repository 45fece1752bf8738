"""Nightly: no tree has become slower than it was on an earlier night into the same folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from statistics import median

import numpy as np

from ..contenders import Contender, Triangles, build
from ..machine import describe
from ..records import ResultsFolder
from ..spec import parse_spec
from ..text_table import TextTable
from .check import Failure, Outcome, Plan, Record, Subject, Unit, check
from .contest import main_subjects
from .meshes import Mesh, large_mesh, soup
from .rays import FAMILIES, Rays

BASELINE = "native"
RUNS = 9  #: of each, in turns
RAYS = 150_000  #: of each family, in each run
ASKED = ("camera", "random", "spawned")

#: A tree is slower if it is by more than this, in each of so many measurements.
SLOWER, TRIES = 0.05, 3

MESHES: dict[str, Callable[[], Mesh]] = {
    "bumpy sphere": large_mesh,
    "soup": lambda: soup("soup", 100_000, edge=0.02),
}


def tables(records: Sequence[Record]) -> list[TextTable]:
    """A row for each tree."""
    head = ("spec", *(f"{name}: {what}" for name in MESHES for what in ("speed", "best before")))
    rows = (
        (row["spec"], *(_cell(row["figures"].get(key)) for name in MESHES for key in (name, _before(name))))
        for row in records
    )
    return [TextTable(f"Rays per second on one thread, {BASELINE} = 1", head, tuple(rows))]


def _before(name: str) -> str:
    return f"{name}, best before"


def _cell(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


@check("N13", "no tree is slower than on earlier nights", tables)
def speeds(plan: Plan) -> Iterator[Unit]:
    for subject in main_subjects(plan):
        yield Unit(subject.spec.text, subject.spec.text, lambda s=subject: _unit(plan, s))


def _unit(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(what="runs")
    for name in MESHES:
        before = _best(plan, subject, name)
        allowed = (1 - SLOWER) * before
        found = 0.0
        for _ in range(TRIES):
            found = max(found, _speed(plan, subject, name))
            outcome.tried += RUNS
            if found >= allowed:
                break
        text = f"{subject.spec.text}, {name}: {found:.2f} times as fast as {BASELINE}, it was {before:.2f}"
        outcome.add(name, 0, int(found < allowed), lambda text=text: Failure(text))
        outcome.figures[name] = round(found, 4)
        if before:
            outcome.figures[_before(name)] = before
    return outcome


def _best(plan: Plan, subject: Subject, name: str) -> float:
    """The best that earlier runs on this machine measured at this scale; 0 if there is none."""
    rows = ResultsFolder(plan.folder).records() if plan.folder else []
    return max(
        (
            row["figures"].get(name, 0.0)
            for row in rows
            if row["check"] == "N13"
            and (row["spec_full"], row["scale"], row["cpu"]) == (subject.spec.full, plan.scale, describe()["cpu"])
        ),
        default=0.0,
    )


def _speed(plan: Plan, subject: Subject, name: str) -> float:
    """The median over pairs of runs, one of the tree and one of the baseline, of how much sooner the tree is done."""
    rays = _rays(name, plan.count(RAYS))
    pair = _contender(name, BASELINE), _contender(name, subject.spec.text)
    return median(_seconds(pair[0], rays) / _seconds(pair[1], rays) for _ in range(RUNS))


def _seconds(contender: Contender, rays: Rays) -> float:
    """Processor time."""
    return contender.tree.time(*rays, np.full(len(rays[0]), np.inf, np.float32), False)[0]


@lru_cache(maxsize=2 * len(MESHES))
def _contender(name: str, spec: str) -> Contender:
    mesh = _mesh(name)
    return build(parse_spec(spec), Triangles(((mesh.vertices, mesh.faces),)))


@lru_cache
def _mesh(name: str) -> Mesh:
    return MESHES[name]()


@lru_cache
def _rays(name: str, count: int) -> Rays:
    """The same every night, whatever the seed."""
    parts = [FAMILIES[family](_mesh(name), count, np.random.default_rng(13)) for family in ASKED]
    o, d = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return o, d
