"""Claims: confirmed, refuted or open."""

from __future__ import annotations

import pytest

from mitsuba_bsp.inference import Effect, Finding
from mitsuba_bsp.intervals import Interval
from mitsuba_bsp.studies.verdicts import Evidence, judge, percent


def evidence(*findings: Finding) -> list[Evidence]:
    values = {"less": 0.8, "more": 1.25, "noise": 1.01, "unclear": 0.9}
    return [
        Evidence(f"s{number}", Effect(Interval(values[word], values[word], values[word]), 0.01), 0.01, word)
        for number, word in enumerate(findings)
    ]


@pytest.mark.parametrize(
    ("findings", "word"),
    [
        (("less", "less"), "confirmed"),
        (("less", "noise"), "confirmed"),
        (("less", "noise", "unclear"), "open"),
        (("less", "more"), "open"),
        (("more", "more", "noise"), "refuted"),
        (("more", "noise", "noise"), "open"),
        (("noise",), "open"),
        ((), "open"),
    ],
)
def test_verdicts_on_less(findings: tuple[Finding, ...], word: str) -> None:
    assert judge("less", evidence(*findings)).word == word


def test_more_is_the_other_way_round() -> None:
    assert judge("more", evidence("more")).word == "confirmed"
    assert judge("more", evidence("less")).word == "refuted"


def test_the_reason_names_the_scenes() -> None:
    why = judge("less", evidence("less", "more", "noise")).why
    assert why == "so on: s0 80 %; the opposite on: s1 125 %; no clear difference on: s2 101 %"
    assert judge("less", []).why == "nothing was measured"


def test_percent() -> None:
    assert percent(Effect(Interval(0.5, 0.25, 0.75), 1)) == "50.0 [25.0, 75.0]"
    assert percent(None) == "-"
