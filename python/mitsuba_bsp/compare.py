"""The comparison: every scene under every accelerator, images, counters and times, into one resumable folder.

Order of work: check everything that can be checked; render each scene under each spec once, untimed, with counters
and the box filter (these are the images that are compared); then the timed runs, in rounds that hold every scene and
spec once, each round in a shuffled order, so that a machine that slows down touches all of them alike.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

from .asked import begin
from .attempts import Attempt, Attempts
from .comparison import Failure, Listener, Options, SceneInfo, context, image_header
from .differences import Differences
from .jobs import Job, JobResult, Kind
from .preflight import preflight
from .records import Record, ResultsFolder, append
from .scheduling import Local, Scheduler
from .spec import Spec
from .tree_statistics import per_ray

#: The seed of the order of the timed runs.
SHUFFLE_SEED = 20_240_607


@dataclass(frozen=True)
class _Run:
    """One comparison on its way."""

    options: Options
    folder: ResultsFolder
    attempts: Attempts

    def job(self, scene: SceneInfo, spec: Spec, kind: Kind) -> Job:
        image = str(self.folder.image(scene.name, spec.text)) if kind == "count" else ""
        return self.options.job(
            kind,
            scene.path,
            spec=spec.text,
            image=image,
            header=image_header(scene, spec) if image else {},
            cache=str(self.options.cache or ""),
        )


def compare(
    options: Options, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Run the comparison; returns its scenes and the jobs that failed.

    ValueError for anything wrong with the input, raised before the first job. Everything finished is on disk at all
    times, also if KeyboardInterrupt ends the run; another run with the same folder goes on from there.
    """
    folder = ResultsFolder(options.out)
    run = _Run(options, folder, Attempts(folder, listener, scheduler or Local()))
    scenes = preflight(options, run.attempts)
    begin(folder, options, scenes, "images")
    todo_count, todo_time = _to_count(run, scenes), _to_time(run, scenes)
    total = len(scenes) * len(options.specs) * (options.repeats + 1)
    listener.start(scenes, total, total - len(todo_count) - len(todo_time))
    _count(run, todo_count)
    _time(run, todo_time)
    return scenes, run.attempts.failures


def _to_count(run: _Run, scenes: Sequence[SceneInfo]) -> list[tuple[SceneInfo, Spec]]:
    """The untimed runs that are still missing."""
    done = run.folder.counted()
    return [(scene, spec) for scene in scenes for spec in run.options.specs if (scene.name, spec.text) not in done]


def _to_time(run: _Run, scenes: Sequence[SceneInfo]) -> list[tuple[SceneInfo, Spec, int]]:
    """The timed runs that are still missing, round by round, each round shuffled."""
    done = {(row["scene"], row["spec"], row["repeat"]) for row in run.folder.records()}
    shuffled: list[tuple[SceneInfo, Spec, int]] = []
    generator = random.Random(SHUFFLE_SEED)
    for repeat in range(run.options.repeats):
        turn = [(scene, spec, repeat) for scene in scenes for spec in run.options.specs]
        generator.shuffle(turn)
        shuffled += [job for job in turn if (job[0].name, job[1].text, repeat) not in done]
    return shuffled


def _count(run: _Run, todo: Sequence[tuple[SceneInfo, Spec]]) -> None:
    """The untimed runs with counters and images."""

    def attempt(turn: tuple[SceneInfo, Spec]) -> Attempt:
        scene, spec = turn
        return Attempt(
            scene, spec.text, run.job(scene, spec, "count"), f"{scene.name}: {spec.text}, counters and image"
        )

    for (scene, spec), result in run.attempts.run(todo, attempt):
        row = {
            **context(run.options, scene, result.machine),
            "spec": spec.text,
            "spec_full": spec.full,
            **result.values,
            "image": str(run.folder.image(scene.name, spec.text).relative_to(run.folder.path)),
        }
        append(run.folder.counters_file, row)


def _time(run: _Run, todo: Sequence[tuple[SceneInfo, Spec, int]]) -> None:
    """The timed runs; without those of scenes and specs whose untimed run failed."""
    counted = run.folder.counted()
    ready = [turn for turn in todo if (turn[0].name, turn[1].text) in counted]
    for _ in range(len(todo) - len(ready)):
        run.attempts.listener.finish()
    differences = Differences(run.folder, run.options.specs)

    def attempt(turn: tuple[SceneInfo, Spec, int]) -> Attempt:
        scene, spec, repeat = turn
        label = f"{scene.name}: {spec.text}, timed run {repeat + 1} of {run.options.repeats}"
        return Attempt(scene, spec.text, run.job(scene, spec, "time"), label)

    for (scene, spec, repeat), result in run.attempts.run(ready, attempt):
        row = _record(run, scene, spec, repeat, result, counted[scene.name, spec.text], differences)
        append(run.folder.records_file, row)


def _record(
    run: _Run,
    scene: SceneInfo,
    spec: Spec,
    repeat: int,
    result: JobResult,
    counted: Record,
    differences: Differences,
) -> Record:
    """One line of `records.jsonl`."""
    timed = result.values
    statistics, counters = dict(timed["statistics"]), counted["statistics"].get("counters", {})
    same_setup = scene.comparable and scene.box_filter
    return {
        **context(run.options, scene, result.machine),
        "spec": spec.text,
        "spec_full": spec.full,
        "repeat": repeat,
        "build_s": timed["build_s"],
        "render_s": timed["render_s"],
        "peak_rss_bytes": timed["peak_rss_bytes"],
        "statistics": statistics,
        "counters": counters,
        **per_ray(statistics, counters),
        "image": counted["image"],
        "image_difference": differences.of(scene.name, spec) if scene.comparable else {},
        "image_repeats": timed["pixels_sha256"] == counted["pixels_sha256"] if same_setup else None,
    }
