"""Run the jobs of a measurement one by one, so that one that fails leaves the others their turn."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field

from .comparison import Failure, Listener, SceneInfo
from .jobs import Job, JobError, JobResult, run_job
from .records import ResultsFolder, append


@dataclass
class Attempts:
    """Jobs on their way into one folder; `failures` are those that failed so far."""

    folder: ResultsFolder
    listener: Listener
    failures: list[Failure] = field(default_factory=list)
    _said: set[str] = field(default_factory=set)

    def run(self, scene: SceneInfo, what: str, job: Job, label: str) -> JobResult | None:
        """Run one job, pass on its warnings, each once; None if it failed, which is written down.

        `what` is the spec, or what else of the scene the job is about; `label` is how the progress bar calls the job.
        """
        self.listener.begin(label)
        try:
            result = run_job(job, lambda stage: self.listener.begin(f"{label} {_short(stage)}"))
        except JobError as error:
            failure = Failure(scene.name, what, str(error))
            self.failures.append(failure)
            append(self.folder.failures_file, asdict(failure))
            self.listener.fail(failure)
            return None
        finally:
            self.listener.finish()
        for text in result.warnings:
            self.note(f"{scene.name}: {text}")
        return result

    def note(self, text: str) -> None:
        """Tell the user something, once."""
        if text not in self._said:
            self._said.add(text)
            self.listener.note(text)


def _short(stage: str) -> str:
    """What a worker does, in a word, and how far it is if it says so: (building 42%)."""
    words = stage.split()
    return f"({words[0]} {words[-1]})" if stage.endswith("%") else f"({words[0]})"
