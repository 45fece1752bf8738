"""Run existing tests, or any code, with every scene under an accelerator.

`swapped(SPEC)` makes `mitsuba.load_dict`, `load_file` and `load_string` return scenes under that accelerator; what is
no scene, and every variant in which our plugins do not work, is left to Mitsuba. For pytest:

    pytest -p mitsuba_bsp.testing --under normals tests/of/mitsuba
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mitsuba as mi

from . import loading
from .spec import parse_spec

Loader = Callable[..., Any]

_OURS: dict[str, Loader] = {
    "load_dict": loading.load_dict,
    "load_file": loading.load_file,
    "load_string": loading.load_string,
}


@contextmanager
def swapped(spec: str) -> Iterator[None]:
    """While this lasts, Mitsuba's loaders return scenes under `spec`. ValueError if the spec is wrong."""
    parse_spec(spec)
    theirs: dict[str, Loader] = {}

    def install(*_: str) -> None:
        """Mitsuba's functions come back whenever the variant changes."""
        for name, ours in _OURS.items():
            found = mi.__dict__.get(name)
            if found is not None and not hasattr(found, "theirs"):
                theirs[name] = found
                setattr(mi, name, _loader(ours, found, spec))

    install()
    mi.detail.add_variant_callback(install)
    try:
        yield
    finally:
        mi.detail.remove_variant_callback(install)
        for name, function in theirs.items():
            setattr(mi, name, function)


def _loader(ours: Loader, theirs: Loader, spec: str) -> Loader:
    """What stands in for a loader of Mitsuba, with the same arguments."""

    def load(source: object, *args: object, **kwargs: object) -> object:
        if mi.variant() not in loading.VARIANTS:
            return theirs(source, *args, **kwargs)
        try:
            return ours(source, spec, *args, **kwargs)
        except loading.NotASceneError:
            return theirs(source, *args, **kwargs)

    load.theirs = theirs
    return load


def pytest_addoption(parser: Any) -> None:
    """Adds --under."""
    parser.addoption("--under", metavar="SPEC", help="every scene that a test loads is under this accelerator")


def pytest_configure(config: Any) -> None:
    """Swaps for as long as the tests run."""
    spec = config.getoption("--under")
    if spec is None:
        return
    try:
        context = swapped(spec)
        context.__enter__()
    except ValueError as error:
        import pytest

        raise pytest.UsageError(f"--under: {error}") from None
    config.add_cleanup(lambda: context.__exit__(None, None, None))


def pytest_report_header(config: Any) -> str | None:
    """Says so."""
    spec = config.getoption("--under")
    return f"mitsuba-bsp: scenes under {spec}" if spec else None
