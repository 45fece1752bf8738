"""One-sentence messages, from our own errors and from Mitsuba's."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

_SOURCE_TAG = re.compile(r"\[[\w./]+\.(?:cpp|h|inl|py):\d+\]\s*")
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def one_sentence(error: BaseException | str) -> str:
    """Flatten an error to one line, without Mitsuba's source positions and terminal colours."""
    text = str(error)
    if isinstance(error, MemoryError) and not text:
        text = "out of memory"
    text = _SOURCE_TAG.sub("", _COLOUR.sub("", text))
    text = " ".join(text.split()).replace(": - ", ": ")
    return text or f"{type(error).__name__} without a message"


def amount(count: int, noun: str) -> str:
    """ "1 table", "2 tables"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def choices(names: Iterable[str]) -> str:
    """The valid choices as they appear in a message: "a, b, c"."""
    return ", ".join(names) or "none"


def hint(name: str, names: Iterable[str]) -> str:
    """', did you mean "x"?' when a valid name is close to `name`, else nothing."""
    close = difflib.get_close_matches(name, list(names), n=1)
    return f', did you mean "{close[0]}"?' if close else ""
