"""The command `mitsuba-bsp bench rays`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from .bench_cli import (
    MIN_REPEATS,
    add_frame_options,
    add_scene_options,
    add_spec_option,
    frame_options,
    run_with_bar,
    show,
)
from .bench_rays_table import NO_MISSES
from .records import ResultsFolder
from .replays import RESOLUTION, SPP, RayOptions, replay_scenes
from .terminal import add_scheduler_option, chosen_scenes, positive, say


def add_command(kinds: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the group `bench`."""
    sub = kinds.add_parser("rays", help="replay the rays of a rendered frame on one thread, straight into each tree")
    add_spec_option(sub)
    add_ray_options(sub, repeats=MIN_REPEATS, max_rays=RayOptions.max_rays)
    add_scheduler_option(sub)
    sub.set_defaults(run=_bench_rays)


def add_ray_options(sub: argparse.ArgumentParser, repeats: int, max_rays: int) -> None:
    """What every command that replays rays can be told."""
    add_scene_options(sub)
    add_frame_options(sub, repeats, SPP, RESOLUTION)
    sub.add_argument(
        "--max-rays", type=positive, default=max_rays, metavar="N", help="of each kind, default: %(default)s"
    )


def ray_options(
    args: argparse.Namespace, scenes: tuple[Path, ...], command: str, least: int, specs: Sequence[str]
) -> RayOptions:
    """The checked options; `command` is part of the default folder's name."""
    return RayOptions(
        **frame_options(args, scenes, command, least, specs),
        threads=1,
        max_rays=args.max_rays,
    )


def _bench_rays(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench rays`."""
    options = ray_options(args, chosen_scenes(args.scenes), "bench-rays", MIN_REPEATS, args.specs)
    bar, status = run_with_bar(options, replay_scenes, args.scheduler)
    if bar.scenes:
        if any(row["cache_misses"] is None for row in ResultsFolder(options.out).records()):
            say("note", NO_MISSES, "yellow")
        show(options.out)
    return status
