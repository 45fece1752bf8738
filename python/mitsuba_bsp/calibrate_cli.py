"""The command `mitsuba-bsp calibrate`."""

from __future__ import annotations

import argparse
from dataclasses import replace

from .bench_cli import run_with_bar, show
from .bench_rays_cli import add_ray_options, ray_options
from .calibration import SETTINGS, SPECS
from .replays import replay_scenes
from .spec import with_setting
from .terminal import INTERRUPTED, chosen_scenes

MIN_REPEATS = 3

#: Enough for counters per ray that are as good as those of the whole frame.
MAX_RAYS = 100_000


def add_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    sub = commands.add_parser("calibrate", help="measure what a step and a triangle test cost, the prices of trees")
    add_ray_options(sub, repeats=MIN_REPEATS, max_rays=MAX_RAYS)
    sub.add_argument(
        "--layout",
        choices=list(SETTINGS),
        default=next(iter(SETTINGS)),
        help="of the nodes, default: %(default)s",
    )
    sub.set_defaults(run=_calibrate)


def _calibrate(args: argparse.Namespace) -> int:
    """`mitsuba-bsp calibrate`."""
    scenes = tuple(dict.fromkeys((*chosen_scenes(()), *chosen_scenes(args.scenes))))
    specs = [with_setting(spec, f"layout={args.layout}") for spec in SPECS]
    options = replace(ray_options(args, scenes, "calibrate", MIN_REPEATS, specs), command="calibrate")
    bar, status = run_with_bar(options, replay_scenes)
    if bar.scenes and status != INTERRUPTED:
        show(options.out)
    return status
