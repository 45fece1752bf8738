"""Every test of the plugins starts in the variant that most of them use."""

from __future__ import annotations

from collections.abc import Iterator

import mitsuba as mi
import pytest


@pytest.fixture(autouse=True)
def _variant() -> Iterator[None]:
    mi.set_variant("scalar_rgb")
    level = mi.log_level()
    yield
    mi.set_log_level(level)
