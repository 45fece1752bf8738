"""Where jobs run: on this machine, one after the other, or on the workers of a cluster (`cluster`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from threading import Event
from typing import Protocol

from .jobs import Job, JobError, JobResult, run_job
from .machine import describe

#: Told what is being done, in a few words.
Say = Callable[[str], None]

#: Kinds of jobs before the first of which in a scene the same is done for nothing, where it runs: to fill the system's
#: caches of the scene's files and of the libraries.
_WARMED_UP = ("build", "grow")


class Scheduler(Protocol):
    """Runs jobs."""

    @property
    def machine(self) -> Mapping[str, str]:
        """What all records will say about what they were measured on, as far as that is known beforehand."""

    def run(self, jobs: Iterable[tuple[str, Job]], say: Say, note: Say) -> Iterator[tuple[int, JobResult | JobError]]:
        """Run jobs, given with their labels; the place of each among them, and its outcome, as they finish.

        `say` is told what is being done, `note` what the user should know. An iterator that is closed, or interrupted,
        ends the jobs that are running.
        """


@dataclass
class Local:
    """This machine, one job after the other, so that no job disturbs the time of another."""

    machine: Mapping[str, str] = field(default_factory=describe)
    _warm: set[str] = field(default_factory=set)

    def run(self, jobs: Iterable[tuple[str, Job]], say: Say, _: Say) -> Iterator[tuple[int, JobResult | JobError]]:
        """See `Scheduler`."""
        for place, (label, job) in enumerate(jobs):
            yield place, self._outcome(label, job, say)

    def _outcome(self, label: str, job: Job, say: Say) -> JobResult | JobError:
        say(label)
        try:
            return run_warmed_up(job, self._warm, lambda stage: say(f"{label} {_short(stage)}"))
        except JobError as error:
            return error


@dataclass
class Together(Local):
    """This machine, several jobs `at_once`, which are not timed."""

    at_once: int = 1

    def run(self, jobs: Iterable[tuple[str, Job]], say: Say, _: Say) -> Iterator[tuple[int, JobResult | JobError]]:
        """See `Scheduler`."""
        closed = Event()

        def say_or_end(text: str) -> None:
            if closed.is_set():
                raise InterruptedError
            say(text)

        with ThreadPoolExecutor(self.at_once) as pool:
            flights = {pool.submit(self._outcome, *own, say_or_end): place for place, own in enumerate(jobs)}
            try:
                for flight in as_completed(flights):
                    yield flights[flight], flight.result()
            finally:
                closed.set()
                pool.shutdown(wait=False, cancel_futures=True)


def run_warmed_up(job: Job, warm: set[str], on_stage: Say) -> JobResult:
    """Run a job, and before it the same for nothing if its kind needs that and its scene is not `warm` yet.

    Should that fail, the same job says so when it counts.
    """
    if job.kind in _WARMED_UP and job.scene not in warm:
        warm.add(job.scene)
        with suppress(JobError):
            run_job(job, lambda _: on_stage("warming up"))
    return run_job(job, on_stage)


@contextmanager
def scheduler_at(address: str | None) -> Iterator[Scheduler]:
    """For measurements: this machine, or the Dask cluster whose scheduler is at `address`; see `cluster.Cluster`."""
    if address is None:
        yield Local()
    else:
        with _cluster(address, same_bits=False) as found:
            yield found


@contextmanager
def image_scheduler_at(address: str | None, at_once: int) -> Iterator[Scheduler]:
    """For the parts of an image, each on one thread: the same, but here several `at_once`."""
    if address is None:
        yield Together(at_once=at_once)
    else:
        with _cluster(address, same_bits=True) as found:
            yield found


def _cluster(address: str, same_bits: bool) -> AbstractContextManager[Scheduler]:
    try:
        from .cluster import Cluster
    except ModuleNotFoundError as error:
        if error.name not in ("dask", "distributed"):
            raise
        raise ValueError("--scheduler needs dask: pip install 'mitsuba-bsp[cluster]'") from None
    return Cluster(address, same_bits)


def _short(stage: str) -> str:
    """What a worker does, in a word, and how far it is if it says so: (building 42%)."""
    words = stage.split()
    return f"({words[0]} {words[-1]})" if stage.endswith("%") else f"({words[0]})"
