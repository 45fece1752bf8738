"""Medians with intervals of confidence, by the bootstrap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

CONFIDENCE = 0.95

_RESAMPLES, _SEED = 2000, 0


@dataclass(frozen=True)
class Interval:
    """An estimate, and where its true value is to be expected."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]"


def median_interval(values: Sequence[float]) -> Interval:
    """The median and its percentile-bootstrap interval."""
    from scipy.stats import bootstrap

    if len(values) < 2:
        return Interval(values[0], values[0], values[0])
    found = bootstrap(
        (np.asarray(values),),
        np.median,
        n_resamples=_RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(_SEED),
    ).confidence_interval
    return Interval(float(np.median(values)), float(found.low), float(found.high))
