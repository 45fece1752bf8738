"""What a worker process does to time whole frames: it keeps a scene under every accelerator and renders them in turns.

In every repetition each accelerator takes its turn, in shuffled order, so that a machine that slows down touches all of
them alike. On one thread there is one more: `free`, which gives the answers of a recorded frame instead of searching.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import mitsuba as mi

from .expected_rays import with_default_rays
from .exr import channels
from .images import compare_images
from .jobs import FREE, Job
from .loading import LoadedScene
from .rendering import RECORDING_SPEC, Frame, Stage, construct, load, record_frame, render, samples
from .spec import parse_spec
from .swap import GroupOptions

SHUFFLE_SEED = 20_240_607


@dataclass(frozen=True)
class _Contender:
    """A scene under one accelerator; `expected` is the only image that it may make, if there is one."""

    job: Job
    scene: mi.Scene
    expected: Frame | None = None

    def frame(self, stage: Stage) -> Frame:
        """Render it; ValueError if that makes another image than expected."""
        found = render(self.job, self.scene, stage, samples(self.job, self.scene))
        if self.expected and found.sha256 != self.expected.sha256:
            raise ValueError(
                f"{self.job.scene} with the recorded answers of {RECORDING_SPEC} is another image than with "
                f"{RECORDING_SPEC} itself, so that the frame {FREE} would be wrong: use more than one thread, which "
                "leaves it out"
            )
        return found


def time_frames(job: Job, stage: Stage) -> dict[str, Any]:
    """Time `mitsuba.render` under every one of `job.specs`, `job.repeats` times."""
    loaded = load(job, stage)
    contenders = {}
    for text in job.specs:
        own = replace(job, spec=with_default_rays(text))
        contenders[text] = _Contender(own, construct(own, loaded, stage)[0])
    if job.threads == 1 and loaded.meshes:
        contenders[FREE] = _free(job, loaded, stage)
    # Untimed: these warm up, and are looked at.
    images = {name: contender.frame(stage) for name, contender in contenders.items()}
    return {"images": _compare_images(job, contenders, images), "runs": _time(job, contenders, stage)}


def _free(job: Job, loaded: LoadedScene, stage: Stage) -> _Contender:
    """The scene with recorded answers, all of which it has read."""
    file = Path(job.streams)
    try:
        _, expected = record_frame(job, loaded, file, stage)
        scene, _ = construct(replace(job, spec=RECORDING_SPEC), loaded, stage, GroupOptions(replay=file))
    finally:
        file.unlink(missing_ok=True)
    return _Contender(replace(job, spec=FREE), scene, expected)


def _compare_images(
    job: Job, contenders: Mapping[str, _Contender], images: Mapping[str, Frame]
) -> dict[str, dict[str, Any]]:
    """How each image differs from that of the first of our trees, or else of the first accelerator."""
    reference = next((text for text in job.specs if parse_spec(text).is_tree), job.specs[0])
    planes = {
        name: channels(frame.pixels, contenders[name].scene.integrator().aov_names()) for name, frame in images.items()
    }
    return {
        name: {"reference": reference, **asdict(compare_images(found, planes[reference]))}
        for name, found in planes.items()
    }


def _time(job: Job, contenders: Mapping[str, _Contender], stage: Stage) -> list[dict[str, Any]]:
    """All timed runs, in the order in which they were made."""
    runs = []
    generator = random.Random(SHUFFLE_SEED)
    for repeat in range(job.repeats):
        for place, name in enumerate(generator.sample(list(contenders), len(contenders))):
            done = (repeat + place / len(contenders)) / job.repeats
            frame = contenders[name].frame(lambda text, done=done: stage(f"{text}, {done:.0%}"))
            runs.append({"spec": name, "repeat": repeat, "wall_s": frame.wall_s, "cpu_s": frame.cpu_s})
    return runs
