"""What a worker process does to measure building: the time it takes, and the memory at its worst."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .accelerator import Accelerator
from .contenders import triangles_of
from .growth import tessellate
from .jobs import Job
from .loading import open_file
from .spec import parse_spec
from .tree_statistics import statistics

Stage = Callable[[str], None]


def build(job: Job, stage: Stage) -> dict[str, Any]:
    """Construct a scene from loaded objects, as a comparison does, for any accelerator."""
    stage(f"loading {job.scene}")
    loaded = open_file(job.scene, params=job.params)
    state = loaded.regrouped(parse_spec(job.spec))
    stage(f"building {job.spec} for {job.scene}")
    scene, values = _measured(lambda: loaded.construct(state))
    return {**values, "triangles": loaded.content.triangles, "statistics": statistics(scene)}


def grow(job: Job, stage: Stage) -> dict[str, Any]:
    """Build a tree over a scene's meshes tessellated to `job.triangles`."""
    stage(f"loading {job.scene}")
    vertices, faces = triangles_of(open_file(job.scene, params=job.params).meshes).merged()
    stage(f"tessellating {job.scene} to {job.triangles:,} triangles")
    vertices, faces = tessellate(vertices[faces], job.triangles)
    stage(f"building {job.spec} for {len(faces):,} triangles")
    tree, values = _measured(lambda: Accelerator(vertices, faces, job.spec))
    return {**values, "triangles": len(faces), "statistics": tree.statistics()}


def _measured(make: Callable[[], Any]) -> tuple[Any, dict[str, float | int | None]]:
    """What `make` makes; the seconds, and the bytes by which memory grew meanwhile, None if that cannot be seen."""
    before = _watch_memory()
    start = time.perf_counter()
    made = make()
    build_s = time.perf_counter() - start
    return made, {"build_s": build_s, "peak_build_bytes": None if before is None else _status("VmHWM") - before}


def _watch_memory() -> int | None:
    """Start a new peak of resident memory; the bytes resident now, None where the system keeps the old peak."""
    ctypes.CDLL(None).malloc_trim(0)  # or building would begin with what loading has freed, and seem to take less
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return None
    return _status("VmRSS")


def _status(key: str) -> int:
    """An amount of memory of this process, in bytes."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    kilobytes = next(line.split()[1] for line in lines if line.startswith(f"{key}:"))
    return int(kilobytes) * 1024
