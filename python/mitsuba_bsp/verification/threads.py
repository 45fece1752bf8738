"""What threads of checks compute for one another."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from concurrent.futures import Future
from functools import wraps
from threading import Lock
from typing import ParamSpec, TypeVar

P, T = ParamSpec("P"), TypeVar("T")


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
                    kept.pop(key, None)  # whoever comes later tries again
                    answer.set_exception(error)
            return answer.result()

        return call

    return decorate
