"""What a worker process does for measurements on real rays: record a frame's rays, and replay them.

Replaying is interleaved: in every repetition each accelerator takes its turn, in shuffled order, so that a machine that
slows down touches all of them alike. Each turn traces a stream once untimed, to fill the caches that the one before has
filled with its own tree, and then once timed.
"""

from __future__ import annotations

import random
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import mitsuba as mi

from .contenders import Contender, build, differences, triangles_of
from .jobs import Job
from .loading import open_file
from .rendering import Stage, record_frame
from .rendering import load as load_scene
from .spec import parse_spec
from .streams import Stream, can_tell_camera_rays, in_use, load, read_recording, save, split
from .tree_statistics import statistics

SHUFFLE_SEED = 20_240_607


def record(job: Job, stage: Stage) -> dict[str, Any]:
    """Render one frame and write its rays, by kind, to the file `job.streams`."""
    loaded = load_scene(job, stage)
    target = Path(job.streams)
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        file = Path(folder, "rays")
        scene, _ = record_frame(job, loaded, file, stage)
        rays = read_recording(file)
    stage(f"sorting the rays of {job.scene}")
    sensor = scene.sensors()[0]
    if not can_tell_camera_rays(sensor):
        name = sensor.class_name()
        mi.Log(mi.LogLevel.Warn, f"camera rays of the sensor {name} cannot be told apart, so they are bounce rays here")
    streams = split(rays, sensor, job.max_rays)
    save(target, streams, job.header)
    return {"counters": statistics(scene)["counters"]}


def replay(job: Job, stage: Stage) -> dict[str, Any]:
    """Time the rays in `job.streams` under every one of `job.specs`, `job.repeats` times."""
    streams = list(in_use(load(Path(job.streams))))
    stage(f"loading {job.scene}")
    triangles = triangles_of(open_file(job.scene, params=job.params).meshes)
    contenders = []
    for spec in map(parse_spec, job.specs):
        stage(f"building {spec.text}")
        contenders.append(build(spec, triangles))
    stage("counting steps and tests")
    works = {c.spec.text: {s.kind: c.count(s) for s in streams} for c in contenders}
    return {
        "triangles": len(triangles),
        "triangles_sha256": triangles.sha256(),
        "streams": {s.kind: {"sha256": s.sha256(), "rays": len(s), "recorded": s.total} for s in streams},
        "trees": {c.spec.text: c.sha256() for c in contenders},
        "counters": works,
        "differences": _compare_answers(contenders, streams),
        "runs": _time(job, contenders, streams, stage),
    }


def _compare_answers(contenders: Sequence[Contender], streams: Sequence[Stream]) -> dict[str, dict[str, Any]]:
    """How often each accelerator's answers differ from those of the first of our trees, or else of the first."""
    reference = next((c for c in contenders if c.spec.is_tree), contenders[0])
    expected = {stream.kind: reference.answers(stream) for stream in streams}
    return {c.spec.text: {s.kind: differences(c.answers(s), expected[s.kind]) for s in streams} for c in contenders}


def _time(job: Job, contenders: Sequence[Contender], streams: Sequence[Stream], stage: Stage) -> list[dict[str, Any]]:
    """All timed runs, in the order in which they were made."""
    runs = []
    generator = random.Random(SHUFFLE_SEED)
    for repeat in range(job.repeats):
        for place, contender in enumerate(generator.sample(contenders, len(contenders))):
            done = (repeat + place / len(contenders)) / job.repeats
            stage(f"timing {contender.spec.text}, {done:.0%}")
            for stream in streams:
                contender.tree.time(*stream.arrays, stream.any_hit)
                cpu_s, wall_s, misses = contender.tree.time(*stream.arrays, stream.any_hit)
                runs.append(
                    {
                        "spec": contender.spec.text,
                        "stream": stream.kind,
                        "repeat": repeat,
                        "cpu_s": cpu_s,
                        "wall_s": wall_s,
                        "cache_misses": misses,
                    }
                )
    return runs
