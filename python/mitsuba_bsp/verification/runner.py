"""Runs the units of checks, and keeps every finished one in a file, so that an interrupted run can go on."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from .. import _core
from ..loading import thread_count
from ..machine import available_threads, describe
from ..messages import one_sentence
from ..records import ResultsFolder, append
from .check import Check, Failure, Outcome, Plan, Record, Unit, rate_bound

#: A unit is finished if a record agrees with it in these.
_IDENTITY = ("check", "unit", "spec_full", "seed", "scale", "share", "sources")
_Identity = tuple[Any, ...]


class Listener:
    """Who is told how a run goes; this one takes no notice."""

    def begin(self, check: Check, units: int, kept: int) -> None:
        """A check starts; so many of its units are known from an earlier run."""

    def unit(self, name: str) -> None:
        """A unit starts."""

    def unit_done(self) -> None:
        """It has ended."""

    def end(self, result: Result) -> None:
        """The check has ended."""


@dataclass(frozen=True)
class Result:
    """All records of one check."""

    check: Check
    records: tuple[Record, ...]

    @property
    def judged(self) -> list[Record]:
        return [row for row in self.records if row["judged"]]

    @property
    def counted(self) -> Sequence[Record]:
        """What its line is about: what is judged, or all of it if nothing is."""
        return self.judged or self.records

    @property
    def passed(self) -> bool:
        return not any(sum(row["wrong"].values()) for row in self.judged)

    @property
    def seconds(self) -> float:
        return sum(row["seconds"] for row in self.records)

    @property
    def specs(self) -> int:
        return len({row["spec"] for row in self.records if row["spec"]})

    @property
    def skipped(self) -> list[str]:
        """Why something was not tried, each reason once."""
        return list(dict.fromkeys(row["skipped"] for row in self.records if row.get("skipped")))

    @property
    def failures(self) -> list[str]:
        return [text for row in self.judged for text in row["failures"]]

    @property
    def wrong(self) -> dict[str, int]:
        """What was wrong, by family, worst first."""
        total: dict[str, int] = {}
        for row in self.counted:
            for family, count in row["wrong"].items():
                total[family] = total.get(family, 0) + count
        return dict(sorted(((k, v) for k, v in total.items() if v), key=lambda item: -item[1]))

    @property
    def tried(self) -> dict[str, int]:
        """How much was tried, by kind."""
        total: dict[str, int] = {}
        for row in self.counted:
            total[row["what"]] = total.get(row["what"], 0) + row["tried"]
        return total

    @property
    def bound(self) -> float:
        """Upper bound (95 %) on the rate of failures of what is judged."""
        return rate_bound(sum(self.wrong.values()), sum(self.tried.values()))


def run(checks: Sequence[Check], plan: Plan, listener: Listener) -> list[Result]:
    """Run what is not finished yet; a KeyboardInterrupt leaves what is."""
    if plan.folder is not None:
        ResultsFolder(plan.folder).prepare("")
    finished = _finished(plan)
    results = []
    for check in checks:
        units = {_identity(check, unit, plan): unit for unit in check.units(plan)}
        todo = {key: unit for key, unit in units.items() if key not in finished}
        listener.begin(check, len(units), len(units) - len(todo))
        for key, found in _outcomes(check, todo, listener):
            finished[key] = _record(check, todo[key], plan, *found)
            listener.unit_done()
        results.append(Result(check, tuple(finished[key] for key in units)))
        listener.end(results[-1])
    return results


def _outcomes(
    check: Check, units: Mapping[_Identity, Unit], listener: Listener
) -> Iterator[tuple[_Identity, tuple[Outcome, float]]]:
    """What each unit finds and the seconds it took, as soon as it is known."""
    if not check.at_once:
        for key, unit in units.items():
            listener.unit(f"{check.id} {unit.name}")
            yield key, run_unit(unit)
        return
    pool = ThreadPoolExecutor(available_threads())
    with thread_count(1):  # each of ours does its own work; more would wait for it, and busily
        try:
            started = {pool.submit(run_unit, unit): key for key, unit in units.items()}
            for future in as_completed(started):
                key = started[future]
                listener.unit(f"{check.id} {units[key].name}")
                yield key, future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def run_unit(unit: Unit) -> tuple[Outcome, float]:
    """What a unit finds, and the seconds it took; an exception is a failure like any other."""
    start = time.perf_counter()
    try:
        outcome = unit.run()
    except Exception as error:  # noqa: BLE001 - whatever it is, the other units have their turn
        outcome = Outcome(what="units")
        text = f"{unit.name}: {type(error).__name__}: {one_sentence(error)}"
        outcome.add("exception", 1, 1, lambda: Failure(text))
    return outcome, time.perf_counter() - start


def _record(check: Check, unit: Unit, plan: Plan, outcome: Outcome, seconds: float) -> Record:
    """What is kept of a unit, also in the folder."""
    row = {
        **dict(zip(_IDENTITY, _identity(check, unit, plan), strict=True)),
        "spec": unit.spec,
        "tried": outcome.tried,
        "what": outcome.what,
        "wrong": outcome.wrong,
        "judged": outcome.judged,
        "skipped": outcome.skipped,
        "figures": outcome.figures,
        "failures": [_kept(failure, check, unit, plan) for failure in outcome.failures],
        "seconds": round(seconds, 3),
        **describe(),
    }
    if plan.folder is not None:
        append(plan.folder / "records.jsonl", row)
    return row


def _kept(failure: Failure, check: Check, unit: Unit, plan: Plan) -> str:
    """The failure's sentence, with the command that replays its case, or else finds it again."""
    if failure.case is None or plan.folder is None:
        own = f" --specs {unit.spec}" if unit.spec and plan.share_of(unit.spec) == 1 else ""
        scale = "" if plan.scale == 1 else f" --scale {plan.scale:g}"
        return f"{failure.text}; again: mitsuba-bsp verify --only {check.id}{own} --seed {plan.seed}{scale}"
    content = json.dumps(failure.case, indent=1) + "\n"
    file = plan.folder / "cases" / f"{check.id}-{hashlib.sha256(content.encode()).hexdigest()[:12]}.json"
    file.parent.mkdir(exist_ok=True)
    file.write_text(content, encoding="utf-8")
    return f"{failure.text}; replay it: mitsuba-bsp verify --replay {file}"


def _identity(check: Check, unit: Unit, plan: Plan) -> _Identity:
    full = plan.full_name(unit.spec)
    return check.id, unit.name, full, plan.seed, plan.scale, plan.share_of(unit.spec), _sources()


def _finished(plan: Plan) -> dict[_Identity, Record]:
    """The records of earlier runs into the folder; units that were skipped or ended in an exception are tried again."""
    if plan.folder is None:
        return {}
    rows: list[Mapping[str, Any]] = ResultsFolder(plan.folder).records()
    finished = (row for row in rows if "exception" not in row["wrong"] and not row.get("skipped"))
    return {tuple(row[key] for key in _IDENTITY): row for row in finished}


@cache
def _sources() -> str:
    """A digest of what decides the answers: the compiled core and the checks."""
    digest = hashlib.sha256(Path(_core.__file__).read_bytes())
    for file in sorted(Path(__file__).parent.rglob("*.*")):
        if file.suffix in (".py", ".json"):
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
