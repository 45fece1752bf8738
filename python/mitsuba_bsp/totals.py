"""Time building and rendering together, one scene after the other, into one resumable folder (`bench auto`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from .comparison import Failure, Listener, Options, SceneInfo
from .expected_rays import AUTO
from .jobs import Job
from .per_scene import measure_scenes
from .records import Record, ResultsFolder, newest_run, of
from .scheduling import Scheduler
from .spec import parse_spec

#: Frames of this size are timed with this many samples, unless the user says otherwise.
RESOLUTION, SPP = 512, 4

#: The samples per pixel of a preview, a picture and a final frame.
SAMPLES = (1, 16, 256)


@dataclass(frozen=True)
class TotalOptions(Options):
    """What to time: pictures of these `samples`, and the scene turned with this seed too, if there is one.

    Frames are measured with at most `spp` samples.
    """

    samples: tuple[int, ...] = SAMPLES
    turned: int | None = None
    command: str = "bench auto"


def time_totals(
    options: TotalOptions, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Time the scenes that are not finished yet; see `measure_scenes`."""
    return measure_scenes(options, listener, newest_totals, _job, _rows, scheduler)


def newest_totals(folder: ResultsFolder, options: TotalOptions, scene: SceneInfo) -> list[Record]:
    """The records of the last measurement of a scene that has all that is asked for; empty if there is none."""
    rows = of(folder.records(), scene=scene.name)
    return newest_run(rows, "started", _wanted(options), ("spec", "for_spp", "turned", "repeat"))


def _wanted(options: TotalOptions) -> set[tuple[str, int, bool, int]]:
    return {
        (spec.text, spp, turned, repeat)
        for spec in options.specs
        for spp in (options.samples if spec.name == AUTO else (0,))
        for turned in ((False, True) if options.turned is not None else (False,))
        for repeat in range(options.repeats)
    }


def _job(options: TotalOptions, scene: SceneInfo) -> Job:
    return options.job(
        "totals",
        scene.path,
        specs=[spec.text for spec in options.specs],
        repeats=options.repeats,
        choices={"samples": options.samples, "turned": options.turned},
    )


def _rows(_: TotalOptions, values: Mapping[str, Any]) -> list[Record]:
    return [{"spec_full": parse_spec(run["spec"]).full, **run} for run in values["runs"]]
