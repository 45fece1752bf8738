"""Whether accelerators differ: ratios with intervals, tests corrected for their number, and the noise of a run."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .intervals import Interval, geometric_mean_interval, median_interval

#: A difference is believed if chance would produce one like it less often than this, all tests of its family together.
ALPHA = 0.05

#: Medians of runs of one tree differ by less than the noise in this share of cases.
NOISE_SHARE = 0.95

#: Times that differ by no more are always called noise, for this much machines do that are shared.
USUAL_NOISE = 0.05

_DRAWS, _SEED = 10_000, 0

Finding = Literal["less", "more", "noise", "alike", "unclear"]


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
    return Effect(median_interval(ratios), _signed_rank(ratios)) if ratios else None


def effect_over_scenes(ratios: Sequence[float]) -> Effect | None:
    """The geometric mean of ratios, one a scene, as far as these scenes tell it, and Wilcoxon's signed-rank test."""
    return Effect(geometric_mean_interval(ratios), _signed_rank(ratios)) if ratios else None


def _signed_rank(ratios: Sequence[float]) -> float:
    from scipy.stats import wilcoxon

    logs = np.log(ratios)
    return float(wilcoxon(logs).pvalue) if logs.any() else 1.0


def adjusted(effects: Sequence[Effect | None]) -> list[float]:
    """The probabilities of a family of tests, corrected for their number (Benjamini, Hochberg 1995); 1 for None."""
    from scipy.stats import false_discovery_control

    known = [effect.p for effect in effects if effect]
    corrected = iter(false_discovery_control(known) if known else ())
    return [float(next(corrected)) if effect else 1.0 for effect in effects]


def finding(effect: Effect, p: float, limit: float, counted: bool = False) -> Finding:
    """What an effect says, given its corrected probability and what it must exceed (0.05: ratios up to 1.05)."""
    if abs(np.log(effect.ratio.value)) <= np.log1p(limit):
        return "alike" if counted else "noise"
    if p >= ALPHA:
        return "unclear"
    return "less" if effect.ratio.value < 1 else "more"


def noise_of(repeated: Iterable[Sequence[float]], repeats: int = 1, pairs: int = 1) -> float | None:
    """By how much the medians of so many ratios of two runs of one and the same tree differ from 1 at most.

    In 95 of 100 cases, by drawing from the ratios of all pairs of such runs; None without any. Each sequence holds the
    times of one tree on one scene. With several `pairs` of trees, what differs is the geometric mean of their ratios.
    """
    gaps = [np.log(a / b) for times in repeated for a, b in itertools.permutations(times, 2)]
    if not gaps:
        return None
    drawn = np.random.default_rng(_SEED).choice(gaps, (_DRAWS, repeats, pairs)).mean(axis=2)
    return float(np.expm1(np.quantile(np.abs(np.median(drawn, axis=1)), NOISE_SHARE)))


def noise_limit(repeated: Iterable[Sequence[float]], repeats: int, pairs: int = 1) -> float:
    """What a difference of times must exceed: that noise, and what is usual."""
    return max(USUAL_NOISE, noise_of(repeated, repeats, pairs) or 0.0)


def _probability(logs: np.ndarray, exact: bool) -> float:
    if np.ptp(logs) == 0:
        certain = exact or len(logs) > 1
        return 0.0 if certain and logs[0] != 0 else 1.0
    from scipy.stats import ttest_1samp

    return float(ttest_1samp(logs, 0.0).pvalue)
