"""How far the triangle test is off: the answers of brute force held against exact arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from ..text_table import TextTable
from .check import Outcome, Record
from .exact import ExactRay
from .oracle import Questions, found

MISSES, HITS, OTHERS = "false misses", "false hits", "other triangles"
ERROR, OF_REACH = "t off by ulp", "t off by ulp of the reach"
RAYS = "rays in exact arithmetic"

ULP = 2.0**-24  #: of what is 1 or a little less


@dataclass
class Exactness:
    """Which rays hit nothing though they should, how many hit for nothing or another triangle, and the largest error.

    The error is that of t where the line does meet the triangle that was found: in units in the last place of t, which
    are tiny where t is; and in those of the reach, which is the t of the farthest corner of the mesh.
    """

    missed: list[int] = field(default_factory=list)
    hits: int = 0
    others: int = 0
    error: float = 0.0
    of_reach: float = 0.0


def against_exact(asked: Questions) -> Exactness:
    """Decide every ray again; `asked` has the answers that are judged, and rays without ends."""
    exactness = Exactness()
    answers = asked.expected
    for index, hit in enumerate(found(answers).tolist()):
        ray = ExactRay(asked.origins[index], asked.directions[index])
        exact = ray.closest(asked.mesh)
        if not hit:
            exactness.missed += [index] if exact is not None else []
            continue
        triangle, t = int(answers["triangle"][index]), answers["t"][index]
        exactness.hits += exact is None
        exactness.others += exact is not None and exact.triangle != triangle and exact.t != Fraction(float(t))
        own = ray.hit(asked.mesh.vertices[asked.mesh.faces[triangle]])
        if own is not None and t > 0:
            error = abs(float(own - Fraction(float(t))))
            exactness.error = max(exactness.error, round(error / float(np.spacing(t)), 2))
            exactness.of_reach = max(exactness.of_reach, round(error / (ULP * _reach(asked, index)), 2))
    return exactness


def _reach(asked: Questions, index: int) -> float:
    """How far the farthest corner is from the origin along one axis, over the longest component of the direction."""
    o, d = asked.origins[index].astype(float), asked.directions[index].astype(float)
    return float(np.abs(asked.mesh.vertices.astype(float) - o).max() / np.abs(d).max())


def publish(outcome: Outcome, asked: Questions, found: Exactness) -> None:
    """Add what was found of one family to the figures of its mesh."""
    old = outcome.figures
    for key, value in {RAYS: len(asked), MISSES: len(found.missed), HITS: found.hits, OTHERS: found.others}.items():
        old[key] = old.get(key, 0) + value
    for key, value in {ERROR: found.error, OF_REACH: found.of_reach}.items():
        old[key] = max(old.get(key, 0.0), value)


def exactness_tables(title: str, name: Callable[[str], str] = str) -> Callable[[Sequence[Record]], list[TextTable]]:
    """A row for each unit that published figures; `name` makes its name of the unit's."""

    def tables(records: Sequence[Record]) -> list[TextTable]:
        head = ("mesh", "rays", MISSES, HITS, OTHERS, ERROR, OF_REACH)
        rows = [_row(name(row["unit"]), row["figures"]) for row in records if RAYS in row["figures"]]
        return [TextTable(title, head, tuple(rows))]

    return tables


def _row(name: str, figures: Record) -> tuple[str, ...]:
    counts = (f"{figures[key]:,}" for key in (RAYS, MISSES, HITS, OTHERS))
    return name, *counts, f"{figures[ERROR]:.3g}", f"{figures[OF_REACH]:.3g}"
