"""The command `mitsuba-bsp bench rays`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from .bench_cli import add_scene_options, run_with_bar, show
from .bench_rays_table import LEGEND, NO_MISSES, make_ray_tables
from .records import ResultsFolder
from .replays import RESOLUTION, SPP, RayOptions, replay_scenes
from .spec import parse_spec
from .terminal import chosen_scenes, positive, say

DEFAULT_SPECS = ("native", "embree", "kd", "random", "normals", "clustered")

MIN_REPEATS = 7


def add_command(kinds: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the group `bench`."""
    sub = kinds.add_parser("rays", help="replay the rays of a rendered frame on one thread, straight into each tree")
    sub.add_argument(
        "--specs", nargs="+", default=DEFAULT_SPECS, metavar="SPEC", help=f"default: {' '.join(DEFAULT_SPECS)}"
    )
    add_ray_options(sub, repeats=MIN_REPEATS, max_rays=RayOptions.max_rays)
    sub.set_defaults(run=_bench_rays)


def add_ray_options(sub: argparse.ArgumentParser, repeats: int, max_rays: int) -> None:
    """What every command that replays rays can be told."""
    add_scene_options(sub)
    sub.add_argument("--repeats", type=positive, default=repeats, metavar="N", help=f"timed runs, {repeats} or more")
    sub.add_argument("--spp", type=positive, default=SPP, metavar="N", help="samples per pixel, default: %(default)s")
    sub.add_argument(
        "--resolution", type=positive, default=RESOLUTION, metavar="N", help="longer side, default: %(default)s"
    )
    sub.add_argument(
        "--max-rays", type=positive, default=max_rays, metavar="N", help="of each kind, default: %(default)s"
    )


def ray_options(
    args: argparse.Namespace, scenes: tuple[Path, ...], command: str, least: int, specs: Sequence[str]
) -> RayOptions:
    """The checked options; `command` is part of the default folder's name."""
    if args.repeats < least:
        raise ValueError(f"--repeats is {args.repeats}, but it must be at least {least}")
    return RayOptions(
        scenes=scenes,
        specs=tuple(parse_spec(text) for text in dict.fromkeys(specs)),
        out=args.out or Path("results", f"{command}-{datetime.now():%Y%m%d-%H%M%S}"),
        variant=args.variant,
        threads=1,
        params=dict(args.params),
        spp=args.spp,
        resolution=args.resolution,
        repeats=args.repeats,
        max_rays=args.max_rays,
    )


def _bench_rays(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench rays`."""
    options = ray_options(args, chosen_scenes(args.scenes), "bench-rays", MIN_REPEATS, args.specs)
    bar, status = run_with_bar(options, replay_scenes)
    if bar.scenes:
        folder = ResultsFolder(options.out)
        tables = make_ray_tables(bar.scenes, options, folder)
        if any(row["cache_misses"] is None for row in folder.records()):
            say("note", NO_MISSES, "yellow")
        show(options, "Replayed rays", LEGEND, tables, bar)
    return status
