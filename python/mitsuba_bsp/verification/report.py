"""The tables of a verification, made from its records alone."""

from __future__ import annotations

from collections.abc import Sequence

from ..comparison import Options
from ..records import Record, ResultsFolder
from ..spec import parse_spec
from ..text_table import TextTable
from .check import all_checks
from .runner import Result

COMMAND = "verify"

_LEGEND = (
    "Rate: failures per try that are exceeded with a probability of 5 % only, given what was seen (3/n if nothing was "
    "wrong). Fast modes and incumbents promise nothing about answers: what they get wrong is reported, not judged."
)

_HEAD = ("check", "title", "specs", "tried", "wrong", "worst", "rate", "s", "verdict")

#: Records with the same of these belong together.
_RUN = ("seed", "scale", "sources")


def is_verification(rows: Sequence[Record]) -> bool:
    """Whether records are those of checks, which say themselves what was asked."""
    return bool(rows) and "check" in rows[0]


def options(folder: ResultsFolder) -> Options:
    """Those of the command, of which only the folder matters here."""
    return Options(scenes=(), specs=(), out=folder.path, variant="", threads=0, params={}, command=COMMAND)


def results(rows: Sequence[Record]) -> list[Result]:
    """What the checks found when they ran last: with the newest seed, counts and sources, by id.

    KeyError for a check that this version does not have.
    """
    newest = [row for row in rows if all(row[key] == rows[-1][key] for key in _RUN)]
    units = {(row["check"], row["unit"], row["spec_full"]): row for row in newest}
    known = all_checks()
    return [
        Result(known[name], tuple(row for (check, _, _), row in units.items() if check == name))
        for name in sorted({check for check, _, _ in units})
    ]


def legend(rows: Sequence[Record]) -> str:
    """What the tables show."""
    return f"Seed {rows[-1]['seed']}, all counts times {rows[-1]['scale']:g}. {_LEGEND}"


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """A line for every check, the checks' own tables, and what failed."""
    found = results(rows)
    overview = TextTable("Checks", _HEAD, tuple(map(cells, found)))
    failed = tuple((result.check.id, text) for result in found for text in result.failures)
    failures = [TextTable("Failures", ("check", "what failed"), failed, words=True)] if failed else []
    unasked = tuple((result.check.id, text) for result in found for text in result.skipped)
    skipped = [TextTable("Skipped", ("check", "why"), unasked, words=True)] if unasked else []
    return [overview, *own_tables(found), *failures, *skipped]


def own_tables(found: Sequence[Result]) -> list[TextTable]:
    """What a line for each check does not say: what is measured and not judged, and the checks' own tables."""
    own = [table for result in found if result.check.tables for table in result.check.tables(result.records)]
    return [*_measured(found), *own]


def _measured(found: Sequence[Result]) -> list[TextTable]:
    """A row for every mode of our trees that promises nothing, over all trees and checks."""
    modes: dict[str, list[Record]] = {}
    for result in found:
        for row in result.records:
            if not row["judged"] and row["what"] == "rays" and row["spec"] and parse_spec(row["spec"]).is_tree:
                tree, _, mode = row["spec"].partition(":")
                modes.setdefault(mode or tree, []).append(row)
    if not modes:
        return []
    title = "What modes that promise nothing get wrong"
    head = ("mode", "rays", "wrong", "per million", "most in", "there most of", "wrong there")
    return [TextTable(title, head, tuple((mode, *_mode_cells(rows)) for mode, rows in modes.items()))]


def _mode_cells(rows: Sequence[Record]) -> tuple[str, ...]:
    tried, wrong = sum(row["tried"] for row in rows), [sum(row["wrong"].values()) for row in rows]
    counts = f"{tried:,}", f"{sum(wrong):,}", f"{1e6 * sum(wrong) / max(1, tried):,.0f}"
    if not any(wrong):
        return (*counts, "-", "-", "-")
    most, worst = max(zip(wrong, rows, strict=True), key=lambda pair: pair[0])
    family = max(worst["wrong"], key=worst["wrong"].get)
    tree = worst["spec"].partition(":")[0]
    return (*counts, f"{tree}, {worst['check']}", family, f"{most:,} of {worst['tried']:,}")


def cells(result: Result) -> tuple[str, ...]:
    """What a check is worth, as text."""
    tried = ", ".join(f"{count:,} {what}" for what, count in result.tried.items())
    worst = next((f"{family} {count:,}" for family, count in result.wrong.items()), "-")
    if result.judged:
        verdict = "passed" if result.passed else "FAILED"
    else:
        verdict = "SKIPPED" if result.skipped else "reported"
    wrong = f"{sum(result.wrong.values()):,}"
    rate = f"< {result.bound:.1e}" if result.judged else "-"
    specs = str(result.specs or "-")
    return result.check.id, result.check.title, specs, tried, wrong, worst, rate, f"{result.seconds:.1f}", verdict
