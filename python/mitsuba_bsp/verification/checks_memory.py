"""Nightly: memory grows with the number of triangles and with nothing else, and threads take little of their own."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from functools import lru_cache

from .. import _allocations
from ..loading import thread_count
from ..machine import available_threads
from ..spec import parse_spec
from ..text_table import TextTable
from .check import Outcome, Plan, Record, Unit, check
from .meshes import Mesh, sphere
from .oracle import build

SMALLEST, GROWTH, LARGEST = 128, 1.5, 1_000_000  #: as Embree's test MemoryConsumption

#: Bytes per triangle that a finished tree may take; smaller meshes have a fixed part besides.
BUDGETS = {"kd": 120, "rbsp": 120, "normals": 120}
FIXED_BYTES = 16_384

#: What building takes at its worst on all threads, over what it takes on one; fixed parts are left out of it.
THREADS_RATIO = 1.12
THREAD_BYTES = 1_000_000


#: Figures of a unit.
BYTES, PEAK, RATIO = "bytes per triangle", "peak per triangle", "peak on all threads over one"


def tables(records: Sequence[Record]) -> list[TextTable]:
    """One for each figure: a row for each size, a column for each tree."""
    by_size: dict[str, dict[str, Record]] = {}
    for row in records:
        by_size.setdefault(row["unit"].partition(", ")[2], {})[row["spec"]] = row["figures"]
    return [
        TextTable(
            f"Memory: {key}",
            ("mesh", *BUDGETS),
            tuple((size, *(_cell(found[spec].get(key)) for spec in BUDGETS)) for size, found in by_size.items()),
        )
        for key in (BYTES, PEAK, RATIO)
    ]


def _cell(value: float | None) -> str:
    """Nothing where measuring failed."""
    return "-" if value is None else f"{value:,.4g}"


@check("N09", "bytes per triangle keep to their budget", tables)
def memory_curve(plan: Plan) -> Iterator[Unit]:
    for size in sizes(LARGEST * min(1.0, plan.scale)):
        for spec in BUDGETS:
            yield Unit(f"{spec}, {size} triangles", spec, lambda s=spec, n=size: _measure(s, n))


def sizes(largest: float) -> list[int]:
    """From the smallest on, each 1.5 times the one before; the last is the largest itself."""
    found, size = [], float(SMALLEST)
    while size < largest:
        found.append(int(size))
        size *= GROWTH
    return [*found, max(SMALLEST, round(largest))]


@lru_cache(maxsize=1)
def _mesh(triangles: int) -> Mesh:
    """A bumpy sphere of about so many."""
    return sphere(f"bumpy sphere of {triangles}", max(4, round((triangles / 4) ** 0.5)), bumps=0.02)


def _measure(spec: str, triangles: int) -> Outcome:
    mesh = _mesh(triangles)
    count = len(mesh.faces)
    tree_bytes = json.loads(build(mesh, parse_spec(spec)).statistics())["bytes"]
    with thread_count(1):
        alone = _peak(mesh, spec)
    together = _peak(mesh, spec)
    outcome = Outcome(what="trees")
    text = f"{spec} over {mesh.name}"
    allowed = BUDGETS[spec] * count + FIXED_BYTES
    outcome.expect("tree", tree_bytes <= allowed, f"{text}: {tree_bytes:,} bytes, {allowed:,} are allowed")
    most = THREADS_RATIO * alone + THREAD_BYTES * available_threads()
    sentence = f"{text}: building takes {together:,} bytes on all threads, {alone:,} on one"
    outcome.expect("threads", together <= most, sentence)
    outcome.figures = {
        "triangles": count,
        BYTES: round(tree_bytes / count, 1),
        PEAK: round(alone / count, 1),
        RATIO: round(together / alone, 3),
    }
    return outcome


def _peak(mesh: Mesh, spec: str) -> int:
    """The most bytes at once while building, with the scratch memory that threads have kept from earlier builds."""
    before = _allocations.live_bytes()
    _allocations.build(mesh.vertices, mesh.faces, spec, {}, "")
    return before + _allocations.peak_bytes()  # the latter is counted from the former on
