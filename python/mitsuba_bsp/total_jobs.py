"""What a worker process does to time building and rendering together: a scene's accelerators, built and used in turns.

A frame's time grows with its samples, so that of many samples is measured with few. `auto` is told how many there will
be, and builds its tree for them.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any

from .expected_rays import AUTO, with_expected_rays
from .frame_jobs import SHUFFLE_SEED
from .jobs import Job
from .loading import LoadedScene
from .rendering import Stage, construct, load, render
from .spec import parse_spec
from .tree_statistics import statistics


@dataclass(frozen=True)
class Turn:
    """An accelerator in the scene as it is or turned; `spp`: for how many samples `auto` chooses, 0 for the others."""

    spec: str
    spp: int
    turned: bool


def turns(specs: list[str], samples: list[int], turned: bool) -> list[Turn]:
    """All of a repetition."""
    places = (False, True) if turned else (False,)
    return [
        Turn(spec, spp, place)
        for place in places
        for spec in specs
        for spp in (samples if parse_spec(spec).name == AUTO else [0])
    ]


def measure_totals(job: Job, stage: Stage) -> dict[str, Any]:
    """Build every one of `job.specs` and render frames of few samples under it, `job.repeats` times.

    Of `job.choices`, `samples` are the frames of interest, `turned` says whether the scene is turned as well.
    """
    samples, seed = list(job.choices["samples"]), job.choices["turned"]
    scenes = {False: load(job, stage)}
    if seed is not None:
        scenes[True] = load(job, stage, turned=seed)
    all_turns = turns(list(job.specs), samples, seed is not None)
    generator, runs = random.Random(SHUFFLE_SEED), []
    _run(job, Turn(job.specs[0], samples[0], False), scenes[False], [1], stage)  # warms up
    for repeat in range(job.repeats):
        for place, turn in enumerate(generator.sample(all_turns, len(all_turns))):
            done = (repeat + place / len(all_turns)) / job.repeats
            measured = sorted({min(job.spp, spp) for spp in ([turn.spp] if turn.spp else samples)})
            found = _run(job, turn, scenes[turn.turned], measured, lambda text, done=done: stage(f"{text}, {done:.0%}"))
            runs.append({"repeat": repeat, "spec": turn.spec, "for_spp": turn.spp, "turned": turn.turned, **found})
    return {"runs": runs}


def _run(job: Job, turn: Turn, loaded: LoadedScene, measured: list[int], stage: Stage) -> dict[str, Any]:
    spec = with_expected_rays(parse_spec(turn.spec), loaded.sensor, turn.spp)
    scene, build_s = construct(replace(job, spec=spec.full if turn.spp else spec.text), loaded, stage)
    frames = {str(spp): render(job, scene, stage, spp).wall_s for spp in measured}
    stats = statistics(scene)
    chosen = {key: stats.get(key) for key in ("chosen", "choice", "choose_s", "predicted_build_s", "predicted_trace_s")}
    return {"build_s": build_s, "tree_s": stats.get("build_s"), "frames_s": frames, **chosen}
