"""What every subcommand shows and reads alike: consoles, the progress bar, exit statuses, arguments."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from . import scenes_dir
from .comparison import Failure, SceneInfo
from .loading import VARIANTS
from .machine import available_threads

OK, JOB_FAILED, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

#: Tables that go to a file or a pipe are not squeezed into 80 columns.
_WIDTH = None if sys.stdout.isatty() else 120

out, err = Console(highlight=False, width=_WIDTH), Console(stderr=True, highlight=False)


def say(kind: str, text: str, style: str) -> None:
    """A line for the user, apart from the command's output."""
    err.print(f"mitsuba-bsp: {kind}: {text}", style=style, markup=False, soft_wrap=True)


def positive(text: str) -> int:
    """A positive integer, as the type of an argument."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not a positive integer")
    return int(text)


def parameter(text: str) -> tuple[str, str]:
    """KEY=VALUE, as the type of an argument."""
    key, equals, value = text.partition("=")
    if not (key and equals):
        raise argparse.ArgumentTypeError(f'"{text}" is not of the form key=value')
    return key, value


def add_loading_options(sub: argparse.ArgumentParser) -> None:
    """How scenes are loaded, whatever is done with them."""
    sub.add_argument("--variant", choices=VARIANTS, default=VARIANTS[0], help="default: %(default)s")
    sub.add_argument(
        "-D",
        dest="params",
        action="append",
        type=parameter,
        default=[],
        metavar="KEY=VALUE",
        help="set a parameter of the scene",
    )


def add_threads_option(sub: argparse.ArgumentParser) -> None:
    """How many threads work."""
    sub.add_argument("--threads", type=positive, default=available_threads(), metavar="N", help="default: all")


def add_scheduler_option(sub: argparse.ArgumentParser) -> None:
    """Where jobs run."""
    sub.add_argument(
        "--scheduler", metavar="tcp://HOST:PORT", help="run jobs on the workers of this Dask cluster; default: here"
    )


def chosen_scenes(named: Sequence[Path]) -> tuple[Path, ...]:
    """The scenes that a command works on: those named, or the built-in ones."""
    scenes = named or sorted(scenes_dir().glob("*.xml"))
    if not scenes:
        raise ValueError(f"there are no built-in scenes in {scenes_dir()}: install the package again, or name a scene")
    return tuple(path.absolute() for path in scenes)


class ProgressBar:
    """Shows a comparison on the terminal: a bar, the current job, and notes above it."""

    def __init__(self, first: str = "checking the scenes") -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        self._progress = Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=err)
        self._task = self._progress.add_task(first, total=None)
        self.scenes: list[SceneInfo] = []
        self.failures: list[Failure] = []

    def __enter__(self) -> ProgressBar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def note(self, text: str) -> None:
        self._progress.console.print(f"note: {text}", markup=False, soft_wrap=True)

    def start(self, scenes: Sequence[SceneInfo], jobs: int, done: int) -> None:
        self.scenes = list(scenes)
        if done:
            self.note(f"{done} of {jobs} jobs were finished by an earlier run into this folder and are kept")
        self._progress.update(self._task, total=jobs, completed=done)

    def begin(self, job: str) -> None:
        self._progress.update(self._task, description=job)

    def finish(self) -> None:
        self._progress.advance(self._task)

    def fail(self, failure: Failure) -> None:
        self.failures.append(failure)
        self.note(f"{failure.scene}, {failure.spec} failed: {failure.message}")
