"""What a worker of a Dask cluster does with our jobs; `cluster` is the other side."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from distributed import get_worker

from .jobs import Job, JobError, JobResult, run_job
from .machine import arithmetic, describe, software
from .scheduling import run_warmed_up
from .shipping import moved, unpack

#: Scenes in which a job was run for nothing, to fill the caches of this machine.
_warm: set[str] = set()


@dataclass(frozen=True)
class Order:
    """A job whose scene is in an archive with this SHA-256: as its main file `scene`, loaded with `params`."""

    job: Job
    archive: str
    scene: str
    params: Mapping[str, str]
    scene_hash: str


@dataclass(frozen=True)
class Cargo:
    """What goes along with an order: the archive, if the worker has not got it, and files that the job reads."""

    archive: bytes | None = None
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Delivery:
    """What a job found, and the contents of the files that it wrote, by the paths that it was told."""

    result: JobResult
    files: Mapping[str, bytes]


@dataclass(frozen=True)
class Introduction:
    """What a worker is: what records say of it, what makes its jobs the same, and what makes their bits the same."""

    machine: Mapping[str, str] = field(default_factory=describe)
    software: Mapping[str, str] = field(default_factory=software)
    arithmetic: Mapping[str, str] = field(default_factory=arithmetic)


class _UnwantedError(Exception):
    """Nobody waits for the job any more."""


def introduce() -> Introduction:
    """The worker that runs this."""
    return Introduction()


def serve(order: Order, cargo: Cargo) -> Delivery:
    """Do a job in the worker's own folder; JobError as from `run_job`, with the paths of whoever ordered it."""
    me = get_worker()
    task = me.get_current_task()

    def on_stage(_: str) -> None:
        state = me.state.tasks.get(task)
        if state is None or state.state != "executing":
            raise _UnwantedError

    root = Path(me.local_directory, "mitsuba-bsp", order.archive)
    places: Mapping[str, Path] = {}
    try:
        if cargo.archive is not None:
            _unpack(order, cargo.archive, root)
        elif not root.is_dir():
            raise FileNotFoundError(f"the folder {root} with {order.job.scene} has gone")
        job, places = moved(order.job, root, order.scene, order.params)
        for path, file in places.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            file.unlink(missing_ok=True)
            if path in cargo.files:
                file.write_bytes(cargo.files[path])
        result = run_warmed_up(job, _warm, on_stage)
        made = {path: places[path].read_bytes() for path in order.job.writes if places[path].is_file()}
    except JobError as error:
        raise JobError(_told(str(error), root, places)) from None
    finally:
        for file in places.values():
            file.unlink(missing_ok=True)
    warnings = tuple(_told(text, root, places) for text in result.warnings)
    return Delivery(replace(result, warnings=warnings), made)


def _told(text: str, root: Path, places: Mapping[str, Path]) -> str:
    """With the paths of whoever ordered the job."""
    for path, file in places.items():
        text = text.replace(str(file), path)
    return text.replace(str(root), "")


def _unpack(order: Order, archive: bytes, root: Path) -> None:
    """Unpack a scene, and make sure that it is the same here: its files, and which of them it finds."""
    unpack(archive, root)
    check = replace(
        order.job, kind="hash", scene=str(root / order.scene), params=order.params, choices=order.job.params
    )
    try:
        if run_job(check).values["scene_hash"] != order.scene_hash:
            raise JobError(f"{order.job.scene} is another scene on {get_worker().address}: it finds other files there")
    except JobError:
        shutil.rmtree(root)
        raise
