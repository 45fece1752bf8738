"""The child process behind every job: `python -m mitsuba_bsp.worker PARENT ANSWER`.

The job is JSON on standard input. The answer file always says how far the worker got, so that the parent can tell what
killed it.
"""

from __future__ import annotations

import ctypes
import json
import os
import re
import resource
import signal
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from .build_jobs import build, grow
from .frame_jobs import time_frames
from .jobs import Job
from .loading import open_file, parsed_file
from .messages import one_sentence
from .passes import merge, render_pass
from .ray_jobs import record, replay
from .render_setup import fix_block_size, has_box_filter, set_resolution
from .rendering import Stage, construct, load, provenance, render, samples, write_image
from .scene_hash import referenced_file, scene_hash
from .shipping import hash_scene, pack
from .studies import convergence, normals, planes, work
from .studies import slice as cross_section
from .swap import GroupOptions
from .total_jobs import measure_totals
from .trade import failures, speeds
from .tree_statistics import statistics

#: From <linux/prctl.h>.
_PR_SET_PDEATHSIG = 1


def main() -> None:
    """Do the job and write the answer: `values`, or `error` with one sentence, and always the last `stage`."""
    _end_with_parent(int(sys.argv[1]))
    answer = Path(sys.argv[2])
    job = Job(**json.load(sys.stdin))
    reached: dict[str, Any] = {"stage": "starting"}

    def stage(text: str) -> None:
        reached["stage"] = text
        answer.write_text(json.dumps(reached))

    try:
        _set_up(job)
        mi.logger().add_appender(_BuildProgress(lambda: reached["stage"], stage))
        reached["values"] = _KINDS[job.kind](job, stage)
    # Whatever goes wrong is the parent's to report: this process has no other voice.
    except Exception as error:  # noqa: BLE001
        reached["error"] = one_sentence(error)
    answer.write_text(json.dumps(reached))


def _end_with_parent(parent: int) -> None:
    """Let the system kill this process should its parent die, so that it disturbs no measurement of anyone else's."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it was too late for that
        sys.exit(1)


def _set_up(job: Job) -> None:
    mi.set_variant(job.variant)
    mi.set_log_level(mi.LogLevel.Warn)
    formatter = mi.logger().formatter()
    for part in (formatter.set_has_date, formatter.set_has_thread, formatter.set_has_class):
        part(False)
    dr.set_thread_count(job.threads)


class _BuildProgress(mi.Appender):
    """Turns the progress bar of a tree's building into stages."""

    def __init__(self, reached: Callable[[], str], stage: Stage) -> None:
        super().__init__()
        self._reached, self._stage = reached, stage

    def append(self, level: mi.LogLevel, text: str) -> None:
        """Messages are others' business."""

    def log_progress(self, progress: float, name: str, formatted: str, eta: str, payload: object = None) -> None:
        if name.startswith("Building"):
            building = re.sub(r", \d+%$", "", self._reached())
            self._stage(f"{building}, {progress:.0%}")


def _inspect(job: Job, stage: Stage) -> dict[str, Any]:
    """Load a scene and say what a comparison needs to know about it."""
    traits: dict[str, bool] = {}

    def look(state: mi.parser.ParserState) -> None:
        traits.update(box_filter=has_box_filter(state), fixed_blocks=fix_block_size(state))
        if job.resolution:
            set_resolution(state, job.resolution)

    stage(f"loading {job.scene}")
    digest = scene_hash(job.scene, job.params)
    loaded = open_file(job.scene, params=job.params, edit=look)
    scene, _ = construct(job, loaded, stage)
    if scene.integrator() is None or not scene.sensors():
        missing = "integrator" if scene.integrator() is None else "sensor"
        raise ValueError(f"{job.scene} has no {missing}, so there is nothing to render")
    sampler, film = scene.sensors()[0].sampler(), scene.sensors()[0].film()
    if job.spp:
        sampler.set_sample_count(job.spp)
    return traits | {
        "scene_hash": digest,
        "content": asdict(loaded.content),
        "spp": sampler.sample_count(),
        "resolution": [int(side) for side in film.crop_size()],
    }


def _count(job: Job, stage: Stage) -> dict[str, Any]:
    """Render once, untimed, with ray counters and the box filter, and write the image if it has a path."""
    scene, _ = construct(job, load(job, stage, box=True), stage, GroupOptions(count=True, cache=job.cache))
    frame = render(job, scene, stage, samples(job, scene))
    if job.image:
        stage(f"writing {job.image}")
        _write_images(job, scene, frame.pixels)
    return {"statistics": statistics(scene), "pixels_sha256": frame.sha256}


def _time(job: Job, stage: Stage) -> dict[str, Any]:
    """Time building and rendering, after a warm-up render of one sample per pixel."""
    scene, build_s = construct(job, load(job, stage), stage)
    spp = samples(job, scene)
    render(job, scene, stage, spp=1)
    frame = render(job, scene, stage, spp)
    return {
        "build_s": build_s,
        "render_s": frame.wall_s,
        "render_cpu_s": frame.cpu_s,
        "statistics": statistics(scene),
        "pixels_sha256": frame.sha256,
        "peak_rss_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
    }


def _render_once(job: Job, stage: Stage) -> dict[str, Any]:
    """Render the scene as it says and write the image."""
    loaded = load(job, stage)
    scene, build_s = construct(job, loaded, stage)
    frame = render(job, scene, stage, samples(job, scene))
    stage(f"writing {job.image}")
    header = {**provenance(job, scene), "scene_hash": scene_hash(job.scene, job.params)}
    write_image(Path(job.image), frame.pixels, scene.integrator().aov_names(), header)
    return {
        "build_s": build_s,
        "render_s": frame.wall_s,
        "content": asdict(loaded.content),
        "statistics": statistics(scene),
    }


def _blame(job: Job, stage: Stage) -> dict[str, Any]:
    """Read the scene's shape files one by one, announcing each, until one of them kills this process."""
    with parsed_file(job.scene, params=job.params) as (config, state):
        mi.parser.transform_upgrade(config, state)
        for node in state.nodes:
            for key in node.props if node.type == mi.ObjectType.Shape else ():
                file = referenced_file(node.props, key)
                if file is None:
                    continue
                stage(f"reading {file}")
                try:
                    mi.load_dict({"type": node.props.plugin_name(), key: str(file), **_shape_index(node.props)})
                except RuntimeError:  # an ordinary error is not what we are looking for
                    continue
    return {}


def _shape_index(props: mi.Properties) -> dict[str, int]:
    """Which mesh of a `serialized` file a shape is."""
    return {"shape_index": props["shape_index"]} if "shape_index" in props else {}


def _write_images(job: Job, scene: mi.Scene, pixels: np.ndarray) -> None:
    """The EXR file of a comparison and its PNG preview."""
    path, extra = Path(job.image), scene.integrator().aov_names()
    write_image(path, pixels, extra, provenance(job, scene))
    write_image(path.with_suffix(".png"), pixels, extra, {})


_KINDS: dict[str, Callable[[Job, Stage], dict[str, Any]]] = {
    "inspect": _inspect,
    "count": _count,
    "time": _time,
    "render": _render_once,
    "blame": _blame,
    "record": record,
    "replay": replay,
    "frames": time_frames,
    "build": build,
    "grow": grow,
    "totals": measure_totals,
    "work": work.measure,
    "planes": planes.measure,
    "normals": normals.measure,
    "slice": cross_section.measure,
    "converge": convergence.measure,
    "speed": speeds.measure,
    "failures": failures.measure,
    "far": failures.measure_far,
    "pack": pack,
    "hash": hash_scene,
    "pass": render_pass,
    "merge": merge,
}

if __name__ == "__main__":
    main()
