"""The command `mitsuba-bsp verify`."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from .bench_cli import default_folder
from .messages import choices, hint
from .outcomes import write_outcomes
from .records import ResultsFolder
from .terminal import INTERRUPTED, JOB_FAILED, OK, err, out, positive, say
from .text_table import print_text_tables
from .verification.check import Check, Plan, all_checks
from .verification.replay import replay
from .verification.report import cells, is_verification, own_tables
from .verification.runner import Listener, Result, run
from .verification.subjects import chosen_subjects, default_subjects, incumbents


def add_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command."""
    sub = commands.add_parser("verify", help="aim rays where trees fail, and hold the answers against brute force")
    sub.add_argument("--specs", nargs="+", metavar="SPEC", help="default: every tree in every variant")
    sub.add_argument("--all", action="store_true", help="full counts for every spec, not a tenth for variants")
    sub.add_argument("--nightly", action="store_true", help="the long checks, N01 and on")
    sub.add_argument("--only", nargs="+", metavar="CHECK", help="these checks only, for example C01")
    sub.add_argument(
        "--seed", type=positive, default=1, metavar="N", help="of all random numbers, default: %(default)s"
    )
    sub.add_argument("--scale", type=_share, default=1.0, metavar="X", help="of all counts, default: %(default)s")
    sub.add_argument("--out", type=Path, metavar="DIR", help="results folder; if it has results, go on from there")
    sub.add_argument("--replay", type=Path, metavar="CASE.json", help="ask the rays of a failure again, of everyone")
    sub.set_defaults(run=_verify)


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value <= 1000:
        raise argparse.ArgumentTypeError(f"{text} is not a number above 0 and at most 1000")
    return value


def _verify(args: argparse.Namespace) -> int:
    """`mitsuba-bsp verify`."""
    subjects = chosen_subjects(args.specs) if args.specs else default_subjects(args.all)
    if args.replay:
        return JOB_FAILED if replay(args.replay, [subject.spec for subject in subjects], out) else OK
    checks = _chosen_checks(args.only, args.nightly)
    folder = args.out or default_folder("verify")
    ResultsFolder(folder).check_writable()
    rows = ResultsFolder(folder).records()
    if rows and not is_verification(rows):
        raise ValueError(f"{folder} has the results of another command: give another folder with --out")
    plan = Plan(subjects, incumbents(), args.seed, args.scale, folder)
    with _Bar() as bar:
        try:
            run(checks, plan, bar)
            interrupted = False
        except KeyboardInterrupt:
            interrupted = True
    if bar.results:
        print_text_tables(out, own_tables(bar.results), [])
        write_outcomes(ResultsFolder(folder))
        out.print(f"Results are in {folder}", soft_wrap=True, markup=False)
    if interrupted:
        say("interrupted", f"what was finished is kept in {folder}, --out {folder} goes on from there", "red")
        return INTERRUPTED
    right = all(result.passed and not (args.only and result.skipped) for result in bar.results)
    return OK if right else JOB_FAILED


def _chosen_checks(only: Sequence[str] | None, nightly: bool) -> list[Check]:
    checks = all_checks()
    for name in only or ():
        if name not in checks:
            raise ValueError(f'there is no check "{name}"{hint(name, checks)} (valid: {choices(checks)})')
    if only:
        return [checks[name] for name in dict.fromkeys(only)]
    return [check for check in checks.values() if check.nightly == nightly]


class _Bar(Listener):
    """Shows the current unit, and a line for every check that is done."""

    def __init__(self) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._progress = Progress(*columns, console=err, transient=True)
        self._task = self._progress.add_task("", total=None)
        self.results: list[Result] = []

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def begin(self, check: Check, units: int, kept: int) -> None:
        self._progress.reset(self._task, total=units, completed=kept, description=check.id)

    def unit(self, name: str) -> None:
        self._progress.update(self._task, description=name)

    def unit_done(self) -> None:
        self._progress.advance(self._task)

    def end(self, result: Result) -> None:
        self.results.append(result)
        right = result.passed and not result.skipped
        out.print(_line(result), style=None if right else "red", soft_wrap=True, markup=False)
        for text in (*result.failures[:10], *result.skipped):
            out.print(f"    {text}", style="red", soft_wrap=True, markup=False)


def _line(result: Result) -> str:
    identity, title, specs, tried, wrong, worst, rate, seconds, verdict = cells(result)
    return (
        f"{identity:5} {verdict:8} {title}: {tried}, {wrong} wrong (worst: {worst}; rate {rate}), "
        f"{specs} specs, {seconds} s"
    )
