"""Every check of `mitsuba-bsp verify`, at the counts that it has there."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_bsp.verification.check import Check, Plan, all_checks
from mitsuba_bsp.verification.runner import Listener, run
from mitsuba_bsp.verification.subjects import default_subjects, incumbents

CHECKS = [check for check in all_checks().values() if not check.nightly]


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return Plan(default_subjects(), incumbents(), folder=tmp_path_factory.mktemp("verify"))


@pytest.mark.parametrize("check", CHECKS, ids=[check.id for check in CHECKS])
def test_check(check: Check, plan: Plan) -> None:
    (result,) = run([check], plan, Listener())
    assert result.records
    assert result.failures == []
    assert result.passed


def test_caps_are_reached(plan: Plan) -> None:
    """Or C13 would show nothing: of each tree's five meshes two at least are held back by a cap."""
    (result,) = run([all_checks()["C13"]], plan, Listener())
    for row in result.records:
        if row["share"] == 1:
            capped = [name for name, value in row["figures"].items() if name.endswith("capped") and value]
            assert len(capped) >= 2, row["spec"]


def test_garbage_is_hit(tmp_path: Path) -> None:
    """Or N08 would show nothing."""
    plan = Plan(default_subjects()[:2], scale=0.001, folder=tmp_path)
    (result,) = run([all_checks()["N08"]], plan, Listener())
    assert result.passed and result.records
    for row in result.records:
        assert row["figures"]["hits"] > 500 and row["figures"]["dropped"] > 100
