"""What the commands of the group `bench` have in common: options, running with a progress bar, tables to leave."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from .comparison import Listener, Options
from .outcomes import failures, write_outcomes
from .records import ResultsFolder
from .scheduling import Scheduler, scheduler_at
from .spec import parse_spec
from .terminal import INTERRUPTED, JOB_FAILED, OK, ProgressBar, add_loading_options, out, positive, say
from .text_table import print_text_tables

#: The accelerators that are compared, and how often at least, where speed is the question.
DEFAULT_SPECS = ("native", "embree", "auto", "kd", "random", "normals", "clustered")
MIN_REPEATS = 7


def add_scene_options(sub: argparse.ArgumentParser, default: str = "the built-in scenes") -> None:
    """What every measurement of scenes can be told."""
    sub.add_argument("scenes", nargs="*", type=Path, metavar="SCENE.xml", help=f"default: {default}")
    sub.add_argument("--out", type=Path, metavar="DIR", help="results folder; if it has results, go on from there")
    add_loading_options(sub)


def add_spec_option(sub: argparse.ArgumentParser) -> None:
    """The accelerators that are compared."""
    sub.add_argument(
        "--specs", nargs="+", default=DEFAULT_SPECS, metavar="SPEC", help=f"default: {' '.join(DEFAULT_SPECS)}"
    )


def add_frame_options(sub: argparse.ArgumentParser, repeats: int, spp: int, resolution: int) -> None:
    """How large a frame is, and how often it is measured."""
    sub.add_argument("--repeats", type=positive, default=repeats, metavar="N", help=f"timed runs, {repeats} or more")
    sub.add_argument("--spp", type=positive, default=spp, metavar="N", help="samples per pixel, default: %(default)s")
    sub.add_argument(
        "--resolution", type=positive, default=resolution, metavar="N", help="longer side, default: %(default)s"
    )


def default_folder(command: str) -> Path:
    """Where a command's results are written unless --out says where; another folder every second."""
    return Path("results", f"{command.replace(' ', '-')}-{datetime.now():%Y%m%d-%H%M%S}")


def common_options(
    args: argparse.Namespace, scenes: tuple[Path, ...], command: str, specs: Sequence[str]
) -> dict[str, Any]:
    """The fields of Options that every command has, checked; `command` is part of the default folder's name."""
    return {
        "scenes": scenes,
        "specs": tuple(parse_spec(text) for text in dict.fromkeys(specs)),
        "out": args.out or default_folder(command),
        "variant": args.variant,
        "params": dict(args.params),
    }


def frame_options(
    args: argparse.Namespace, scenes: tuple[Path, ...], command: str, least: int, specs: Sequence[str]
) -> dict[str, Any]:
    """The same with those of a frame that is measured several times."""
    if args.repeats < least:
        raise ValueError(f"--repeats is {args.repeats}, but it must be at least {least}")
    return {
        **common_options(args, scenes, command, specs),
        "spp": args.spp,
        "resolution": args.resolution,
        "repeats": args.repeats,
    }


def run_with_bar(
    options: Options, measure: Callable[[Any, Listener, Scheduler], object], address: str | None = None
) -> tuple[ProgressBar, int]:
    """Measure with a progress bar, here or on the cluster at `address`; what the bar has seen, and the exit status."""
    with ProgressBar() as bar:
        try:
            with scheduler_at(address) as scheduler:
                measure(options, bar, scheduler)
            status = JOB_FAILED if bar.failures else OK
        except KeyboardInterrupt:
            status = INTERRUPTED
        except ValueError as error:
            if ResultsFolder(options.out).records():
                raise ValueError(f"{error}; {_kept(options)}") from None
            raise
    if status == INTERRUPTED:
        say("interrupted", _kept(options), "red")
    return bar, status


def _kept(options: Options) -> str:
    return f"what was finished is kept in {options.out}, --out {options.out} goes on from there"


def show(path: Path) -> None:
    """Print the tables of everything in a results folder, and write them and the figures into it."""
    tables, figures = write_outcomes(ResultsFolder(path))
    print_text_tables(out, tables, failures(ResultsFolder(path)))
    for file in figures:
        out.print(f"A figure is in {file} and {file.stem}.svg", soft_wrap=True, markup=False)
    out.print(f"Results are in {path}", soft_wrap=True, markup=False)
