"""Build accelerators again and again, each time in a fresh process, into one resumable folder.

The runs go in rounds that hold every scene, size and spec once, each round in a shuffled order. Before its first run a
scene is built once for nothing (`scheduling.run_warmed_up`).
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .asked import begin
from .attempts import Attempt, Attempts
from .comparison import Failure, Listener, Options, SceneInfo, context
from .growth import sizes_from
from .preflight import preflight
from .records import Record, ResultsFolder, append
from .scheduling import Local, Scheduler
from .spec import Spec

SHUFFLE_SEED = 20_240_607


@dataclass(frozen=True)
class BuildOptions(Options):
    """What to build: every scene as it is, or if there are `sizes` its meshes tessellated to so many triangles."""

    sizes: tuple[int, ...] = ()
    command: str = "bench build"


@dataclass(frozen=True)
class _Turn:
    """One run; `size` is None for the scene as it is."""

    scene: SceneInfo
    size: int | None
    spec: Spec
    repeat: int

    @property
    def key(self) -> tuple[str, int | None, str, int]:
        return (self.scene.name, self.size, self.spec.text, self.repeat)

    @property
    def label(self) -> str:
        size = f" of {self.size:,} triangles" if self.size else ""
        return f"{self.scene.name}{size}: {self.spec.text}, run {self.repeat + 1}"


def measure_builds(
    options: BuildOptions, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Make the runs that are not in the folder yet; returns the scenes and what failed.

    ValueError for anything wrong with the input, raised before the first run.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener, scheduler or Local())
    scenes = preflight(options, attempts, images=False, meshes_to="build a tree over")
    turns = [turn for repeat in range(options.repeats) for turn in _round(options, scenes, repeat)]
    begin(folder, options, scenes)
    done = {(row["scene"], row["size"], row["spec"], row["repeat"]) for row in folder.records()}
    todo = [turn for turn in turns if turn.key not in done]
    listener.start(scenes, len(turns), len(turns) - len(todo))
    for turn, result in attempts.run(todo, lambda turn: _attempt(options, turn)):
        append(folder.records_file, {**_origin(options, turn, result.machine), **result.values})
    return scenes, attempts.failures


def runs_of(
    folder: ResultsFolder, options: BuildOptions, scene: SceneInfo, size: int | None = None
) -> dict[str, list[Record]]:
    """The runs of a scene in order, by spec; a spec without any is left out."""
    rows = [
        row
        for row in folder.records()
        if row["scene"] == scene.name and row["size"] == size and row["repeat"] < options.repeats
    ]
    found = {spec.text: [row for row in rows if row["spec"] == spec.text] for spec in options.specs}
    return {spec: runs for spec, runs in found.items() if runs}


def sizes_of(options: BuildOptions, scene: SceneInfo) -> Sequence[int | None]:
    """The sizes in which a scene is built."""
    return sizes_from(scene.triangles, options.sizes) if options.sizes else (None,)


def _round(options: BuildOptions, scenes: Sequence[SceneInfo], repeat: int) -> list[_Turn]:
    turns = [
        _Turn(scene, size, spec, repeat)
        for scene in scenes
        for size in sizes_of(options, scene)
        for spec in options.specs
    ]
    return random.Random(SHUFFLE_SEED + repeat).sample(turns, len(turns))


def _attempt(options: BuildOptions, turn: _Turn) -> Attempt:
    kind = "grow" if turn.size else "build"
    job = options.job(kind, turn.scene.path, spec=turn.spec.text, triangles=turn.size or 0)
    return Attempt(turn.scene, turn.spec.text, job, turn.label)


def _origin(options: BuildOptions, turn: _Turn, machine: Mapping[str, str]) -> Record:
    """What was built; the size is what was asked for."""
    return {
        **context(options, turn.scene, machine),
        "size": turn.size,
        "spec": turn.spec.text,
        "spec_full": turn.spec.full,
        "repeat": turn.repeat,
    }
