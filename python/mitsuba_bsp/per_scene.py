"""One job for every scene, into one resumable folder.

A scene is finished when all its runs are in `records.jsonl`; they are written together, marked with the time at which
the measurement began. An interrupted scene is measured again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from .asked import begin
from .attempts import Attempt, Attempts
from .comparison import Failure, Listener, Options, SceneInfo, context
from .jobs import Job
from .preflight import preflight
from .records import Record, ResultsFolder, append
from .scheduling import Local, Scheduler

AnyOptions = TypeVar("AnyOptions", bound=Options)

#: What a measurement found, as the lines of `records.jsonl` without what all records of a scene say.
Rows = Callable[[AnyOptions, Mapping[str, Any]], list[Record]]


def measure_scenes(
    options: AnyOptions,
    listener: Listener,
    newest: Callable[[ResultsFolder, AnyOptions, SceneInfo], list[Record]],
    job: Callable[[AnyOptions, SceneInfo], Job],
    rows: Rows[AnyOptions],
    scheduler: Scheduler | None = None,
) -> tuple[list[SceneInfo], list[Failure]]:
    """Run the job of every scene of which the folder has no `newest` measurement; returns all scenes and what failed.

    ValueError for anything wrong with the input, raised before the first job.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener, scheduler or Local())
    scenes = preflight(options, attempts, images=False, meshes_to="trace rays in")
    begin(folder, options, scenes)
    todo = [scene for scene in scenes if not newest(folder, options, scene)]
    listener.start(scenes, len(scenes), len(scenes) - len(todo))

    def attempt(scene: SceneInfo) -> Attempt:
        own = job(options, scene)
        return Attempt(scene, own.kind, own, f"{scene.name}: {own.kind}")

    for scene, result in attempts.run(todo, attempt):
        origin = {**context(options, scene, result.machine), "started": result.started}
        append(folder.records_file, *({**origin, **row} for row in rows(options, result.values)))
    return scenes, attempts.failures
