"""Cells of tables of times: spread, and speed against the baselines."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import geometric_mean, median

from .intervals import mean_of_medians, median_interval
from .records import Record, of

NONE = "-"

#: Whom every accelerator is measured against.
BASELINES = ("native", "embree")


def spread(times: Sequence[float]) -> str:
    """Half the range, relative to the median."""
    return f"{(max(times) - min(times)) / 2 / median(times):.1%}"


def ratios(runs: Sequence[Record], rows: Sequence[Record], baseline: str, time: str) -> list[float]:
    """The baseline's `time` over this one's, repetition by repetition of those that both have.

    With settings of its own it is the baseline too, unless it is there without any.
    """
    names = dict.fromkeys(row["spec"] for row in rows if row["spec"].partition(":")[0] == baseline)
    text = baseline if baseline in names else next(iter(names), None)
    times = {row["repeat"]: row[time] for row in of(rows, spec=text)}
    return [times[run["repeat"]] / run[time] for run in runs if run["repeat"] in times]


def speed(found: Sequence[float]) -> str:
    """The median of ratios with its interval."""
    return str(median_interval(found)) if found else NONE


def mean_ratio(scenes: Sequence[Sequence[float]]) -> float | None:
    """The geometric mean of the medians of the scenes that have any; None if none has."""
    medians = [median(found) for found in scenes if found]
    return geometric_mean(medians) if medians else None


def mean_speed(scenes: Sequence[Sequence[float]]) -> str:
    """`mean_ratio` with its interval."""
    found = [scene for scene in scenes if scene]
    return str(mean_of_medians(found)) if found else NONE
