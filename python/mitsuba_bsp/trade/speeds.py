"""How fast an accelerator is built and answers: the rays of a frame by kind, and aimed ones that no frame has."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..contenders import build, triangles_of
from ..jobs import Job
from ..loading import open_file, thread_count
from ..ray_jobs import record
from ..spec import parse_spec
from ..streams import KINDS, Stream, in_use, is_recorded, load
from ..verification.oracle import family_rng
from ..verification.rays import FAMILIES
from . import questions

#: Aimed rays that are timed: the two ends of what a ray can be.
AIMED = ("vertex", "random")

#: All kinds of rays that are timed, in the order of tables.
RAYS = (*KINDS, *AIMED)


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Build `job.spec` on all threads; trace each kind of ray on one, first untimed, then timed, then counted."""
    stage(f"loading {job.scene}")
    triangles = triangles_of(open_file(job.scene, params=job.params).meshes)
    streams = [*_recorded(job, stage), *_aimed(job, triangles)]
    stage(f"building {job.spec}")
    spec = parse_spec(job.spec)
    start = time.perf_counter()
    contender = build(spec, triangles)
    build_s = time.perf_counter() - start
    found = {}
    for stream in streams:
        stage(f"timing {stream.kind} rays")
        contender.tree.time(*stream.arrays, stream.any_hit)
        cpu_s, wall_s, _ = contender.tree.time(*stream.arrays, stream.any_hit)
        found[stream.kind] = {
            "rays": len(stream),
            "sha256": stream.sha256(),
            "cpu_s": cpu_s,
            "wall_s": wall_s,
            "counters": contender.count(stream),
        }
    statistics = {key: value for key, value in contender.statistics().items() if not isinstance(value, list)}
    return {
        "streams": found,
        "build_s": build_s,
        "bytes": None if spec.name == "embree" else sum(part.nbytes for part in contender.tree.memory()),
        "statistics": statistics,
        "tree_sha256": contender.sha256(),
    }


def _recorded(job: Job, stage: Callable[[str], None]) -> list[Stream]:
    """The rays of one frame; the first accelerator of a scene that comes here has them recorded for all.

    One thread asks for them, so that they are in the same order wherever they are recorded.
    """
    file = Path(job.arrays).parent.parent / "rays" / f"{Path(job.scene).stem}.npz"
    asked = {"spp": job.spp, "resolution": job.resolution, "seed": job.seed, "max_rays": job.choices["max_rays"]}
    origin = {**asked, "variant": job.variant, "scene_hash": job.header.get("scene_hash")}
    if not is_recorded(file, origin):
        file.parent.mkdir(parents=True, exist_ok=True)
        with thread_count(1):
            record(replace(job, streams=str(file), max_rays=int(job.choices["max_rays"]), header=origin), stage)
    return list(in_use(load(file)))


def _aimed(job: Job, triangles: questions.Triangles) -> list[Stream]:
    mesh, count = questions.mesh_of("", triangles), int(job.choices["max_rays"])
    made = {family: FAMILIES[family](mesh, count, family_rng(questions.SEED, family)) for family in AIMED}
    ends = np.full(count, np.inf, np.float32)
    return [Stream(family, *rays, ends, count) for family, rays in made.items()]
