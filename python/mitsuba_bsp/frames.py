"""Time whole frames of scenes, one scene after the other, into one resumable folder.

A scene is finished when all its runs are in `records.jsonl`; they are written together, marked with the time at which
the measurement began. An interrupted scene is measured again.
"""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

from .asked import begin
from .attempts import Attempts
from .comparison import SEED, Failure, Listener, Options, SceneInfo, context
from .jobs import FREE, Job
from .preflight import preflight
from .records import Record, ResultsFolder, append, newest_run, of

#: Frames of this size and this many samples per pixel are timed, unless the user says otherwise.
RESOLUTION, SPP = 256, 4


def time_scenes(options: Options, listener: Listener) -> tuple[list[SceneInfo], list[Failure]]:
    """Time the scenes that are not finished yet; returns all scenes and what failed.

    ValueError for anything wrong with the input, raised before the first job.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener)
    scenes = preflight(options, folder, attempts.note, images=False, meshes_to="trace rays in")
    begin(folder, options, scenes)
    todo = [scene for scene in scenes if not newest_frames(folder, options, scene)]
    listener.start(scenes, len(scenes), len(scenes) - len(todo))
    for scene in todo:
        started = datetime.now().isoformat(timespec="seconds")
        result = attempts.run(scene, "frames", _job(folder, options, scene), f"{scene.name}: frames")
        if result:
            rows = (_row(options, scene, started, result.values, timed) for timed in result.values["runs"])
            append(folder.records_file, *rows)
    return scenes, attempts.failures


def contenders(options: Options) -> list[str]:
    """What takes turns: the specs, and on one thread the accelerator that answers for free."""
    return [spec.text for spec in options.specs] + [FREE] * (options.threads == 1)


def newest_frames(folder: ResultsFolder, options: Options, scene: SceneInfo) -> list[Record]:
    """The records of the last measurement of a scene that has all the runs asked for; empty if there is none."""
    return newest_run(of(folder.records(), scene=scene.name), "started", contenders(options), options.repeats)


def _job(folder: ResultsFolder, options: Options, scene: SceneInfo) -> Job:
    return Job(
        kind="frames",
        scene=str(scene.path),
        variant=options.variant,
        params=options.params,
        spp=options.spp,
        resolution=options.resolution,
        seed=SEED,
        threads=options.threads,
        specs=[spec.text for spec in options.specs],
        repeats=options.repeats,
        streams=str((folder.path / f"{scene.name}.rays").absolute()),
    )


def _row(
    options: Options, scene: SceneInfo, started: str, values: Mapping[str, Any], timed: Mapping[str, Any]
) -> Record:
    """One line of `records.jsonl`."""
    name = timed["spec"]
    return {
        **context(options, scene),
        "started": started,
        "spec": name,
        "spec_full": next((spec.full for spec in options.specs if spec.text == name), name),
        "repeat": timed["repeat"],
        "wall_s": timed["wall_s"],
        "cpu_s": timed["cpu_s"],
        # The processor's time is that of the frame where nothing else, and nobody waiting, can be part of it.
        "frame_s": timed["cpu_s" if options.threads == 1 else "wall_s"],
        "image_difference": values["images"][name],
    }
