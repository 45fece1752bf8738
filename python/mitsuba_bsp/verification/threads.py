"""How many threads build and trace."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import drjit


@contextmanager
def thread_count(count: int) -> Iterator[None]:
    """The pool that the core shares with Mitsuba has so many threads while it lives."""
    before = drjit.thread_count()
    drjit.set_thread_count(count)
    try:
        yield
    finally:
        drjit.set_thread_count(before)
