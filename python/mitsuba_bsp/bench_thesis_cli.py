"""The command `mitsuba-bsp bench thesis`."""

from __future__ import annotations

import argparse

from .bench_cli import add_scene_options, common_options, run_with_bar, show
from .comparison import Options
from .terminal import add_scheduler_option, add_threads_option, chosen_scenes, positive
from .thesis import BASELINE, SPECS, count_frames


def add_command(kinds: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the group `bench`."""
    sub = kinds.add_parser("thesis", help="count tests and steps of the thesis's trees, beside its published numbers")
    add_scene_options(sub)
    sub.add_argument(
        "--specs", nargs="+", default=SPECS, metavar="SPEC", help=f"besides {BASELINE}; default: {' '.join(SPECS[1:])}"
    )
    sub.add_argument("--spp", type=positive, metavar="N", help="samples per pixel, default: the scene's")
    sub.add_argument("--resolution", type=positive, metavar="N", help="longer side in pixels, default: the scene's")
    add_threads_option(sub)
    add_scheduler_option(sub)
    sub.set_defaults(run=_bench_thesis)


def _bench_thesis(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench thesis`."""
    options = Options(
        **common_options(args, chosen_scenes(args.scenes), "bench thesis", (BASELINE, *args.specs)),
        threads=args.threads,
        spp=args.spp,
        resolution=args.resolution,
        command="bench thesis",
    )
    for spec in options.specs:
        if not spec.is_tree:
            raise ValueError(f'"{spec.text}" does not count the work for its rays: leave it out of --specs')
    bar, status = run_with_bar(options, count_frames, args.scheduler)
    if bar.scenes:
        show(options.out)
    return status
