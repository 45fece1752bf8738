"""An image rendered in passes: parts of its samples, each with a seed of its own and on one thread, and then averaged.

A pass depends on nothing but the scene and its seed, and passes are added up in their order in double precision, so
that the pixels are the same wherever and in whatever order the passes are rendered.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .comparison import Listener
from .jobs import Job, JobError, JobResult, run_job
from .rendering import Stage, construct, load, provenance, render, samples, write_image
from .scheduling import Scheduler
from .studies.work import save_arrays
from .tree_statistics import statistics

#: An image on a cluster is rendered in so many passes, unless the user says otherwise: as many workers can share it.
PASSES = 16

#: Seeds are below this.
SEEDS = 2**32


def render_in_passes(job: Job, passes: int | None, scheduler: Scheduler, listener: Listener) -> JobResult:
    """Render `job.image` in so many passes, or PASSES if it has as many samples; what the first pass found.

    `passes` is their number, and times are the sums over all. ValueError for anything wrong, JobError if a pass fails.
    """
    about = run_job(replace(job, kind="inspect", spec="embree"))
    spp = int(about.values["spp"])
    passes = passes or min(PASSES, spp)
    if passes > spp:
        raise ValueError(f"--passes is {passes}, but there are {spp} samples per pixel: a pass takes at least one")
    if job.seed + passes > SEEDS:
        raise ValueError(f"--seed is {job.seed}, but {passes} passes take as many seeds, which are below 2^32")
    listener.start([], passes, 0)
    with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as folder:
        files = [str(Path(folder, "passes", f"{number}.npz")) for number in range(passes)]
        parts = [
            replace(job, kind="pass", spp=part, seed=job.seed + number, threads=1, image="", arrays=files[number])
            for number, part in enumerate(shares(spp, passes))
        ]
        found = _rendered(parts, scheduler, listener)
        header = {**found[0].values["header"], "scene_hash": about.values["scene_hash"]}
        run_job(replace(job, kind="merge", header=header, choices={"passes": files}))
    times = {key: sum(result.values[key] for result in found) for key in ("build_s", "render_s")}
    warnings = dict.fromkeys(text for result in (about, *found) for text in result.warnings)
    values = {**found[0].values, **times, "passes": passes}
    return replace(found[0], values=values, warnings=tuple(warnings))


def _rendered(parts: list[Job], scheduler: Scheduler, listener: Listener) -> list[JobResult]:
    """What became of all passes, in their order; JobError if one failed."""
    found: dict[int, JobResult] = {}
    labels = [f"pass {number} of {len(parts)}" for number in range(1, len(parts) + 1)]
    for place, outcome in scheduler.run(zip(labels, parts, strict=True), listener.begin, listener.note):
        if isinstance(outcome, JobError):
            raise outcome
        found[place] = outcome
        listener.finish()
    return [found[place] for place in range(len(parts))]


def shares(spp: int, passes: int) -> list[int]:
    """The samples of each pass; where they cannot be equal, the first ones have one more."""
    least, more = divmod(spp, passes)
    return [least + (number < more) for number in range(passes)]


def render_pass(job: Job, stage: Stage) -> dict[str, Any]:
    """Render one pass; its pixels go into the file `job.arrays`."""
    loaded = load(job, stage)
    scene, build_s = construct(job, loaded, stage)
    frame = render(job, scene, stage, samples(job, scene))
    names = np.array(scene.integrator().aov_names(), np.str_)
    spp = scene.sensors()[0].sampler().sample_count()  # it may have been rounded up
    save_arrays(Path(job.arrays), {"pixels": frame.pixels, "spp": np.array(spp), "names": names})
    return {
        "build_s": build_s,
        "render_s": frame.wall_s,
        "content": asdict(loaded.content),
        "statistics": statistics(scene),
        "header": provenance(job, scene),
    }


def merge(job: Job, stage: Stage) -> dict[str, Any]:
    """Write the mean of the passes in the files `job.choices["passes"]`, by their samples, to `job.image`."""
    files = job.choices["passes"]
    stage(f"writing {job.image}")
    total, spp, names = _sum(Path(file) for file in files)
    seeds = f"{job.seed} to {job.seed + len(files) - 1}" if len(files) > 1 else str(job.seed)
    header = {**job.header, "spp": str(spp), "passes": str(len(files)), "seed": seeds}
    write_image(Path(job.image), (total / spp).astype(np.float32), names, header)
    return {}


def _sum(files: Iterator[Path]) -> tuple[NDArray[np.float64], int, list[str]]:
    """Passes (height, width, channels), each times its samples, added up in their order; all samples; channel names."""
    total, spp, names = np.float64(0), 0, []
    for file in files:
        with np.load(file) as part:
            total = total + part["pixels"].astype(np.float64) * int(part["spp"])
            spp, names = spp + int(part["spp"]), part["names"].tolist()
    return total, spp, names
