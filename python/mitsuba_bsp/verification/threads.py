"""How many threads build and trace, and what threads of checks compute for one another."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from functools import wraps
from threading import Lock
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
    """Keep the last `size` answers of the decorated function; while one thread computes one, others wait for it."""

    def decorate(function: Callable[P, T]) -> Callable[P, T]:
        kept: dict[Hashable, Future[T]] = {}
        lock = Lock()

        @wraps(function)
        def call(*args: P.args, **kwargs: P.kwargs) -> T:
            key = args, tuple(kwargs.items())
            with lock:
                is_new = key not in kept
                answer = kept.setdefault(key, Future())
                if size and len(kept) > size:
                    del kept[next(iter(kept))]
            if is_new:
                try:
                    answer.set_result(function(*args, **kwargs))
                except BaseException as error:
                    answer.set_exception(error)
            return answer.result()

        return call

    return decorate
