"""Nightly: other checks again while a sanitizer or valgrind watches the compiled core; they have nothing to report."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from ..records import ResultsFolder
from .check import Failure, Outcome, Plan, Subject, Unit, check
from .contest import main_subjects, names
from .sanitizers import ADDRESS, MEMCHECK, THREAD, Tool, sources
from .subjects import default_subjects

#: What a watched process takes more of, time and memory, is not judged.
MEASURED = ("time", "memory")


@check("N11a", "no error of memory and nothing undefined, the compiler's sanitizers say")
def addresses(plan: Plan) -> Iterator[Unit]:
    checks = [f"C{number:02}" for number in range(1, 16) if number != 2]  # whose trees are wrong on purpose
    return _units(plan, ADDRESS, {**dict.fromkeys(checks, 0.1), "N08": 0.01}, plan.subjects)


@check("N11t", "no data race, ThreadSanitizer says")
def races(plan: Plan) -> Iterator[Unit]:
    return _units(plan, THREAD, dict.fromkeys(("C01", "C07", "C13", "C14", "C15", "N10"), 0.1), main_subjects(plan))


@check("N11v", "no error of memory, valgrind says")
def memory_errors(plan: Plan) -> Iterator[Unit]:
    checks = ("C01", "C05", "C07", "C14")  # not C15, whose allocations valgrind makes itself
    return _units(plan, MEMCHECK, dict.fromkeys(checks, 0.01), main_subjects(plan))


def _units(plan: Plan, tool: Tool, shares: Mapping[str, float], subjects: tuple[Subject, ...]) -> Iterator[Unit]:
    """Other checks, each with a share of its counts."""
    version = sources()
    yield Unit(f"planted mistakes, {version}", "", lambda: _unless_missing(tool) or _sees(tool))
    for name, share in shares.items() if subjects else ():
        scaled = replace(plan, subjects=subjects, scale=share * plan.scale)
        unit = f"{name}, {names(subjects)}, {version}"
        yield Unit(unit, "", lambda p=scaled, name=name: _unless_missing(tool) or _watch(p, tool, name))


def _unless_missing(tool: Tool) -> Outcome | None:
    """What is found where the tool cannot be used."""
    reason = tool.missing()
    return Outcome(judged=False, what="checks", skipped=reason) if reason else None


def _sees(tool: Tool) -> Outcome:
    """Proof that the tool sees the core."""
    outcome = Outcome(what="mistakes")
    for mistake in tool.mistakes:
        code = f"import drjit; drjit.set_thread_count(8); from mitsuba_bsp import _core; _core.mistakes.{mistake}()"
        with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as folder:
            process, reports = tool.watch(["-c", code], Path(folder))
        # Its place is told by the source, or by the module alone where Mitsuba's libraries confuse the tool.
        places = [report.partition(", from ")[0] for report in reports]
        seen = any("core.cpp" in place or "_core." in place for place in places)
        outcome.expect("unseen", seen, f"{tool.name} does not report {mistake}: {_end(process.stderr)}")
    return outcome


def _watch(plan: Plan, tool: Tool, name: str) -> Outcome:
    """What another check finds, and what is reported meanwhile."""
    outcome = Outcome(what="tries")
    with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as text:
        folder = Path(text)
        command = ["-m", "mitsuba_bsp", "verify", "--only", name, "--out", str(folder / "out")]
        command += ["--seed", str(plan.seed), "--scale", str(plan.scale)]
        if plan.subjects != default_subjects():
            command += ["--specs", *(subject.spec.text for subject in plan.subjects)]
        process, reports = tool.watch(command, folder)
        rows = ResultsFolder(folder / "out").records()
    tried = sum(row["tried"] for row in rows)
    outcome.add("reports", tried, len(reports), lambda: Failure(f"{tool.name}, {name}: {reports[0]}"))
    if not reports:
        sentence = f"{tool.name}, {name}: the process ended with {process.returncode}: {_end(process.stderr)}"
        outcome.expect("end", process.returncode in (0, 1) and bool(rows), sentence)
    for row in rows:
        wrong = sum(count for family, count in row["wrong"].items() if row["judged"] and family not in MEASURED)
        said = "; ".join(row["failures"]) or row["wrong"]
        outcome.add("answers", 0, wrong, lambda said=said: Failure(f"{tool.name}: {said}"))
    return outcome


def _end(text: str) -> str:
    """The last line."""
    return (text.strip().splitlines() or ["it said nothing"])[-1]
