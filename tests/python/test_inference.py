"""Ratios, tests between accelerators, and what is called noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import false_discovery_control, ttest_1samp, wilcoxon

from mitsuba_bsp.inference import Effect, adjusted, effect_of, effect_over_scenes, finding, noise_of, pooled_effect
from mitsuba_bsp.intervals import Interval

RATIOS = [0.5, 0.52, 0.49, 0.51, 0.53]


def effect(value: float, p: float = 0.001) -> Effect:
    return Effect(Interval(value, value, value), p)


def test_an_effect_is_a_median_with_a_test_on_logarithms() -> None:
    found = effect_of(RATIOS)
    assert found.ratio.value == 0.51 and found.ratio.low >= 0.49 and found.ratio.high <= 0.53
    assert found.p == pytest.approx(ttest_1samp(np.log(RATIOS), 0).pvalue)
    assert effect_of([]) is None


@pytest.mark.parametrize(
    ("ratios", "exact", "p"),
    [
        ([2.0], False, 1.0),  # one measurement tells nothing
        ([2.0], True, 0.0),  # one count tells all
        ([2.0, 2.0], True, 0.0),
        ([1.0, 1.0], True, 1.0),
        ([1.0, 1.0], False, 1.0),
    ],
)
def test_counts_without_spread_are_certain(ratios: list[float], exact: bool, p: float) -> None:
    assert effect_of(ratios, exact).p == p


def test_a_difference_that_chance_makes_is_not_believed() -> None:
    rng = np.random.default_rng(0)
    p = [effect_of(np.exp(rng.normal(0, 0.05, 6)).tolist()).p for _ in range(400)]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.03)


def test_pooled_ratios_have_a_rank_test() -> None:
    ratios = [0.8, 0.9, 0.95, 0.7, 1.05, 0.85, 0.97]
    assert pooled_effect(ratios).p == pytest.approx(wilcoxon(np.log(ratios)).pvalue)
    assert pooled_effect(ratios).ratio.value == 0.9
    assert pooled_effect([1.0, 1.0]).p == 1.0
    assert pooled_effect([]) is None


def test_probabilities_are_corrected_for_their_number() -> None:
    p = [0.001, 0.04, 0.03, 0.5]
    found = adjusted([effect(1, p[0]), None, *(effect(1, value) for value in p[1:])])
    assert found == [*false_discovery_control(p)[:1], 1.0, *false_discovery_control(p)[1:]]
    assert found[2] > 0.05 > p[1]
    assert adjusted([None]) == [1.0] and adjusted([]) == []


@pytest.mark.parametrize(
    ("ratio", "p", "word"),
    [(0.96, 0.001, "noise"), (1.049, 0.001, "noise"), (0.8, 0.2, "unclear"), (0.8, 0.01, "less"), (1.2, 0.01, "more")],
)
def test_findings(ratio: float, p: float, word: str) -> None:
    assert finding(effect(ratio), p, limit=0.05) == word


def test_counters_have_no_noise_and_are_alike() -> None:
    assert finding(effect(1.009), 0.001, limit=0.01, counted=True) == "alike"
    assert finding(effect(1.011), 0.001, limit=0.01, counted=True) == "more"


def test_effects_over_scenes_are_geometric_means() -> None:
    found = effect_over_scenes([0.5, 2.0, 0.8])
    assert found.ratio.value == pytest.approx(0.8 ** (1 / 3))
    assert 0.5 <= found.ratio.low < found.ratio.value < found.ratio.high <= 2
    assert found.p == pytest.approx(wilcoxon(np.log([0.5, 2.0, 0.8])).pvalue)
    assert effect_over_scenes([]) is None


def test_noise_is_what_two_runs_of_one_tree_differ_by() -> None:
    assert noise_of([[1.0, 1.1]]) == pytest.approx(0.1)
    assert noise_of([[2.0, 2.0, 2.0]]) == 0
    assert noise_of([[1.0], []]) is None
    rng = np.random.default_rng(1)
    runs = np.exp(rng.normal(0, 0.02, (50, 6)))
    assert noise_of(runs) == pytest.approx(1.96 * 0.02 * np.sqrt(2), rel=0.1)


def test_the_noise_of_medians_shrinks_with_repetitions() -> None:
    """The median of n normal numbers has 1.57 / n of their variance if n is large."""
    runs = np.exp(np.random.default_rng(1).normal(0, 0.02, (50, 6)))
    assert noise_of(runs, 101) == pytest.approx(1.96 * 0.02 * np.sqrt(2 * 1.57 / 101), rel=0.1)
    assert noise_of(runs, 1, 9) == pytest.approx(1.96 * 0.02 * np.sqrt(2 / 9), rel=0.1)
