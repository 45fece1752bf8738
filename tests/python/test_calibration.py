"""Fitting prices: known constants come back, from clean and from noisy times, and nothing is made up."""

from __future__ import annotations

import numpy as np
import pytest

from mitsuba_bsp.calibration import SPECS, Measurements, calibration_tables, fit, measurements
from mitsuba_bsp.intervals import mean_of_medians, median_interval
from mitsuba_bsp.spec import parse_spec

PRICES = np.array([5.0, 7.0, 1.5])
CONSTANTS = np.array([30.0, 80.0])


def synthetic(noise: float = 0.0, prices: np.ndarray = PRICES) -> Measurements:
    """Two streams of different scenes, twenty trees each, three measurements a tree."""
    rng = np.random.default_rng(0)
    tree = np.repeat(np.arange(40), 3)
    stream = tree // 20
    counters = rng.uniform(1, 60, (120, 3))
    ns = (counters @ prices + CONSTANTS[stream]) * (1 + noise * rng.standard_normal(120))
    return Measurements(("one", "two"), stream, tree, counters, ns)


def test_clean_times_give_the_constants_back() -> None:
    found = fit(synthetic(), "binary")
    assert [price.value for price in found.prices.values()] == pytest.approx(PRICES)
    assert [s.value for s in found.settings.values()] == pytest.approx(PRICES / PRICES[0])
    assert list(found.constants.values()) == pytest.approx(CONSTANTS)
    assert found.r_squared == pytest.approx(1)
    assert all(price.high - price.low < 1e-6 for price in found.prices.values())


def test_a_wide_node_has_three_planes() -> None:
    found = fit(synthetic(), "wide")
    assert [s.value for s in found.settings.values()] == pytest.approx(3 * PRICES / PRICES[0])


def test_noisy_times_give_intervals_that_hold_them() -> None:
    found = fit(synthetic(noise=0.05), "binary")
    for price, true in zip(found.prices.values(), PRICES, strict=True):
        assert price.low < true < price.high
        assert price.high - price.low < 2
    assert 0.9 < found.r_squared < 1


def test_no_price_is_negative() -> None:
    found = fit(synthetic(prices=np.array([5.0, 7.0, -0.2])), "binary")
    assert found.prices["triangle_tests"].value == 0


def test_a_counter_that_never_changes_has_no_price() -> None:
    data = synthetic()
    data.counters[:, 1] = 0
    with pytest.raises(ValueError, match="no price can be fitted to oblique_steps"):
        fit(data, "binary")


def test_measurements_are_medians_of_each_tree_and_stream() -> None:
    counters = {"axis_steps": 20, "oblique_steps": 4, "leaves_visited": 9, "triangle_tests": 30}
    rows = [
        {"scene": "a", "spec": spec, "stream": "camera", "rays": 2, "counters": counters, "ns_per_ray": ns}
        for spec, times in (("kd", (1, 5, 2)), ("normals", (4, 4, 9)))
        for ns in times
    ]
    data = measurements(rows)
    assert data.streams == ("a, camera",) and list(data.tree) == [0, 1] and list(data.ns) == [2, 4]
    assert data.counters.tolist() == [[10, 2, 15]] * 2


def test_the_table_names_the_settings() -> None:
    prices, constants = calibration_tables(fit(synthetic(), "binary"))
    assert [row[2] for row in prices.rows] == ["axis_cost", "oblique_cost", "intersection_cost"]
    assert calibration_tables(fit(synthetic(), "wide"))[0].rows[0][2] == "node_cost + 3 axis_cost"
    assert prices.rows[1][3].startswith("1.40 ") and "1.000" in prices.title
    assert constants.rows == (("one", "30.0"), ("two", "80.0"))


def test_the_trees_are_valid_and_all_different() -> None:
    assert len({parse_spec(text).full for text in SPECS}) == len(SPECS)


def test_median_interval() -> None:
    found = median_interval([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 70.0])
    assert found.value == 4 and 1 <= found.low < 4 < found.high <= 70
    assert str(median_interval([2.0])) == "2.00 [2.00, 2.00]"


def test_a_mean_of_medians_is_as_uncertain_as_its_parts() -> None:
    sure, unsure = [4.0, 4.0, 4.0], [0.5, 1.0, 1.0, 1.0, 2.0]
    found = mean_of_medians([sure, unsure])
    assert found.value == pytest.approx(2) and found.low == pytest.approx(2 / 2**0.5) and found.high < 2 * 2**0.5 + 1e-9
    assert str(mean_of_medians([sure, sure])) == "4.00 [4.00, 4.00]"
