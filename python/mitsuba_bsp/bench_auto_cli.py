"""The command `mitsuba-bsp bench auto`."""

from __future__ import annotations

import argparse

from .bench_cli import add_frame_options, add_scene_options, frame_options, run_with_bar, show
from .comparison import MIN_REPEATS
from .terminal import add_scheduler_option, add_threads_option, chosen_scenes, positive
from .totals import RESOLUTION, SAMPLES, SPP, TotalOptions, time_totals

#: `auto`, the baselines, and the fixed trees of which one is the best.
DEFAULT_SPECS = (
    "auto", "native", "embree", "kd", "kd:bad_refines=0", "kd:bad_refines=0,leaf_size=64", "kd:orientation=scene",
    "normals", "normals:bad_refines=0", "normals:k=9", "clustered", "random", "rbsp",
)  # fmt: skip


def add_command(kinds: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the group `bench`."""
    sub = kinds.add_parser("auto", help="time building and rendering together: auto beside every fixed tree")
    sub.add_argument(
        "--specs", nargs="+", default=DEFAULT_SPECS, metavar="SPEC", help=f"default: {' '.join(DEFAULT_SPECS)}"
    )
    add_scene_options(sub)
    add_frame_options(sub, MIN_REPEATS, SPP, RESOLUTION)
    sub.add_argument(
        "--samples",
        nargs="+",
        type=positive,
        default=SAMPLES,
        metavar="N",
        help="samples per pixel of the pictures; those of more than --spp are reckoned from frames of that many, "
        f"default: {' '.join(map(str, SAMPLES))}",
    )
    sub.add_argument("--turned", type=int, metavar="SEED", help="time the scene turned by a random rotation as well")
    add_threads_option(sub)
    add_scheduler_option(sub)
    sub.set_defaults(run=_bench_auto)


def _bench_auto(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench auto`."""
    fields = frame_options(args, chosen_scenes(args.scenes), "bench-auto", MIN_REPEATS, args.specs)
    samples = tuple(sorted(set(args.samples)))
    options = TotalOptions(**fields, threads=args.threads, samples=samples, turned=args.turned)
    bar, status = run_with_bar(options, time_totals, args.scheduler)
    if bar.scenes:
        show(options.out)
    return status
