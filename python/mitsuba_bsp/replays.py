"""Record and replay the rays of scenes, one after the other, into one resumable folder.

A scene is finished when all its runs are in `records.jsonl`; they are written together, marked with the time at which
the replay began. An interrupted scene is replayed again, from the streams that it has left in `streams`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from .asked import begin
from .attempts import Attempts
from .comparison import Failure, Listener, Options, SceneInfo, context
from .jobs import Job, JobResult, Kind
from .machine import available_threads
from .preflight import preflight
from .records import Record, ResultsFolder, append, newest_run, of
from .streams import is_recorded

#: One frame of this size and this many samples per pixel is recorded, unless the user says otherwise.
RESOLUTION, SPP = 192, 2

JOBS_PER_SCENE = 2


@dataclass(frozen=True)
class RayOptions(Options):
    """What to replay; of more than `max_rays` rays of a kind a sample is taken."""

    max_rays: int = 500_000
    command: str = "bench rays"


@dataclass(frozen=True)
class _Run:
    """One measurement on its way."""

    options: RayOptions
    listener: Listener
    folder: ResultsFolder
    attempts: Attempts

    def job(self, kind: Kind, scene: SceneInfo, **more: Any) -> Job:
        return self.options.job(kind, scene.path, streams=str(streams_file(self.folder, scene)), **more)

    def attempt(self, scene: SceneInfo, job: Job) -> JobResult | None:
        """Run a job; a failure is recorded and the next scene has its turn."""
        return self.attempts.run(scene, job.kind, job, f"{scene.name}: {job.kind}")


def replay_scenes(options: RayOptions, listener: Listener) -> tuple[list[SceneInfo], list[Failure]]:
    """Record and replay what is not finished yet; returns the scenes and what failed.

    ValueError for anything wrong with the input, raised before the first job.
    """
    folder = ResultsFolder(options.out)
    run = _Run(options, listener, folder, Attempts(folder, listener))
    scenes = preflight(options, folder, run.attempts.note, images=False, meshes_to="trace rays in")
    begin(folder, options, scenes, "streams")
    todo = [scene for scene in scenes if not newest_replay(folder, options, scene)]
    listener.start(scenes, JOBS_PER_SCENE * len(scenes), JOBS_PER_SCENE * (len(scenes) - len(todo)))
    for scene in todo:
        if record_streams(options, folder, run.attempts, scene):
            _replay(run, scene)
        else:
            listener.finish()
    return scenes, run.attempts.failures


def streams_file(folder: ResultsFolder, scene: SceneInfo) -> Path:
    """Where a scene's recorded rays are kept."""
    return (folder.path / "streams" / f"{scene.name}.npz").absolute()


def record_streams(options: RayOptions, folder: ResultsFolder, attempts: Attempts, scene: SceneInfo) -> bool:
    """Make sure that the scene's rays are in their file; False if recording them failed."""
    origin = {**context(options, scene), "max_rays": options.max_rays}
    if is_recorded(streams_file(folder, scene), origin):
        attempts.listener.finish()
        return True
    run = _Run(options, attempts.listener, folder, attempts)
    job = run.job("record", scene, threads=1, max_rays=options.max_rays, header=origin)
    return run.attempt(scene, job) is not None


def newest_replay(folder: ResultsFolder, options: RayOptions, scene: SceneInfo) -> list[Record]:
    """The records of the last replay of a scene that has all the runs that are asked for; empty if there is none."""
    rows = of(folder.records(), scene=scene.name, max_rays=options.max_rays)
    wanted = {(spec.text, repeat) for spec in options.specs for repeat in range(options.repeats)}
    return newest_run(rows, "replay", wanted, ("spec", "repeat"))


def _replay(run: _Run, scene: SceneInfo) -> None:
    """Replay the scene's streams and write down every run."""
    started = datetime.now().isoformat(timespec="seconds")
    specs = [spec.text for spec in run.options.specs]
    # All threads build; rays are traced on one.
    job = run.job("replay", scene, threads=available_threads(), specs=specs, repeats=run.options.repeats)
    result = run.attempt(scene, job)
    if result is None:
        return
    append(
        run.folder.records_file, *(_row(run, scene, started, result.values, timed) for timed in result.values["runs"])
    )


def _row(run: _Run, scene: SceneInfo, started: str, values: Mapping[str, Any], timed: Mapping[str, Any]) -> Record:
    """One line of `records.jsonl`."""
    spec, stream = timed["spec"], timed["stream"]
    rays = values["streams"][stream]["rays"]
    return {
        **context(run.options, scene),
        "max_rays": run.options.max_rays,
        "replay": started,
        "stream": stream,
        "stream_sha256": values["streams"][stream]["sha256"],
        "rays": rays,
        "recorded_rays": values["streams"][stream]["recorded"],
        "triangles_sha256": values["triangles_sha256"],
        "spec": spec,
        "spec_full": next(s.full for s in run.options.specs if s.text == spec),
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
