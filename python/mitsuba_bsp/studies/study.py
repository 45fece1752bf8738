"""What all studies share: a grid of measurements, run into a resumable folder, and found again there.

A study is a plan (which measurements of which trees), tables and figures of what was recorded, and nothing else. Tables
and figures are made from the records alone. Measurements go in rounds that hold every scene and tree once, each round
in a shuffled order, so that a machine that slows down touches all of them alike.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..asked import begin
from ..attempts import Attempt, Attempts
from ..comparison import Failure, Listener, Options, SceneInfo, context, image_header
from ..jobs import JobResult, Kind
from ..machine import available_threads
from ..preflight import preflight
from ..records import Record, ResultsFolder, append
from ..scheduling import Local, Scheduler
from ..spec import Spec, parse_spec, with_setting
from ..text_table import TextTable

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.figure import Figure

SHUFFLE_SEED = 20_240_607

#: Measurements of time, for which nothing else may run and the user's number of threads counts.
_TIMED = ("time", "converge")


@dataclass(frozen=True)
class Cell:
    """One measurement of one tree, `repeats` times; if `seeded`, each time with another seed of the tree."""

    measure: Kind
    tree: str
    repeats: int = 1
    seeded: bool = False

    def spec(self, repeat: int) -> Spec:
        """The tree of one repetition."""
        return parse_spec(with_setting(self.tree, f"seed={repeat}") if self.seeded else self.tree)


@dataclass(frozen=True)
class StudyOptions(Options):
    """What to study; `choices` are the study's own options."""

    choices: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Study:
    """A study; what it is called and needs, and its four functions.

    `plan` says what is measured in every scene. `tables` and `figures` (by file name without suffix) show records.
    `add_options` adds the study's own options to a group of a command line and returns their names.
    """

    name: str
    help: str
    title: str
    legend: str
    plan: Callable[[StudyOptions], list[Cell]]
    tables: Callable[[Sequence[Record]], list[TextTable]]
    figures: Callable[[Sequence[Record], ResultsFolder], Iterator[tuple[str, Figure]]]
    add_options: Callable[[OptionGroup], Sequence[str]] = lambda _: ()
    repeats: int = 1
    least_repeats: int = 1
    repeated: str = ""  #: what a repetition is, for the help; empty if nothing is repeated


@dataclass(frozen=True)
class _Turn:
    """One measurement of one scene."""

    scene: SceneInfo
    cell: Cell
    repeat: int

    @property
    def spec(self) -> Spec:
        return self.cell.spec(self.repeat)

    @property
    def key(self) -> tuple[str, str, str, int]:
        return (self.scene.name, self.cell.measure, self.spec.text, self.repeat)

    @property
    def label(self) -> str:
        number = f", run {self.repeat + 1}" if self.cell.repeats > 1 else ""
        return f"{self.scene.name}: {self.spec.text}, {self.cell.measure}{number}"


def timed_and_counted(trees: Sequence[str], repeats: int) -> list[Cell]:
    """Times of all trees, and the work for a frame of those that tell; seeded where a tree has a seed."""
    cells = []
    for tree in trees:
        spec = parse_spec(tree)
        seeded = "seed" in spec.settings and "seed" not in spec.options
        cells.append(Cell("time", tree, repeats, seeded))
        if spec.name != "embree":
            cells.append(Cell("work", tree, repeats if seeded else 1, seeded))
    return cells


def specs_of(cells: Sequence[Cell]) -> tuple[Spec, ...]:
    """Every spec of a plan, once."""
    return tuple(dict.fromkeys(cell.spec(repeat) for cell in cells for repeat in range(cell.repeats)))


def run_study(
    study: Study, options: StudyOptions, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Make the measurements that are not in the folder yet; returns the scenes and what failed.

    ValueError for anything wrong with the input, raised before the first measurement.
    """
    folder = ResultsFolder(options.out)
    _check_study(study, folder)
    attempts = Attempts(folder, listener, scheduler or Local())
    scenes = preflight(options, attempts, images=False, meshes_to="put into trees")
    turns = _rounds(scenes, study.plan(options))
    begin(folder, options, scenes, "")
    done = {(row["scene"], row["measure"], row["spec"], row["repeat"]) for row in folder.records()}
    todo = [turn for turn in turns if turn.key not in done]
    listener.start(scenes, len(turns), len(turns) - len(todo))
    for turn, result in attempts.run(todo, lambda turn: _attempt(options, folder, turn)):
        append(folder.records_file, _row(study, options, turn, result))
    return scenes, attempts.failures


def arrays_file(folder: ResultsFolder, measure: str, scene: str, spec: str) -> Path:
    """The file for what a measurement finds besides numbers."""
    return folder.path / measure / folder.image(scene, spec).with_suffix(".npz").name


def _check_study(study: Study, folder: ResultsFolder) -> None:
    for row in folder.records():
        if row.get("study") != study.name:
            found = f"the study {row['study']}" if "study" in row else "another command"
            raise ValueError(f"{folder.path} holds records of {found}: choose another --out for {study.name}")


def _rounds(scenes: Sequence[SceneInfo], cells: Sequence[Cell]) -> list[_Turn]:
    turns: list[_Turn] = []
    for repeat in range(max(cell.repeats for cell in cells)):
        found = [_Turn(scene, cell, repeat) for scene in scenes for cell in cells if repeat < cell.repeats]
        turns += random.Random(SHUFFLE_SEED + repeat).sample(found, len(found))
    return turns


def _attempt(options: StudyOptions, folder: ResultsFolder, turn: _Turn) -> Attempt:
    measure = turn.cell.measure
    keeps_pixels = measure == "work" and options.choices.get("keep_pixels", False)
    job = options.job(
        measure,
        turn.scene.path,
        spec=turn.spec.text,
        threads=options.threads if measure in _TIMED else available_threads(),
        image=str(folder.image(turn.scene.name, turn.spec.text).absolute()) if keeps_pixels else "",
        header=image_header(turn.scene, turn.spec),
        arrays=str(arrays_file(folder, measure, turn.scene.name, turn.spec.text).absolute()),
        choices=options.choices,
    )
    return Attempt(turn.scene, turn.spec.text, job, turn.label)


def _row(study: Study, options: StudyOptions, turn: _Turn, result: JobResult) -> Record:
    """One line of `records.jsonl`."""
    found = dict(result.values)
    if turn.cell.measure in _TIMED:  # the lists of a tree's levels are in the record of its work
        found["statistics"] = {key: v for key, v in found["statistics"].items() if not isinstance(v, list)}
    return {
        **context(options, turn.scene, result.machine),
        "study": study.name,
        "measure": turn.cell.measure,
        "triangles": turn.scene.triangles,
        "tree": turn.cell.tree,
        "spec": turn.spec.text,
        "spec_full": turn.spec.full,
        "repeat": turn.repeat,
        **found,
    }
