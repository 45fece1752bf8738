"""The prices of the surface area heuristic, measured: what a step and a triangle test take on this machine.

Trees of many kinds and sizes answer the same rays with different numbers of steps and tests. The time of a ray is
fitted by c0 + axis * axis steps + oblique * oblique steps + test * triangle tests, all at least 0 (non-negative least
squares), by relative errors, or the slowest scene would decide. Each stream of each scene has its own c0, for rays that
follow one another, as camera rays do, are cheaper whatever the tree: with one c0 a scene half of the variance stays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from .intervals import CONFIDENCE, Interval
from .prices import PLANES_PER_STEP
from .records import Record
from .text_table import TextTable

#: Trees that trade the three kinds of work for one another.
SPECS = (
    "kd",
    "kd:leaf_size=8",
    "kd:intersection_cost=0.05",
    "kd:intersection_cost=1",
    "kd:intersection_cost=4",
    "normals:alpha=0",
    "normals",
    "normals:k=12,alpha=0",
    "normals:k=4,alpha=0.5",
    "normals:intersection_cost=1,alpha=0",
    "normals:axes=none,alpha=0",
    "normals:leaf_size=8,alpha=0",
    "random:alpha=0",
    "random:axes=none,alpha=0",
    "random:axes=none,alpha=0,intersection_cost=1",
)

#: What is priced: the counters, and for each layout the settings that make up the prices.
SETTINGS = {
    "wide": {
        "axis_steps": "node_cost + 3 axis_cost",
        "oblique_steps": "node_cost + 3 oblique_cost",
        "triangle_tests": "intersection_cost",
    },
    "binary": {
        "axis_steps": "axis_cost",
        "oblique_steps": "oblique_cost",
        "triangle_tests": "intersection_cost",
    },
}
PRICES = tuple(SETTINGS["wide"])

LEGEND = (
    "Nanoseconds of processor time, fitted by non-negative least squares to the relative errors of every tree and "
    "stream of rays, with 95 % intervals from resampling the trees. The settings are the same prices, a plane of a "
    "node of axis-aligned planes being 1; a ray's way through a wide node passes three. c0 is what a ray of a stream "
    "takes besides."
)

_RESAMPLES, _SEED = 500, 0


@dataclass(frozen=True)
class Measurements:
    """One row a stream and tree: their numbers, counters per ray in the order of PRICES, ns.

    `streams` are named by scene and kind of ray; trees of different scenes have different numbers.
    """

    streams: tuple[str, ...]
    stream: NDArray[np.intp]
    tree: NDArray[np.intp]
    counters: NDArray[np.float64]
    ns: NDArray[np.float64]


@dataclass(frozen=True)
class Fit:
    """Prices in ns and as sums of settings, by counter; c0 of every stream; the share of variance explained."""

    layout: str
    prices: Mapping[str, Interval]
    settings: Mapping[str, Interval]
    constants: Mapping[str, float]
    r_squared: float
    rows: int


def measurements(records: Sequence[Record]) -> Measurements:
    """What replayed rays say about prices: the median time of each scene, tree and stream."""
    groups: dict[tuple[str, str, str], list[Record]] = {}
    for row in records:
        groups.setdefault((str(row["scene"]), str(row["spec"]), str(row["stream"])), []).append(row)
    streams = tuple(dict.fromkeys(f"{scene}, {stream}" for scene, _, stream in groups))
    trees = list(dict.fromkeys((scene, spec) for scene, spec, _ in groups))
    return Measurements(
        streams,
        np.array([streams.index(f"{scene}, {stream}") for scene, _, stream in groups]),
        np.array([trees.index((scene, spec)) for scene, spec, _ in groups]),
        np.array([[rows[0]["counters"][key] / rows[0]["rays"] for key in PRICES] for rows in groups.values()]),
        np.array([median(row["ns_per_ray"] for row in rows) for rows in groups.values()]),
    )


def fit(data: Measurements, layout: str) -> Fit:
    """The prices, with intervals from resampling the trees (each with all its streams).

    ValueError if the trees leave one of the prices open.
    """
    unseen = [key for key, column in zip(PRICES, data.counters.T, strict=True) if np.ptp(column) == 0]
    if unseen:
        raise ValueError(f"no price can be fitted to {unseen[0]}: all trees have the same number of them")
    best = _solve(data, np.arange(len(data.ns)))
    generator = np.random.default_rng(_SEED)
    rows_of = [np.flatnonzero(data.tree == tree) for tree in range(data.tree.max() + 1)]
    resampled = np.array(
        [
            _solve(data, np.concatenate([rows_of[i] for i in generator.integers(len(rows_of), size=len(rows_of))]))
            for _ in range(_RESAMPLES)
        ]
    )[:, : len(PRICES)]
    residuals = data.ns - _design(data) @ best
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = PLANES_PER_STEP[layout]
        relative = unit * best[: len(PRICES)] / best[0]
        relative_resampled = unit * resampled / resampled[:, :1]
    return Fit(
        layout,
        dict(zip(PRICES, map(_interval, best, resampled.T), strict=False)),
        dict(zip(PRICES, map(_interval, relative, relative_resampled.T), strict=True)),
        dict(zip(data.streams, best[len(PRICES) :], strict=True)),
        1 - residuals @ residuals / ((data.ns - data.ns.mean()) ** 2).sum(),
        len(data.ns),
    )


def calibration_tables(found: Fit) -> list[TextTable]:
    """The prices, and the constants of the streams."""
    prices = [
        (key.replace("_", " ").removesuffix("s"), str(found.prices[key]), setting, str(found.settings[key]))
        for key, setting in SETTINGS[found.layout].items()
    ]
    return [
        TextTable(
            f"{found.rows} trees and streams, R² = {found.r_squared:.3f}",
            ("work", "ns", "setting", "value"),
            tuple(prices),
        ),
        TextTable(
            "c0 of each stream",
            ("stream", "ns"),
            tuple((stream, f"{ns:.1f}") for stream, ns in found.constants.items()),
        ),
    ]


def _design(data: Measurements) -> NDArray[np.float64]:
    return np.hstack([data.counters, np.eye(len(data.streams))[data.stream]])


def _solve(data: Measurements, rows: NDArray[np.intp]) -> NDArray[np.float64]:
    from scipy.optimize import nnls

    return nnls(_design(data)[rows] / data.ns[rows, None], np.ones(len(rows)))[0]


def _interval(value: float, resampled: NDArray[np.float64]) -> Interval:
    bounds = [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2]
    low, high = np.nanquantile(resampled, bounds, method="inverted_cdf")  # which takes infinite ratios
    return Interval(float(value), float(low), float(high))
