"""Time building and rendering together, one scene after the other, into one resumable folder (`bench auto`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from .asked import begin
from .attempts import Attempts
from .comparison import SEED, Failure, Listener, Options, SceneInfo, context
from .expected_rays import AUTO
from .jobs import Job
from .preflight import preflight
from .records import Record, ResultsFolder, append, of
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


def time_totals(options: TotalOptions, listener: Listener) -> tuple[list[SceneInfo], list[Failure]]:
    """Time the scenes that are not finished yet; returns all scenes and what failed.

    ValueError for anything wrong with the input, raised before the first job.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener)
    scenes = preflight(options, folder, attempts.note, images=False, meshes_to="build a tree over")
    begin(folder, options, scenes)
    todo = [scene for scene in scenes if not newest_totals(folder, options, scene)]
    listener.start(scenes, len(scenes), len(scenes) - len(todo))
    for scene in todo:
        started = datetime.now().isoformat(timespec="seconds")
        result = attempts.run(scene, "totals", _job(options, scene), f"{scene.name}: totals")
        if result:
            append(folder.records_file, *(_row(options, scene, started, run) for run in result.values["runs"]))
    return scenes, attempts.failures


def newest_totals(folder: ResultsFolder, options: TotalOptions, scene: SceneInfo) -> list[Record]:
    """The records of the last measurement of a scene that has all that is asked for; empty if there is none."""
    rows = of(folder.records(), scene=scene.name)
    for started in reversed(dict.fromkeys(row["started"] for row in rows)):
        found = of(rows, started=started)
        have = {(row["spec"], row["for_spp"], row["turned"], row["repeat"]) for row in found}
        if have >= set(_wanted(options)):
            return found
    return []


def _wanted(options: TotalOptions) -> list[tuple[str, int, bool, int]]:
    return [
        (spec.text, spp, turned, repeat)
        for spec in options.specs
        for spp in (options.samples if spec.name == AUTO else (0,))
        for turned in ((False, True) if options.turned is not None else (False,))
        for repeat in range(options.repeats)
    ]


def _job(options: TotalOptions, scene: SceneInfo) -> Job:
    return Job(
        kind="totals",
        scene=str(scene.path),
        variant=options.variant,
        params=options.params,
        spp=options.spp,
        resolution=options.resolution,
        seed=SEED,
        threads=options.threads,
        specs=[spec.text for spec in options.specs],
        repeats=options.repeats,
        choices={"samples": options.samples, "turned": options.turned},
    )


def _row(options: TotalOptions, scene: SceneInfo, started: str, run: Mapping[str, Any]) -> Record:
    """One line of `records.jsonl`."""
    return {**context(options, scene), "started": started, "spec_full": parse_spec(run["spec"]).full, **run}
