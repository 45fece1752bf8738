"""Nightly: a hundred thousand builds, and minutes of building and tracing garbage on many threads, leave nothing."""

from __future__ import annotations

import ctypes
import gc
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..loading import thread_count
from .check import Outcome, Plan, Subject, Unit, check
from .checks_fuzz import KINDS, aimed_rays, garbage_mesh
from .contest import main_subjects
from .meshes import soup
from .oracle import answered, build, differing

BUILDS, PER_UNIT = 100_000, 5_000
MOST_TRIANGLES = 12
SOAK_S, THREADS, RAYS = 600, 8, 1_000

#: Memory that builds may leave to the allocator and its threads.
LEFT_BYTES = 32_000_000


@check("N10", "many builds and a soak of garbage leave nothing behind")
def soak(plan: Plan) -> Iterator[Unit]:
    subjects = main_subjects(plan)
    builds = plan.count(BUILDS)
    for start in range(0, builds, PER_UNIT):
        count = min(PER_UNIT, builds - start)
        yield Unit(f"builds {start} to {start + count - 1}", "", lambda i=start, n=count: _many(plan, subjects, i, n))
    yield Unit(f"soak of {plan.count(SOAK_S)} s", "", lambda: _soak(plan, subjects))


def _many(plan: Plan, subjects: tuple[Subject, ...], start: int, count: int) -> Outcome:
    """Of 1 to 12 triangles, one tree after the other; a few rounds of the first meshes warm the allocator up."""
    outcome = Outcome(what="builds")
    meshes = [soup(f"soup of {n}", n, seed=start + n) for n in range(1, MOST_TRIANGLES + 1)]

    def round_of(number: int) -> None:
        build(meshes[number % len(meshes)], subjects[number % len(subjects)].spec)

    for number in range(len(meshes) * len(subjects)):
        round_of(number)
    before = _resident()
    for number in range(count):
        round_of(number)
    grown = _resident() - before
    outcome.add("builds", count)
    outcome.expect("memory", grown <= LEFT_BYTES, f"{count} builds from {start} on left {grown:,} bytes")
    outcome.figures["bytes left"] = grown
    return outcome


def _soak(plan: Plan, subjects: tuple[Subject, ...]) -> Outcome:
    """Every thread builds and traces meshes of which a sixteenth is garbage, and is judged by brute force."""
    end = time.monotonic() + plan.count(SOAK_S)
    outcome = Outcome(what="rays")

    def work(worker: int) -> tuple[int, dict[str, int]]:
        traced, wrong = 0, dict[str, int]()
        turn = 0
        while time.monotonic() < end or turn == 0:
            rng = plan.rng("soak", worker, turn)
            mesh = garbage_mesh(f"soak {worker} {turn}", KINDS[0][1], rng)
            asked = answered(mesh, "soak", aimed_rays(mesh, RAYS, rng), plan.seed)
            subject = subjects[(worker + turn) % len(subjects)]
            bad = int(differing(build(mesh, subject.spec).closest(*asked.rays), asked.expected).sum())
            if bad:
                wrong[f"{subject.spec.text}, worker {worker}, turn {turn}"] = bad
            traced += RAYS
            turn += 1
        return traced, wrong

    with thread_count(THREADS), ThreadPoolExecutor(THREADS) as pool:
        work(THREADS)  # warms up
        before = _resident()
        found = list(pool.map(work, range(THREADS)))
    grown = _resident() - before
    for traced, wrong in found:
        outcome.add("soak", traced)
        for text, bad in wrong.items():
            outcome.add("soak", 0, bad)
            outcome.expect("answers", False, f"{text}: {bad} answers are not those of brute force, seed {plan.seed}")
    outcome.expect("memory", grown <= LEFT_BYTES, f"the soak left {grown:,} bytes")
    outcome.figures["bytes left"] = grown
    return outcome


def _resident() -> int:
    """Bytes of this process in memory, once the allocator has given back what it can."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")
