"""Workers that do what those of studies do, in no time and with known results."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mitsuba_bsp import cli
from mitsuba_bsp.jobs import Job, JobError, JobResult, run_job
from mitsuba_bsp.spec import parse_spec

#: Seconds of a frame; a seed adds a hundredth.
SECONDS = {
    "kd": 2.0,
    "normals": 1.0,
    "random": 1.5,
    "clustered": 1.2,
    "rbsp": 1.8,
    "ize": 2.5,
    "native": 4.0,
    "embree": 0.5,
}


def statistics(name: str) -> dict[str, Any]:
    levels = [{"axis_nodes": 3, "oblique_nodes": 1, "leaves": 4, "references": 40, "planes": 9}]
    sizes = [1, 1, 2] + [0] * 30
    return {"triangles": 20, "references": 30, "leaves": 4, "empty_leaves": 1, "bytes": 4e6, "sah_cost": 3.0,
            "leaf_sizes": sizes, "levels": levels} if name not in ("native", "embree") else {}  # fmt: skip


def work(spec: str) -> dict[str, Any]:
    name, tests = parse_spec(spec).name, 10 * SECONDS[parse_spec(spec).name]
    one = {"rays": 100, "axis_steps": 600, "oblique_steps": 200, "leaves_visited": 100, "triangle_tests": 100 * tests}
    spread = {"mean": 2.0, "deviation": 1.0, "quantiles": [x / 10 for x in range(101)]}
    pixels = {"camera": spread, "path": spread}
    return {
        "counters": {"camera": one, "shadow": one, "bounce": one},
        "pixels": {name: pixels for name in ("cost", "steps", "leaves", "tests")},
        "statistics": statistics(name),
        "tree_sha256": "0",
        "axis_area_share": 0.5,
    }


class Workers:
    """Does what workers do, in no time; `failing` are the specs whose jobs fail."""

    def __init__(self) -> None:
        self.jobs: list[Job] = []
        self.failing: set[str] = set()

    def run(self, job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
        if job.kind not in ("time", "work"):
            return run_job(job, on_stage)
        self.jobs.append(job)
        if job.spec in self.failing or job.kind in self.failing:
            raise JobError("the worker was killed")
        if job.kind == "work":
            return JobResult(work(job.spec), ())
        spec = parse_spec(job.spec)
        render_s = SECONDS[spec.name] + int(spec.settings.get("seed", 0)) / 100
        found = {
            "build_s": 0.5,
            "render_s": render_s + 1,
            "render_cpu_s": render_s,
            "peak_rss_bytes": 1,
            "pixels_sha256": "0",
        }
        return JobResult({**found, "statistics": statistics(spec.name)}, ())


def study(*words: str | Path) -> int:
    """The exit status of `study` on one thread, where the time of the processor counts, run in this process."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["study", *map(str, words), "--threads", "1"])
    return caught.value.code
