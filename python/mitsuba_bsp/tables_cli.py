"""The command `mitsuba-bsp tables`."""

from __future__ import annotations

import argparse
from pathlib import Path

from .messages import amount
from .outcomes import write_outcomes
from .records import ResultsFolder
from .terminal import OK, out


def add_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    sub = commands.add_parser("tables", help="make the tables and figures of results folders again, from their records")
    sub.add_argument(
        "folders", nargs="+", type=Path, metavar="DIR", help="results folders, or folders that have some inside"
    )
    sub.set_defaults(run=_tables)


def _tables(args: argparse.Namespace) -> int:
    """`mitsuba-bsp tables`."""
    for folder in dict.fromkeys(found for path in args.folders for found in results_folders(path)):
        tables, figures = write_outcomes(folder)
        made = f"{amount(len(tables), 'table')}, {amount(len(figures), 'figure')}"
        out.print(f"{folder.path}: {made}", soft_wrap=True, markup=False)
    return OK


def results_folders(path: Path) -> list[ResultsFolder]:
    """Every folder with records in `path`, itself included; ValueError if there is none."""
    if not path.is_dir():
        raise ValueError(f"there is no folder {path}")
    found = [ResultsFolder(file.parent) for file in sorted(path.rglob("records.jsonl"))]
    if not found:
        raise ValueError(f"there are no records in {path}: a results folder has a file records.jsonl")
    return found
