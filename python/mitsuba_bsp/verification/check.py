"""The vocabulary of verification: what is verified, what a check is made of, and what it finds.

A check is a function from a plan to units of work, registered by the decorator `check` in a module called `checks_*`.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..spec import Spec
from ..text_table import TextTable

T = TypeVar("T")


@dataclass(frozen=True)
class Subject:
    """An accelerator of this library to verify, and its share of the full counts."""

    spec: Spec
    share: float

    @property
    def promises(self) -> bool:
        """Whether differences break a promise."""
        return self.spec.is_exact

    @property
    def triangle_test(self) -> str:
        return str(self.spec.settings["triangle_test"])

    @property
    def turn(self) -> int:
        """A number that is another one for most subjects."""
        return sum(self.spec.text.encode())

    def part_of(self, things: Sequence[T], every: int) -> Sequence[T]:
        """All of them for a subject with full counts; for others one in `every`, not the same for each subject."""
        return things if self.share == 1 else things[self.turn % every :: every]


@dataclass(frozen=True)
class Plan:
    """What one run verifies."""

    subjects: tuple[Subject, ...]
    incumbents: tuple[Spec, ...] = ()
    seed: int = 1
    scale: float = 1.0  #: of all counts
    folder: Path | None = None  #: where the cases of failures are written

    def count(self, full: float, subject: Subject | None = None) -> int:
        """How many of `full` are tried, at least one; `subject` takes only its share."""
        return max(1, round(full * self.scale * (subject.share if subject else 1)))

    def most(self, full: float, subject: Subject) -> int:
        """How many of `full` are tried at most by anyone with the triangle test of this subject."""
        return max(self.count(full, other) for other in self.subjects if other.triangle_test == subject.triangle_test)

    def rng(self, *names: object) -> np.random.Generator:
        """Random numbers that depend on the seed and these names only."""
        return np.random.default_rng([self.seed, *"/".join(map(str, names)).encode()])

    def share_of(self, spec: str) -> float:
        """The share of the subject that is written so; 1 for incumbents and for what belongs to no spec."""
        return next((subject.share for subject in self.subjects if subject.spec.text == spec), 1.0)

    def full_name(self, spec: str) -> str:
        """The spec spelled out, "" for ""."""
        known = [*(subject.spec for subject in self.subjects), *self.incumbents]
        return next((found.full for found in known if found.text == spec), spec)


@dataclass(frozen=True)
class Failure:
    """One broken promise: a sentence with the seed and hexadecimal floats, and what replays it, if anything can."""

    text: str
    case: Mapping[str, Any] | None = None


#: Of the failures of one unit so many are described, the rest are only counted.
DESCRIBED = 3


@dataclass
class Outcome:
    """What one unit found."""

    tried: int = 0
    what: str = "rays"
    wrong: dict[str, int] = field(default_factory=dict)  #: by family
    failures: list[Failure] = field(default_factory=list)  #: the first few
    figures: dict[str, float | int | str] = field(default_factory=dict)  #: more to print and keep
    judged: bool = True  #: False: reported only
    skipped: str = ""  #: why nothing was tried, if nothing could be

    @property
    def passed(self) -> bool:
        return not self.judged or not any(self.wrong.values())

    def add(self, family: str, tried: int, wrong: int = 0, failure: Callable[[], Failure] | None = None) -> None:
        """Enter what was tried of a family; `failure` describes the first that was wrong, if it is judged."""
        self.tried += tried
        self.wrong[family] = self.wrong.get(family, 0) + wrong
        if wrong and failure and self.judged and len(self.failures) < DESCRIBED:
            self.failures.append(failure())

    def expect(self, family: str, holds: bool, sentence: str) -> None:
        """Enter one thing that is right or wrong as a whole."""
        self.add(family, 1, int(not holds), lambda: Failure(sentence))


@dataclass(frozen=True)
class Unit:
    """A piece of a check that is done or not done; nothing expensive happens before `run` is called."""

    name: str  #: unique within the check
    spec: str  #: "" where it belongs to none
    run: Callable[[], Outcome]


def subject_units(plan: Plan, work: Callable[[Plan, Subject], Outcome]) -> Iterator[Unit]:
    """One unit for every subject."""
    for subject in plan.subjects:
        yield Unit(subject.spec.text, subject.spec.text, lambda subject=subject: work(plan, subject))


Units = Callable[[Plan], Iterator[Unit]]
Record = Mapping[str, Any]


@dataclass(frozen=True)
class Check:
    """A registered check; `tables` makes tables of its records, where the line that every check gets is not enough.

    `at_once`: several of its units may run at the same time, for none of them measures time or changes what others see.
    """

    id: str
    title: str
    units: Units
    tables: Callable[[Sequence[Record]], Sequence[TextTable]] | None = None
    at_once: bool = False

    @property
    def nightly(self) -> bool:
        return self.id.startswith("N")


_CHECKS: dict[str, Check] = {}


def check(
    identity: str,
    title: str,
    tables: Callable[[Sequence[Record]], Sequence[TextTable]] | None = None,
    at_once: bool = False,
) -> Callable[[Units], Units]:
    """Register the decorated function as a check."""

    def register(units: Units) -> Units:
        if identity in _CHECKS:
            raise ValueError(f"there are two checks called {identity}")
        _CHECKS[identity] = Check(identity, title, units, tables, at_once)
        return units

    return register


def all_checks() -> dict[str, Check]:
    """Every check of every module called `checks_*`, by id, in alphabetical order."""
    package = importlib.import_module(__package__)
    for module in pkgutil.iter_modules(package.__path__):
        if module.name.startswith("checks_"):
            importlib.import_module(f"{__package__}.{module.name}")
    return dict(sorted(_CHECKS.items()))


def rate_bound(wrong: int, tried: int) -> float:
    """The rate of failures that is exceeded with a probability of 5 % only, given what was seen: 3/n if none was.

    Exact for rare events (Garwood 1936).
    """
    from scipy.special import gammaincinv

    return min(1.0, float(gammaincinv(wrong + 1, 0.95)) / tried) if tried else 1.0
