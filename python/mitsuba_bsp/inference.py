"""Whether accelerators differ: ratios with intervals, tests corrected for their number, and the noise of a run."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .intervals import Interval, median_interval

#: A difference is believed if chance would produce one like it less often than this, all tests of its family together.
ALPHA = 0.05

#: Two runs of one tree differ by less than the noise in this share of cases.
NOISE_SHARE = 0.95

Finding = Literal["less", "more", "noise", "unclear"]


@dataclass(frozen=True)
class Effect:
    """A quantity of one accelerator over that of another: the median ratio, and how probable it is by chance."""

    ratio: Interval
    p: float


def effect_of(ratios: Sequence[float], exact: bool = False) -> Effect | None:
    """What ratios from one scene say, one a repetition; None if there are none.

    The test is Student's, on their logarithms. `exact`: they are of counts and not of measurements, so that a
    difference without any spread is certain.
    """
    return Effect(median_interval(ratios), _probability(np.log(ratios), exact)) if ratios else None


def pooled_effect(ratios: Sequence[float]) -> Effect | None:
    """The median of ratios from several scenes, and Wilcoxon's signed-rank test; None if there are none."""
    if not ratios:
        return None
    from scipy.stats import wilcoxon

    logs = np.log(ratios)
    return Effect(median_interval(ratios), float(wilcoxon(logs).pvalue) if logs.any() else 1.0)


def adjusted(effects: Sequence[Effect | None]) -> list[float]:
    """The probabilities of a family of tests, corrected for their number (Benjamini, Hochberg 1995); 1 for None."""
    from scipy.stats import false_discovery_control

    known = [effect.p for effect in effects if effect]
    corrected = iter(false_discovery_control(known) if known else ())
    return [float(next(corrected)) if effect else 1.0 for effect in effects]


def finding(effect: Effect, p: float, noise: float) -> Finding:
    """What an effect says, given its corrected probability and the noise of the run (0.05: ratios up to 1.05)."""
    if abs(np.log(effect.ratio.value)) <= np.log1p(noise):
        return "noise"
    if p >= ALPHA:
        return "unclear"
    return "less" if effect.ratio.value < 1 else "more"


def noise_of(repeated: Iterable[Sequence[float]]) -> float | None:
    """By how much two runs of one and the same tree differ at most, in 95 of 100 cases; None without any such runs.

    Each sequence holds the times of one tree on one scene.
    """
    gaps = [abs(np.log(a / b)) for times in repeated for a, b in itertools.combinations(times, 2)]
    return float(np.expm1(np.quantile(gaps, NOISE_SHARE))) if gaps else None


def _probability(logs: np.ndarray, exact: bool) -> float:
    if np.ptp(logs) == 0:
        certain = exact or len(logs) > 1
        return 0.0 if certain and logs[0] != 0 else 1.0
    from scipy.stats import ttest_1samp

    return float(ttest_1samp(logs, 0.0).pvalue)
