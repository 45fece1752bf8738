"""Record the rays of scenes, then replay them, into one resumable folder.

A scene is finished when all its runs are in `records.jsonl`; they are written together, marked with the time at which
the replay began. An interrupted scene is replayed again, from the streams that it has left in `streams`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .asked import begin
from .attempts import Attempt, Attempts
from .comparison import Failure, Listener, Options, SceneInfo, context
from .jobs import JobResult
from .machine import available_threads
from .preflight import preflight
from .records import Record, ResultsFolder, append, newest_run, of
from .scheduling import Local, Scheduler
from .streams import is_recorded

#: One frame of this size and this many samples per pixel is recorded, unless the user says otherwise.
RESOLUTION, SPP = 192, 2

JOBS_PER_SCENE = 2


@dataclass(frozen=True)
class RayOptions(Options):
    """What to replay; of more than `max_rays` rays of a kind a sample is taken."""

    max_rays: int = 500_000
    command: str = "bench rays"


def replay_scenes(
    options: RayOptions, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Record and replay what is not finished yet; returns the scenes and what failed.

    ValueError for anything wrong with the input, raised before the first job.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener, scheduler or Local())
    scenes = preflight(options, attempts, images=False, meshes_to="trace rays in", only_meshes=True)
    begin(folder, options, scenes, "streams")
    todo = [scene for scene in scenes if not newest_replay(folder, options, scene)]
    listener.start(scenes, JOBS_PER_SCENE * len(scenes), JOBS_PER_SCENE * (len(scenes) - len(todo)))
    recorded = _record(options, folder, attempts, todo)
    for _ in range(len(todo) - len(recorded)):
        listener.finish()
    for scene, result in attempts.run(recorded, lambda scene: _replaying(options, folder, scene)):
        append(folder.records_file, *(_row(options, scene, result, timed) for timed in result.values["runs"]))
    return scenes, attempts.failures


def streams_file(folder: ResultsFolder, scene: SceneInfo) -> Path:
    """Where a scene's recorded rays are kept."""
    return (folder.path / "streams" / f"{scene.name}.npz").absolute()


def _record(
    options: RayOptions, folder: ResultsFolder, attempts: Attempts, scenes: Sequence[SceneInfo]
) -> list[SceneInfo]:
    """Make sure that the scenes' rays are in their files; the scenes of which they are."""

    def origin(scene: SceneInfo) -> Record:
        made_by = context(options, scene, attempts.scheduler.machine)
        return {**made_by, "max_rays": options.max_rays}

    def attempt(scene: SceneInfo) -> Attempt:
        more = {"threads": 1, "max_rays": options.max_rays, "header": origin(scene)}
        job = options.job("record", scene.path, streams=str(streams_file(folder, scene)), **more)
        return Attempt(scene, "record", job, f"{scene.name}: record")

    found = {scene.name for scene in scenes if is_recorded(streams_file(folder, scene), origin(scene))}
    for _ in found:
        attempts.listener.finish()
    found |= {scene.name for scene, _ in attempts.run([s for s in scenes if s.name not in found], attempt)}
    return [scene for scene in scenes if scene.name in found]


def newest_replay(folder: ResultsFolder, options: RayOptions, scene: SceneInfo) -> list[Record]:
    """The records of the last replay of a scene that has all the runs that are asked for; empty if there is none."""
    rows = of(folder.records(), scene=scene.name, max_rays=options.max_rays)
    wanted = {(spec.text, repeat) for spec in options.specs for repeat in range(options.repeats)}
    return newest_run(rows, "replay", wanted, ("spec", "repeat"))


def _replaying(options: RayOptions, folder: ResultsFolder, scene: SceneInfo) -> Attempt:
    """The job that replays a scene's rays. All threads build; rays are traced on one."""
    job = options.job(
        "replay",
        scene.path,
        streams=str(streams_file(folder, scene)),
        threads=available_threads(),
        specs=[spec.text for spec in options.specs],
        repeats=options.repeats,
    )
    return Attempt(scene, "replay", job, f"{scene.name}: replay")


def _row(options: RayOptions, scene: SceneInfo, result: JobResult, timed: Mapping[str, Any]) -> Record:
    """One line of `records.jsonl`."""
    values = result.values
    spec, stream = timed["spec"], timed["stream"]
    rays = values["streams"][stream]["rays"]
    return {
        **context(options, scene, result.machine),
        "max_rays": options.max_rays,
        "replay": result.started,
        "stream": stream,
        "stream_sha256": values["streams"][stream]["sha256"],
        "rays": rays,
        "recorded_rays": values["streams"][stream]["recorded"],
        "triangles": values["triangles"],
        "triangles_sha256": values["triangles_sha256"],
        "spec": spec,
        "spec_full": next(s.full for s in options.specs if s.text == spec),
        "tree_sha256": values["trees"][spec],
        "repeat": timed["repeat"],
        "cpu_s": timed["cpu_s"],
        "wall_s": timed["wall_s"],
        "ns_per_ray": 1e9 * timed["cpu_s"] / rays,
        "mrays_per_s": 1e-6 * rays / timed["cpu_s"],
        "cache_misses": timed["cache_misses"],
        "counters": values["counters"][spec][stream],
        "differences": values["differences"][spec][stream],
    }
