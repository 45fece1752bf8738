"""Nightly: memory grows with the number of triangles and with nothing else, and threads take little of their own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import lru_cache

from .. import _allocations
from ..machine import available_threads
from ..spec import parse_spec
from .check import Outcome, Plan, Unit, check
from .meshes import Mesh, sphere
from .oracle import build
from .threads import thread_count

SMALLEST, GROWTH, LARGEST = 128, 1.5, 1_000_000  #: as Embree's test MemoryConsumption

#: Bytes per triangle that a finished tree may take; smaller meshes have a fixed part besides.
BUDGETS = {"kd": 120, "rbsp": 160, "normals": 240}
FIXED_BYTES = 16_384

#: What building takes at its worst on all threads, over what it takes on one; fixed parts are left out of it.
THREADS_RATIO = 1.12
THREAD_BYTES = 1_000_000


@check("N09", "bytes per triangle keep to their budget")
def memory_curve(plan: Plan) -> Iterator[Unit]:
    size = float(SMALLEST)
    while size <= max(SMALLEST, LARGEST * min(1.0, plan.scale)):
        for spec in BUDGETS:
            yield Unit(f"{spec}, {size:.0f} triangles", spec, lambda s=spec, n=int(size): _measure(s, n))
        size *= GROWTH


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
        "bytes per triangle": round(tree_bytes / count, 1),
        "peak per triangle": round(alone / count, 1),
        "peak on all threads over one": round(together / alone, 3),
    }
    return outcome


def _peak(mesh: Mesh, spec: str) -> int:
    """The most bytes at once while building, beyond what was there."""
    before = _allocations.live_bytes()
    _allocations.build(mesh.vertices, mesh.faces, spec, {}, "")
    return _allocations.peak_bytes() - before
