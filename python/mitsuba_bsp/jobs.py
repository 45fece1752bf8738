"""Run one job in a fresh Python process, so that nothing (not even a crash) passes from one job to the next."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

from .machine import describe
from .messages import one_sentence

Kind = Literal[
    "inspect", "count", "time", "render", "blame", "record", "replay", "frames", "build", "grow",
    "totals", "work", "planes", "normals", "slice", "speed", "failures", "far", "converge",
    "pack", "hash", "pass", "merge",
]  # fmt: skip

#: How an accelerator that gives recorded answers is called beside the specs.
FREE = "free"


#: How often a worker is asked what it is doing.
STAGE_INTERVAL_S = 0.25


class JobError(RuntimeError):
    """A job failed; the text is one sentence."""


@dataclass(frozen=True)
class Job:
    """What a worker process is to do with one scene.

    `inspect` loads it and describes it; `count` renders it with ray counters and the box filter; `time` measures
    building and rendering; `render` makes an image as the scene says; `blame` reads its mesh files one by one.
    `record` renders it once and writes its rays to `streams`; `replay` times those rays under each of `specs`.
    `frames` times rendering under each of `specs`, on one thread with recorded answers too, which are in the file
    `streams` for a moment.
    `totals` times building and rendering under each of `specs`, for the pictures that `choices` name.
    `build` measures building alone; `grow` likewise, of a tree over its meshes tessellated to `triangles`.
    `work` counts what the rays of a frame cost under `spec`; `planes`, `normals` and `slice` look at the tree itself:
    see the modules of these names in `studies`, where `converge` is in `convergence`. `speed`, `failures` and `far`
    are those of `trade`. What these find besides numbers goes into the file `arrays`; `choices` are the options of the
    study.
    `pack` makes a scene ready to be sent away, `hash` looks at what has arrived, see `shipping`; `pass` renders a part
    of an image's samples, which `merge` puts together, see `passes`.
    `image` is the path of the EXR or PNG file to write, if any, `header` goes into the EXR file's header.
    `cache` is the folder in which trees are kept, if any.
    """

    kind: Kind
    scene: str
    variant: str
    spec: str = "embree"
    params: Mapping[str, str] = field(default_factory=dict)
    spp: int | None = None
    resolution: int | None = None
    seed: int = 0
    threads: int = 1
    image: str = ""
    header: Mapping[str, str] = field(default_factory=dict)
    cache: str = ""
    specs: Sequence[str] = ()
    repeats: int = 0
    streams: str = ""
    max_rays: int = 0
    triangles: int = 0
    arrays: str = ""
    choices: Mapping[str, Any] = field(default_factory=dict)

    @property
    def reads(self) -> tuple[str, ...]:
        """Files, besides those of the scene, that another job must have written."""
        return (self.streams,) if self.kind == "replay" else ()

    @property
    def writes(self) -> tuple[str, ...]:
        """Files that it leaves, as far as it makes what they are for."""
        preview = str(Path(self.image).with_suffix(".png")) if self.image else ""
        files = dict.fromkeys((self.image, preview, self.arrays, self.streams))
        return tuple(file for file in files if file and file not in self.reads)


def _now() -> str:
    return datetime.now().isoformat(timespec="seconds")


@dataclass(frozen=True)
class JobResult:
    """What the worker measured, and the warnings that Mitsuba and its plugins logged meanwhile.

    `machine` is what it ran on, as records say it; `started` when, in the local time of that machine.
    """

    values: Mapping[str, Any]
    warnings: tuple[str, ...]
    machine: Mapping[str, str] = field(default_factory=describe)
    started: str = field(default_factory=_now, compare=False)


def run_job(job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
    """Run `job` in a child process and return what it found; JobError if it failed or died.

    `on_stage` is told what the worker is doing, a few times a second.
    """
    started = _now()
    with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as folder:
        answer = Path(folder, "answer.json")
        status, output = _run_worker(job, answer, on_stage)
        found = json.loads(answer.read_text()) if answer.exists() else {"stage": "starting"}
    if "error" in found:
        raise JobError(found["error"])
    if status != 0 or "values" not in found:
        raise JobError(_death(job, status, found["stage"], output))
    return JobResult(found["values"], tuple(dict.fromkeys(_WARNING.findall(output))), started=started)


#: A warning as the worker's log formatter writes it, with or without terminal colours.
_WARNING = re.compile(r"^(?:\x1b\[\d+m)*WARN\s+(.*?)(?:\x1b\[0m)?$", re.MULTILINE)


def _run_worker(job: Job, answer: Path, on_stage: Callable[[str], None] | None = None) -> tuple[int, str]:
    """Exit status (negative: the signal that killed it) and output of a worker process."""
    command = [sys.executable, "-P", "-m", "mitsuba_bsp.worker", str(os.getpid()), str(answer)]
    # A session of its own: Ctrl-C reaches this process only, which then ends the worker.
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
    )
    try:
        output = _wait(process, json.dumps(asdict(job)), answer, on_stage)
    finally:
        if process.poll() is None:
            process.kill()
            process.wait()
    return process.returncode, output


def _wait(process: subprocess.Popen[str], job: str, answer: Path, on_stage: Callable[[str], None] | None) -> str:
    """Give a worker its job, pass on what it says that it is doing, and return its output."""
    unsent: str | None = job
    while True:
        try:
            return process.communicate(unsent, timeout=STAGE_INTERVAL_S if on_stage else None)[0]
        except subprocess.TimeoutExpired:
            unsent = None
            on_stage(_stage(answer))


def _stage(answer: Path) -> str:
    """What the worker says that it is doing, unless it is just writing it down."""
    try:
        return json.loads(answer.read_text())["stage"]
    except (OSError, ValueError):
        return "starting"


def _death(job: Job, status: int, stage: str, output: str) -> str:
    """One sentence on a worker that ended without an answer."""
    if status >= 0:
        last = output.strip().splitlines()[-1:] or ["no output"]
        return f"the worker ended with status {status} while {stage}: {one_sentence(last[0])}"
    name = signal.Signals(-status).name
    if name == "SIGKILL":
        return f"the worker was killed while {stage}, probably because memory ran out"
    if stage.startswith("loading") and job.kind != "blame":
        mesh = _blamed_mesh(job)
        if mesh:
            return f"Mitsuba's own loader died ({name}) reading the mesh file {mesh}, which {job.scene} uses"
    return f"Mitsuba died ({name}) while {stage}"


def _blamed_mesh(job: Job) -> str | None:
    """The mesh file on which Mitsuba's loader dies, found by reading them one by one in another process."""
    with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as folder:
        answer = Path(folder, "answer.json")
        status, _ = _run_worker(replace(job, kind="blame"), answer)
        found = json.loads(answer.read_text()) if answer.exists() else {}
    return found.get("stage", "").removeprefix("reading ") if status < 0 else None
