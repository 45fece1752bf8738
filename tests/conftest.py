"""In continuous integration a skipped plugin test is a failure: it means that the plugin was not tested."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

PLUGIN_TESTS = Path(__file__).parent / "plugin"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    report = yield
    if report.skipped and os.environ.get("BSP_CI") and PLUGIN_TESTS in item.path.parents:
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid} was skipped, which is not allowed here: {report.longrepr}"
    return report
