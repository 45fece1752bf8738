"""Every check of `mitsuba-bsp verify`, at the counts that it has there."""

from __future__ import annotations

import pytest

from mitsuba_bsp.verification.check import Plan, all_checks
from mitsuba_bsp.verification.runner import run_unit
from mitsuba_bsp.verification.subjects import default_subjects, incumbents

CHECKS = [check for check in all_checks().values() if not check.nightly]


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return Plan(default_subjects(), incumbents(), folder=tmp_path_factory.mktemp("verify"))


@pytest.mark.parametrize("check", CHECKS, ids=[check.id for check in CHECKS])
def test_check(check: object, plan: Plan) -> None:
    outcomes = [run_unit(unit) for unit in check.units(plan)]
    assert outcomes
    broken = [failure.text for outcome in outcomes if not outcome.passed for failure in outcome.failures]
    assert broken == []
    assert all(outcome.passed for outcome in outcomes)
