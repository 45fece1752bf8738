"""The command `mitsuba-bsp bench render`."""

from __future__ import annotations

import argparse

from .bench_cli import (
    MIN_REPEATS,
    add_frame_options,
    add_scene_options,
    add_spec_option,
    frame_options,
    run_with_bar,
    show,
)
from .comparison import Options
from .frames import RESOLUTION, SPP, time_scenes
from .terminal import add_scheduler_option, add_threads_option, chosen_scenes


def add_command(kinds: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the group `bench`."""
    sub = kinds.add_parser("render", help="time whole frames; on one thread also with answers that cost nothing")
    add_spec_option(sub)
    add_scene_options(sub)
    add_frame_options(sub, MIN_REPEATS, SPP, RESOLUTION)
    add_threads_option(sub)
    add_scheduler_option(sub)
    sub.set_defaults(run=_bench_render)


def _bench_render(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench render`."""
    fields = frame_options(args, chosen_scenes(args.scenes), "bench-render", MIN_REPEATS, args.specs)
    options = Options(**fields, threads=args.threads, command="bench render")
    bar, status = run_with_bar(options, time_scenes, args.scheduler)
    if bar.scenes:
        show(options.out)
    return status
