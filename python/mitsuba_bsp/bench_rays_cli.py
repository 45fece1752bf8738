"""The command `mitsuba-bsp bench rays`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from .bench_rays_table import LEGEND, NO_MISSES, make_ray_tables
from .loading import VARIANTS
from .machine import describe
from .records import ResultsFolder
from .replays import RESOLUTION, SPP, RayOptions, replay_scenes
from .spec import parse_spec
from .terminal import INTERRUPTED, JOB_FAILED, OK, ProgressBar, chosen_scenes, out, parameter, positive, say
from .text_table import TextTable, print_text_tables, text_markdown

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
    sub.add_argument("scenes", nargs="*", type=Path, metavar="SCENE.xml", help="default: the built-in scenes")
    sub.add_argument("--repeats", type=positive, default=repeats, metavar="N", help=f"timed runs, {repeats} or more")
    sub.add_argument("--out", type=Path, metavar="DIR", help="results folder; if it has results, go on from there")
    sub.add_argument("--spp", type=positive, default=SPP, metavar="N", help="samples per pixel, default: %(default)s")
    sub.add_argument(
        "--resolution", type=positive, default=RESOLUTION, metavar="N", help="longer side, default: %(default)s"
    )
    sub.add_argument(
        "--max-rays", type=positive, default=max_rays, metavar="N", help="of each kind, default: %(default)s"
    )
    sub.add_argument("--variant", choices=VARIANTS, default=VARIANTS[0], help="default: %(default)s")
    sub.add_argument(
        "-D",
        dest="params",
        action="append",
        type=parameter,
        default=[],
        metavar="KEY=VALUE",
        help="set a parameter of the scene",
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


def run_replays(options: RayOptions) -> tuple[ProgressBar, int]:
    """Replay with a progress bar; what it has seen, and the exit status."""
    with ProgressBar() as bar:
        try:
            replay_scenes(options, bar)
            status = JOB_FAILED if bar.failures else OK
        except KeyboardInterrupt:
            status = INTERRUPTED
    if status == INTERRUPTED:
        say("interrupted", f"finished scenes are kept in {options.out}, --out {options.out} goes on from there", "red")
    return bar, status


def show(options: RayOptions, title: str, legend: str, tables: list[TextTable], bar: ProgressBar) -> None:
    """Print the tables and write them into the results folder."""
    text = text_markdown(title, legend, tables, bar.failures, describe())
    (options.out / "table.md").write_text(text, encoding="utf-8")
    print_text_tables(out, tables, bar.failures)
    out.print(f"Results are in {options.out}", soft_wrap=True, markup=False)


def _bench_rays(args: argparse.Namespace) -> int:
    """`mitsuba-bsp bench rays`."""
    options = ray_options(args, chosen_scenes(args.scenes), "bench-rays", MIN_REPEATS, args.specs)
    bar, status = run_replays(options)
    if bar.scenes:
        folder = ResultsFolder(options.out)
        tables = make_ray_tables(bar.scenes, options, folder)
        if any(row["cache_misses"] is None for row in folder.records()):
            say("note", NO_MISSES, "yellow")
        show(options, "Replayed rays", LEGEND, tables, bar)
    return status
