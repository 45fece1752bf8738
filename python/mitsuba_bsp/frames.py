"""Time whole frames of scenes, one scene after the other, into one resumable folder (`bench render`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .comparison import Failure, Listener, Options, SceneInfo
from .jobs import FREE, Job
from .per_scene import measure_scenes
from .records import Record, ResultsFolder, newest_run, of
from .scheduling import Scheduler

#: Frames of this size and this many samples per pixel are timed, unless the user says otherwise.
RESOLUTION, SPP = 256, 4


def time_scenes(
    options: Options, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Time the scenes that are not finished yet; see `measure_scenes`."""
    return measure_scenes(options, listener, newest_frames, _job, _rows, scheduler)


def contenders(options: Options) -> list[str]:
    """What takes turns: the specs, and on one thread the accelerator that answers for free."""
    return [spec.text for spec in options.specs] + [FREE] * (options.threads == 1)


def newest_frames(folder: ResultsFolder, options: Options, scene: SceneInfo) -> list[Record]:
    """The records of the last measurement of a scene that has all the runs asked for; empty if there is none."""
    wanted = {(name, repeat) for name in contenders(options) for repeat in range(options.repeats)}
    return newest_run(of(folder.records(), scene=scene.name), "started", wanted, ("spec", "repeat"))


def _job(options: Options, scene: SceneInfo) -> Job:
    return options.job(
        "frames",
        scene.path,
        specs=[spec.text for spec in options.specs],
        repeats=options.repeats,
        streams=str((options.out / f"{scene.name}.rays").absolute()),
    )


def _rows(options: Options, values: Mapping[str, Any]) -> list[Record]:
    full = {spec.text: spec.full for spec in options.specs}
    return [
        {
            "spec": run["spec"],
            "spec_full": full.get(run["spec"], run["spec"]),
            "repeat": run["repeat"],
            "wall_s": run["wall_s"],
            "cpu_s": run["cpu_s"],
            # The processor's time is that of the frame where nothing else, and nobody waiting, can be part of it.
            "frame_s": run["cpu_s" if options.threads == 1 else "wall_s"],
            "image_difference": values["images"][run["spec"]],
        }
        for run in values["runs"]
    ]
