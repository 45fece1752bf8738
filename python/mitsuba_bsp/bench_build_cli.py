"""The command `mitsuba-bsp bench build`."""

from __future__ import annotations

import argparse
from pathlib import Path

from . import scenes_dir
from .bench_cli import add_scene_options, common_options, run_with_bar, show
from .build_table import NO_PEAK
from .builds import BuildOptions, measure_builds
from .growth import SIZES
from .records import ResultsFolder
from .terminal import add_scheduler_option, add_threads_option, chosen_scenes, positive, say

DEFAULT_SPECS = ("native", "kd", "normals", "clustered", "random", "rbsp", "ize")
GROWTH_SPECS = ("kd", "normals")

MIN_REPEATS, MIN_GROWTH_REPEATS = 5, 3


def add_command(kinds: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the group `bench`."""
    sub = kinds.add_parser("build", help="time building alone, and the memory that it takes")
    add_scene_options(sub, "the built-in scenes; with --growth the built-in knot")
    sub.add_argument(
        "--specs",
        nargs="+",
        metavar="SPEC",
        help=f"default: {' '.join(DEFAULT_SPECS)}; with --growth {' '.join(GROWTH_SPECS)}",
    )
    sub.add_argument(
        "--repeats",
        type=positive,
        metavar="N",
        help=f"runs of each, {MIN_REPEATS} or more; with --growth {MIN_GROWTH_REPEATS} or more",
    )
    add_threads_option(sub)
    sub.add_argument(
        "--growth", action="store_true", help="tessellate one scene to ever more triangles, fit the growth"
    )
    sub.add_argument(
        "--sizes",
        nargs="+",
        type=positive,
        metavar="N",
        help=f"triangles, only with --growth; default: {' '.join(map(str, SIZES))}",
    )
    add_scheduler_option(sub)
    sub.set_defaults(run=_bench_build)


def _bench_build(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench build`."""
    options = _options(args)
    bar, status = run_with_bar(options, measure_builds, args.scheduler)
    rows = ResultsFolder(options.out).records() if bar.scenes else []
    if any(row["peak_build_bytes"] is None for row in rows):
        say("note", NO_PEAK, "yellow")
    if bar.scenes:
        show(options.out)
    return status


def _options(args: argparse.Namespace) -> BuildOptions:
    """The checked options."""
    least = MIN_GROWTH_REPEATS if args.growth else MIN_REPEATS
    repeats = args.repeats or least
    if repeats < least:
        raise ValueError(f"--repeats is {repeats}, but it must be at least {least}")
    scenes = _growth_scene(args) if args.growth else chosen_scenes(args.scenes)
    specs = args.specs or (GROWTH_SPECS if args.growth else DEFAULT_SPECS)
    options = BuildOptions(
        **common_options(args, scenes, "bench build", specs),
        threads=args.threads,
        repeats=repeats,
        sizes=_sizes(args),
    )
    for spec in options.specs:
        if args.growth and not spec.is_tree:
            raise ValueError(
                f'--growth builds without Mitsuba, where there is no "{spec.text}": leave it out of --specs'
            )
    return options


def _growth_scene(args: argparse.Namespace) -> tuple[Path, ...]:
    if len(args.scenes) > 1:
        raise ValueError(
            f"--growth takes one scene, but there are {len(args.scenes)}: {' '.join(map(str, args.scenes))}"
        )
    return chosen_scenes(args.scenes or [scenes_dir() / "knot.xml"])


def _sizes(args: argparse.Namespace) -> tuple[int, ...]:
    if args.sizes and not args.growth:
        raise ValueError("--sizes goes with --growth only")
    return tuple(args.sizes or SIZES) if args.growth else ()
