"""What a run says about a claim: confirmed, refuted or open, and why."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ..inference import Effect, Finding
from ..speeds import NONE

Word = Literal["confirmed", "refuted", "open"]


@dataclass(frozen=True)
class Evidence:
    """What was found on one scene; `effect` is what is claimed to be below 1 (`less`) or above it (`more`)."""

    scene: str
    effect: Effect
    p: float
    finding: Finding


@dataclass(frozen=True)
class Verdict:
    """A word, and the reason in one sentence."""

    word: Word
    why: str


def judge(expected: Literal["less", "more"], evidence: Sequence[Evidence]) -> Verdict:
    """Confirmed if at least half of the scenes show it beyond noise and none the opposite; refuted likewise."""
    for_it = [item for item in evidence if item.finding == expected]
    against = [item for item in evidence if item.finding in ("less", "more") and item.finding != expected]
    undecided = [item for item in evidence if item not in for_it and item not in against]
    parts = [
        f"{words}: {', '.join(f'{item.scene} {percent_of(item)}' for item in items)}"
        for words, items in (("so on", for_it), ("the opposite on", against), ("no clear difference on", undecided))
        if items
    ]
    why = "; ".join(parts) or "nothing was measured"
    if for_it and not against and len(for_it) >= len(undecided):
        return Verdict("confirmed", why)
    if against and not for_it and len(against) >= len(undecided):
        return Verdict("refuted", why)
    return Verdict("open", why)


def percent(effect: Effect | None) -> str:
    """A ratio in percent, with its interval."""
    if effect is None:
        return NONE
    value, low, high = (100 * x for x in (effect.ratio.value, effect.ratio.low, effect.ratio.high))
    return f"{value:.1f} [{low:.1f}, {high:.1f}]"


def percent_of(item: Evidence) -> str:
    """An effect in percent, as text."""
    return f"{100 * item.effect.ratio.value:.0f} %"
