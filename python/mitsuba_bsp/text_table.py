"""Tables as rows of text, shown on a terminal and written as Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import rich.box
from rich.console import Console
from rich.table import Table
from tabulate import tabulate

from .comparison import Failure

#: Names are wrapped where the terminal is narrow, but do not vanish.
_NAME_WIDTH = 12


@dataclass(frozen=True)
class TextTable:
    """The finished text of one table."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: bool = False  #: the cells are no numbers, so they are not aligned to the right


def print_text_tables(console: Console, tables: Sequence[TextTable], failures: Sequence[Failure]) -> None:
    """Show the tables on a terminal."""
    for found in tables:
        table = Table(
            *found.head, title=found.title, title_justify="left", box=rich.box.SIMPLE_HEAD, padding=(0, 1, 0, 0)
        )
        table.columns[0].min_width, table.columns[0].overflow = _NAME_WIDTH, "fold"
        for column in () if found.words else table.columns[1:]:
            column.justify, column.no_wrap = "right", True
        for row in found.rows:
            table.add_row(*row)
        console.print(table)
    for failure in dict.fromkeys(failures):
        console.print(f"failed: {failure}", style="red", markup=False)


def text_markdown(
    title: str, legend: str, tables: Sequence[TextTable], failures: Sequence[Failure], machine: Mapping[str, str]
) -> str:
    """The same tables as a Markdown file; `legend` explains them, `machine` says what they were measured on."""
    return "\n\n".join((f"# {title}", legend, *_markdown_parts(tables, failures, machine))) + "\n"


def _markdown_parts(
    tables: Sequence[TextTable], failures: Sequence[Failure], machine: Mapping[str, str]
) -> Iterator[str]:
    yield ", ".join(f"{key} {value}" for key, value in machine.items())
    for table in tables:
        yield f"## {table.title}"
        yield tabulate(table.rows, table.head, tablefmt="github", disable_numparse=True)
    yield from (f"Failed: {failure}" for failure in dict.fromkeys(failures))
