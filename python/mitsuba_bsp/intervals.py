"""Medians with intervals of confidence, by the bootstrap."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    return _interval(np.median, values)


def geometric_mean_interval(values: Sequence[float]) -> Interval:
    """The geometric mean and its percentile-bootstrap interval."""
    return _interval(_geometric_mean, values)


def _geometric_mean(values: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    return np.exp(np.log(values).mean(axis=axis))


def mean_of_medians(samples: Sequence[Sequence[float]]) -> Interval:
    """The same for the geometric mean of the medians of measurements that were repeated on their own."""
    return _interval(_mean, *(sample if len(sample) > 1 else [*sample, *sample] for sample in samples))


def _mean(*samples: NDArray[np.float64], axis: int = -1) -> NDArray[np.float64]:
    return np.exp(sum(np.log(np.median(sample, axis=axis)) for sample in samples) / len(samples))


def _interval(statistic: Callable[..., NDArray[np.float64]], *samples: Sequence[float]) -> Interval:
    from scipy.stats import bootstrap

    data = tuple(np.asarray(sample, float) for sample in samples)
    value = float(statistic(*data))
    if min(map(len, data)) < 2:
        return Interval(value, value, value)
    found = bootstrap(
        data,
        statistic,
        n_resamples=_RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(_SEED),
    ).confidence_interval
    return Interval(value, float(found.low), float(found.high))
