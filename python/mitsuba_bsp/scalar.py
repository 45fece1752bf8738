"""Mitsuba in a variant that our plugins support, for what runs without a scene file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import mitsuba as mi

VARIANT = "scalar_rgb"


def mitsuba() -> ModuleType:
    """Mitsuba, set to a scalar variant unless it is in one."""
    if not (mi.variant() or "").startswith("scalar"):
        mi.set_variant(VARIANT)
    return mi


@contextmanager
def active_variant(name: str) -> Iterator[None]:
    """Mitsuba is in the variant while it lives."""
    before = mi.variant()
    mi.set_variant(name)
    try:
        yield
    finally:
        if before:
            mi.set_variant(before)
