"""Where jobs run: on this machine, one after the other, or on the workers of a cluster (`cluster`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
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
        for place, (label, job) in enumerate(jobs):
            say(label)

            def on_stage(stage: str, label: str = label) -> None:
                say(f"{label} {_short(stage)}")

            try:
                outcome: JobResult | JobError = run_warmed_up(job, self._warm, on_stage)
            except JobError as error:
                outcome = error
            yield place, outcome


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
def scheduler_at(address: str | None, same_bits: bool = False) -> Iterator[Scheduler]:
    """This machine, or the Dask cluster whose scheduler is at `address`; see `cluster.Cluster`."""
    if address is None:
        yield Local()
        return
    try:
        from .cluster import Cluster
    except ModuleNotFoundError as error:
        if error.name not in ("dask", "distributed"):
            raise
        raise ValueError("--scheduler needs dask: pip install 'mitsuba-bsp[cluster]'") from None
    with Cluster(address, same_bits) as found:
        yield found


def _short(stage: str) -> str:
    """What a worker does, in a word, and how far it is if it says so: (building 42%)."""
    words = stage.split()
    return f"({words[0]} {words[-1]})" if stage.endswith("%") else f"({words[0]})"
