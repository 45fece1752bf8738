"""What the commands of the group `bench` have in common: options, running with a progress bar, tables to leave."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from .comparison import Listener, Options
from .machine import describe
from .terminal import INTERRUPTED, JOB_FAILED, OK, ProgressBar, add_loading_options, out, say
from .text_table import TextTable, print_text_tables, text_markdown


def add_scene_options(sub: argparse.ArgumentParser, default: str = "the built-in scenes") -> None:
    """What every measurement of scenes can be told."""
    sub.add_argument("scenes", nargs="*", type=Path, metavar="SCENE.xml", help=f"default: {default}")
    sub.add_argument("--out", type=Path, metavar="DIR", help="results folder; if it has results, go on from there")
    add_loading_options(sub)


def run_with_bar(options: Options, measure: Callable[[Any, Listener], object]) -> tuple[ProgressBar, int]:
    """Measure with a progress bar; what it has seen, and the exit status."""
    with ProgressBar() as bar:
        try:
            measure(options, bar)
            status = JOB_FAILED if bar.failures else OK
        except KeyboardInterrupt:
            status = INTERRUPTED
    if status == INTERRUPTED:
        say("interrupted", f"what was finished is kept in {options.out}, --out {options.out} goes on from there", "red")
    return bar, status


def show(options: Options, title: str, legend: str, tables: Sequence[TextTable], bar: ProgressBar) -> None:
    """Print the tables and write them into the results folder."""
    text = text_markdown(title, legend, tables, bar.failures, describe())
    (options.out / "table.md").write_text(text, encoding="utf-8")
    print_text_tables(out, tables, bar.failures)
    out.print(f"Results are in {options.out}", soft_wrap=True, markup=False)
