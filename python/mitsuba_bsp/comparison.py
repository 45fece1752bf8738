"""What a comparison is given, what it learns about its scenes, and whom it tells how it goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from .jobs import Job, Kind
from .provenance import made_by
from .records import Record
from .scene_content import Content
from .spec import Spec

MIN_REPEATS = 3

#: The seed of every render, so that all accelerators trace the same paths.
SEED = 0


@dataclass(frozen=True)
class Options:
    """What to compare.

    `spp` and `resolution` (longer side, pixels) of None are the scene's own; `cache` is the folder in which trees are
    kept, None for building all of them every time. `command` is what is run, as the records are told apart by it.
    """

    scenes: tuple[Path, ...]
    specs: tuple[Spec, ...]
    out: Path
    variant: str
    threads: int
    params: Mapping[str, str]
    spp: int | None = None
    resolution: int | None = None
    repeats: int = MIN_REPEATS
    cache: Path | None = None
    command: str = "compare"

    def job(self, kind: Kind, scene: Path, **more: Any) -> Job:
        """A job in one of the scenes; `more` are fields of it that these options do not say, or say otherwise."""
        own = {
            "variant": self.variant,
            "params": self.params,
            "spp": self.spp,
            "resolution": self.resolution,
            "seed": SEED,
            "threads": self.threads,
        }
        return Job(kind, str(scene), **{**own, **more})


@dataclass(frozen=True)
class SceneInfo:
    """A scene that was loaded and looked at before the comparison.

    `content` is what is under accelerators and what is not; `resolution` is width, height.
    `box_filter`: it uses that pixel filter itself. `fixed_blocks`: its integrator can be told its block size.
    """

    name: str
    path: Path
    scene_hash: str
    content: Content
    spp: int
    resolution: Sequence[int]
    box_filter: bool
    fixed_blocks: bool

    @property
    def triangles(self) -> int:
        """Number of triangles under accelerators."""
        return self.content.triangles

    @property
    def comparable(self) -> bool:
        """Whether its images are the same from run to run, so that pixels can be compared bit for bit."""
        return self.fixed_blocks


@dataclass(frozen=True)
class Failure:
    """A job that failed, with the reason in one sentence."""

    scene: str
    spec: str
    message: str

    def __str__(self) -> str:
        return f"{self.scene}, {self.spec}: {self.message}"


class Listener(Protocol):
    """Who is told how the comparison goes."""

    def note(self, text: str) -> None:
        """Something the user should know, in one sentence."""

    def start(self, scenes: Sequence[SceneInfo], jobs: int, done: int) -> None:
        """All is checked; `done` of `jobs` jobs were finished by an earlier run."""

    def begin(self, job: str) -> None:
        """A job begins."""

    def finish(self) -> None:
        """The job is over."""

    def fail(self, failure: Failure) -> None:
        """The job failed."""


def context(options: Options, scene: SceneInfo, machine: Mapping[str, str]) -> Record:
    """What every record of a scene says about how it was made, and on what machine."""
    return {
        "scene": scene.name,
        "scene_hash": scene.scene_hash,
        "variant": options.variant,
        "params": dict(options.params),
        "spp": scene.spp,
        "resolution": list(scene.resolution),
        "seed": SEED,
        "shape_groups": scene.content.shape_groups,
        "instances": scene.content.instances,
        "threads": options.threads,
        "cache": options.cache is not None,
        **machine,
    }


def image_header(scene: SceneInfo, spec: Spec) -> dict[str, str]:
    """What an image says about how it was made, besides what the worker that renders it knows."""
    return {**made_by(scene.name, spec), "scene_hash": scene.scene_hash}
