"""Memory that runs out and users who interrupt: a Python exception, nothing left behind, and the next build works."""

from __future__ import annotations

import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from .. import _allocations
from .check import Failure, Outcome, Plan, Subject, Unit, check
from .meshes import Mesh, boxes, soup


@dataclass(frozen=True)
class Fault:
    """What may go wrong: the option of `_allocations.build` that says when, and the exception that comes of it."""

    kind: str
    option: str
    builds: int
    exception: type[BaseException]


FAULTS = (
    Fault("failed allocation", "fail_at", 50, MemoryError),
    Fault("interrupt", "interrupt_at", 20, KeyboardInterrupt),
    Fault("cap on bytes", "max_bytes", 10, MemoryError),
)

#: So many times what is left may be scratch memory that threads had not needed before: of four kinds, in some threads.
THREADS_TO_WARM = 8

#: Every fifth build also keeps its tree in a folder.
CACHED = 5

#: Enough for subtrees on several threads; and, for a few builds of one tree, for sweeps on several threads too. `ize`
#: is slow, and searches its planes on several threads from the start.
TRIANGLES, MANY_TRIANGLES, MANY_SHARE = 2_200, 33_000, 0.04
SLOW, SLOW_TRIANGLES = ("ize",), 600


@cache
def _soup(count: int) -> Mesh:
    return soup(f"soup of {count}", count, edge=0.1)


@check("C15", "failed allocations and interrupts leave nothing behind")
def faults(plan: Plan) -> Iterator[Unit]:
    for subject in plan.subjects:
        text = subject.spec.text
        if subject.share < 1 and set(subject.spec.options) != {"layout"}:
            continue  # other variants take their memory in the same places
        slow = subject.spec.name in SLOW
        yield Unit(text, text, lambda s=subject, n=SLOW_TRIANGLES if slow else TRIANGLES: _faults(plan, s, n, 1.0))
    large = next((subject for subject in plan.subjects if subject.spec.name not in SLOW), None)
    if large:
        text = large.spec.text
        yield Unit(f"{text} large", text, lambda: _faults(plan, large, MANY_TRIANGLES, MANY_SHARE))


def _faults(plan: Plan, subject: Subject, triangles: int, share: float) -> Outcome:
    mesh, outcome = _soup(triangles), Outcome(what="builds")
    rng = plan.rng("C15", subject.spec.text, mesh.name)
    _build(subject, mesh)  # what is allocated once and kept, by whomever, is there now
    _build(subject, mesh)
    allocations, peak = _allocations.allocations(), _allocations.peak_bytes()
    with _interruptible():
        for fault in FAULTS:
            last = peak if fault.option == "max_bytes" else allocations
            for index in range(max(1, round(plan.count(fault.builds, subject) * share))):
                _try(outcome, subject, mesh, fault, int(rng.integers(1, last)), cached=index % CACHED == 0)
    _build(subject, mesh)
    outcome.figures = {"allocations": allocations, "peak bytes per triangle": round(peak / triangles, 1)}
    return outcome


@contextmanager
def _interruptible() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, also in what a shell has started in the background, where it is ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _build(subject: Subject, mesh: Mesh, folder: str = "", **when: int) -> None:
    spec = subject.spec
    _allocations.build(mesh.vertices, mesh.faces, spec.name, dict(spec.options), folder, **when)


@dataclass(frozen=True)
class Wreck:
    """What a build that went wrong left behind."""

    raised: type[BaseException] | None
    reached: int  #: the number of allocations, or the bytes it took
    bytes_left: int
    files_left: list[str]


def _wreck(subject: Subject, mesh: Mesh, fault: Fault, when: int, cached: bool) -> Wreck:
    before, raised = _allocations.live_bytes(), None
    with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as folder:
        try:
            _build(subject, mesh, folder if cached else "", **{fault.option: when})
        except (Exception, KeyboardInterrupt) as error:  # noqa: BLE001 - whatever it is, it is judged
            raised = type(error)
        files_left = [file.name for file in Path(folder).glob("*.part")]
    reached = _allocations.peak_bytes() if fault.option == "max_bytes" else _allocations.allocations()
    return Wreck(raised, reached, _allocations.live_bytes() - before, files_left)


def _try(outcome: Outcome, subject: Subject, mesh: Mesh, fault: Fault, when: int, cached: bool) -> None:
    """One build that goes wrong, and a small one after it.

    A thread keeps its scratch memory for the next node. So what is left after one build only may be a thread's first
    scratch; a leak comes again.
    """
    wrecks = [_wreck(subject, mesh, fault, when, cached)]
    while wrecks[-1].bytes_left and len(wrecks) <= THREADS_TO_WARM:
        wrecks.append(_wreck(subject, mesh, fault, when, cached))
    wreck = wrecks[-1]
    text = f"{subject.spec.text}, {mesh.name}, {fault.option}={when}, cache={cached}"
    happened = wreck.raised is not None or wreck.reached >= when
    outcome.tried += len(wrecks)
    for family, broken, sentence in (
        (fault.kind, happened and wreck.raised is not fault.exception, f"the build raised {wreck.raised}"),
        ("bytes left", wreck.bytes_left, f"{wreck.bytes_left} bytes are left"),
        ("files left", wreck.files_left, f"the files {wreck.files_left} are left"),
        ("next build", not _works(subject), "the next build failed"),
    ):
        outcome.add(family, 0, int(bool(broken)), lambda s=sentence: Failure(f"{text}: {s}"))


def _works(subject: Subject) -> bool:
    """Whether a small tree can be built."""
    try:
        _build(subject, boxes("cube", [((-1, -1, -1), (1, 1, 1))]))
    except MemoryError:
        return False
    return True
