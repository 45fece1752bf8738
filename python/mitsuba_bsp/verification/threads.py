"""How many threads build and trace, and what threads of checks compute for one another."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from threading import RLock
from typing import ParamSpec, TypeVar

import drjit

P, T = ParamSpec("P"), TypeVar("T")


@contextmanager
def thread_count(count: int) -> Iterator[None]:
    """The pool that the core shares with Mitsuba has so many threads while it lives."""
    before = drjit.thread_count()
    drjit.set_thread_count(count)
    try:
        yield
    finally:
        drjit.set_thread_count(before)


def shared(size: int | None = None) -> Callable[[Callable[P, T]], Callable[P, T]]:
    """Keep the last `size` answers of the decorated function; what one thread computes, the others wait for."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        kept, lock = lru_cache(size)(function), RLock()

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            with lock:
                return kept(*args, **kwargs)

        return call

    return decorate
