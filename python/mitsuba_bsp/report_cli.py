"""The command `mitsuba-bsp report`."""

from __future__ import annotations

import argparse
from itertools import count
from pathlib import Path

from .messages import amount
from .records import ResultsFolder
from .report.page import make_page
from .tables_cli import results_folders
from .terminal import OK, err, out, say

NAME = "report.html"


def add_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    sub = commands.add_parser("report", help="write one page about all results in a folder, to look at in a browser")
    sub.add_argument("folder", type=Path, metavar="DIR", help="a results folder, or a folder that has some inside")
    sub.add_argument("--title", help="default: Ray tracing accelerators compared")
    sub.set_defaults(run=_report)


def _report(args: argparse.Namespace) -> int:
    """`mitsuba-bsp report`."""
    folders = results_folders(args.folder)
    ResultsFolder(args.folder).check_writable()
    what = amount(len(folders), "results folder")
    with err.status(f"reading {what}") as status:
        numbers = count(1)

        def begin(name: str) -> None:
            status.update(f"reading {name} ({next(numbers)} of {len(folders)})")

        page = make_page(folders, args.title or "Ray tracing accelerators compared", begin, _left_out)
    file = args.folder / NAME
    file.write_text(page, encoding="utf-8")
    text = f"{file}: {what}, {len(page.encode()) / 1e6:.1f} MB"
    out.print(text, soft_wrap=True, markup=False)
    return OK


def _left_out(sentence: str) -> None:
    say("left out", sentence, "yellow")
