"""Limits on time, on a machine that may be busy with something else."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

from ..machine import available_threads

T = TypeVar("T")


def least(measure: Callable[[], float], limit: float, tries: int = 3) -> float:
    """What `measure` finds; above the limit it is asked again, and the least counts."""
    found = measure()
    for _ in range(tries - 1):
        if found > limit:
            found = min(found, measure())
    return found


def timed(work: Callable[[], T], limit: float) -> tuple[float, T]:
    """Seconds of `work`, the least of a few tries if they are above the limit, and what it returns.

    They are those on the clock or, if that is less, processor time shared evenly among the processors: other processes
    lengthen the first, not the second.
    """
    results: list[T] = []

    def measure() -> float:
        start, busy_start = time.perf_counter(), time.process_time()
        results[:] = [work()]
        seconds, busy = time.perf_counter() - start, time.process_time() - busy_start
        return min(seconds, busy / available_threads())

    return least(measure, limit), results[0]
