"""The jobs of a measurement on their way into one folder: one that fails leaves the others their turn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, field
from typing import TypeVar

from .comparison import Failure, Listener, SceneInfo
from .jobs import Job, JobError, JobResult
from .records import ResultsFolder, append
from .scheduling import Local, Scheduler

Turn = TypeVar("Turn")


@dataclass(frozen=True)
class Attempt:
    """A job in a scene; `what` is the spec, or what else of it the job is about, `label` what the bar calls it."""

    scene: SceneInfo
    what: str
    job: Job
    label: str


@dataclass
class Attempts:
    """Jobs on their way into one folder; `failures` are those that failed so far."""

    folder: ResultsFolder
    listener: Listener
    scheduler: Scheduler = field(default_factory=Local)
    failures: list[Failure] = field(default_factory=list)
    _said: set[str] = field(default_factory=set)

    def run(self, turns: Iterable[Turn], attempt: Callable[[Turn], Attempt]) -> Iterator[tuple[Turn, JobResult]]:
        """Run the job of every turn; each turn with its result, as they finish.

        Warnings are passed on, each once; what failed is left out, and written down.
        """
        turns = list(turns)
        attempts = [attempt(turn) for turn in turns]
        jobs = [(own.label, own.job) for own in attempts]
        for place, outcome in self.scheduler.run(jobs, self.listener.begin, self.note):
            if isinstance(outcome, JobError):
                self._fail(attempts[place], outcome)
                continue
            self.listener.finish()
            for text in outcome.warnings:
                self.note(f"{attempts[place].scene.name}: {text}")
            yield turns[place], outcome

    def note(self, text: str) -> None:
        """Tell the user something, once."""
        if text not in self._said:
            self._said.add(text)
            self.listener.note(text)

    def _fail(self, own: Attempt, error: JobError) -> None:
        failure = Failure(own.scene.name, own.what, str(error))
        self.failures.append(failure)
        append(self.folder.failures_file, asdict(failure))
        self.listener.fail(failure)
        self.listener.finish()
