"""The sentences of the thesis's draft (`claim_list`), each with a verdict.

A claim is judged scene by scene, all its pairs of trees together, and the evidence of every pair is listed.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..figures import GUIDE, new_figure, plain
from ..inference import Effect, adjusted, finding, pooled_effect
from ..records import Record, ResultsFolder
from ..speeds import NONE
from ..text_table import TextTable
from .claim_list import AXES_PAIRS, CLAIMS, Claim
from .runs import RENDER, Runs
from .study import Cell, Study, StudyOptions, timed_and_counted
from .verdicts import Evidence, Verdict, judge, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {"confirmed": "#009E73", "refuted": "#D55E00", "open": "#0072B2"}

_LEGEND = (
    "Sentences of the draft, each about pairs of trees. Effects are medians over repetitions with 95 % bootstrap "
    "intervals; trees that draw directions have another seed in each repetition, and pairs share their seed. "
    "Confirmed: at least half of the scenes show it beyond the noise and none the opposite; refuted: the other way "
    "round; open: neither. Probabilities are Wilcoxon's for a scene or all of them, Student's for a pair of trees; "
    "those of a claim are corrected for their number (Benjamini, Hochberg)."
)


@dataclass(frozen=True)
class Judged:
    """A claim, and what was found: on each scene, over all of them, and the verdict."""

    claim: Claim
    scenes: list[Evidence]
    overall: Effect | None
    verdict: Verdict


def plan(options: StudyOptions) -> list[Cell]:
    """Every tree that a claim names."""
    trees = [tree for claim in CLAIMS for pair in claim.pairs for tree in pair]
    return timed_and_counted(list(dict.fromkeys(trees)), options.repeats)


def judge_claim(runs: Runs, claim: Claim) -> Judged:
    """The verdict on a claim."""
    ratios = {scene: _ratios(runs, claim, scene) for scene in runs.scenes}
    effects = {scene: pooled_effect(found) for scene, found in ratios.items()}
    corrected = adjusted(list(effects.values()))
    evidence = [
        Evidence(scene, effect, p, finding(effect, p, _limit(runs, claim)))
        for (scene, effect), p in zip(effects.items(), corrected, strict=True)
        if effect
    ]
    overall = pooled_effect([ratio for found in ratios.values() for ratio in found])
    return Judged(claim, evidence, overall, judge(claim.expected, evidence))


def _ratios(runs: Runs, claim: Claim, scene: str) -> list[float]:
    """Of all pairs of a claim."""
    return [ratio for pair in claim.pairs for ratio in runs.ratios(scene, *pair, claim.quantity)]


def _limit(runs: Runs, claim: Claim) -> float:
    """What a difference must exceed: counters have no noise."""
    return 0.0 if claim.quantity.counted else runs.noise()


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The verdicts; whether the axes help more in scenes that are more axis-aligned; and the evidence of each claim."""
    runs = Runs(rows)
    found = [judge_claim(runs, claim) for claim in CLAIMS]
    verdicts = TextTable(
        f"verdicts (noise {runs.noise():.1%})",
        ("claim", "found, %", "p", "verdict", "why"),
        tuple((own.claim.sentence, percent(own.overall), _p(own.overall), *_words(own.verdict)) for own in found),
    )
    return [verdicts, _axes_table(runs), *(_evidence_table(runs, claim) for claim in CLAIMS)]


def _p(effect: Effect | None) -> str:
    return f"{effect.p:.2g}" if effect else NONE


def _words(verdict: Verdict) -> tuple[str, str]:
    return verdict.word, verdict.why


def _axes_table(runs: Runs) -> TextTable:
    from scipy.stats import permutation_test, spearmanr

    tree = AXES_PAIRS[0][0]
    claim = next(claim for claim in CLAIMS if claim.pairs == AXES_PAIRS and claim.quantity == RENDER)
    shares = {scene: row["axis_area_share"] for scene in runs.scenes if (row := runs.first(scene, "work", tree))}
    gains = {scene: effect for scene in shares if (effect := pooled_effect(_ratios(runs, claim, scene)))}
    columns = [shares[scene] for scene in gains], [effect.ratio.value for effect in gains.values()]
    title = "the axes help because scenes are partly axis-aligned: "
    if len(gains) > 2 and all(np.ptp(column) > 0 for column in columns):
        # Scenes are few, so that all orders can be tried.
        found = permutation_test(
            columns[1:],
            lambda gains: spearmanr(columns[0], gains).statistic,
            permutation_type="pairings",
            alternative="less",
            rng=0,
        )
        title += f"rank correlation {found.statistic:.2f} (p {found.pvalue:.2g}); below 0 is claimed"
    else:
        title += "too few scenes for a correlation"
    return TextTable(
        title,
        ("scene", "area within a degree of an axis", "time with the axes, % of without"),
        tuple((scene, f"{shares[scene]:.0%}", percent(effect)) for scene, effect in gains.items()),
    )


def _evidence_table(runs: Runs, claim: Claim) -> TextTable:
    effects = {(s, pair): runs.effect(s, *pair, claim.quantity) for s in runs.scenes for pair in claim.pairs}
    corrected = adjusted(list(effects.values()))
    limit = _limit(runs, claim)
    return TextTable(
        f"{claim.sentence} ({claim.quantity.name})",
        ("scene", "tree", "against", "%", "p", "finding"),
        tuple(
            (scene, *pair, percent(effect), f"{p:.2g}", finding(effect, p, limit))
            for ((scene, pair), effect), p in zip(effects.items(), corrected, strict=True)
            if effect
        ),
    )


def figures(rows: Sequence[Record], _: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """One line a claim: what was found over all scenes, and a stroke for each."""
    runs = Runs(rows)
    found = [judge_claim(runs, claim) for claim in reversed(CLAIMS)]
    figure = new_figure(10, 0.7 + 0.62 * len(found))
    axes = figure.add_subplot(xscale="log", xlabel="% of what it is held against")
    axes.axvline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    for place, own in enumerate(found):
        _draw(axes, place, own)
    axes.set_yticks(range(len(found)), [textwrap.fill(own.claim.sentence, 48) for own in found], fontsize=8)
    for which in ("major", "minor"):
        axes.tick_params(axis="x", which=which, labelsize=8)
        getattr(axes.xaxis, f"set_{which}_formatter")("{x:g}")
    plain(axes)
    yield "claims", figure


def _draw(axes: Axes, place: int, own: Judged) -> None:
    colour = _COLOURS[own.verdict.word]
    for item in own.scenes:
        axes.plot(100 * item.effect.ratio.value, place, "|", color="0.4", markersize=9)
    if own.overall:
        ratio = own.overall.ratio
        axes.plot([100 * ratio.low, 100 * ratio.high], [place, place], color=colour, linewidth=2)
        axes.plot(100 * ratio.value, place, "o", color=colour, markersize=5)
    claimed = "◀" if own.claim.expected == "less" else "▶"
    axes.annotate(
        f"{claimed} {own.verdict.word}", (1.01, place), xycoords=("axes fraction", "data"), va="center", fontsize=9,
        color=colour,
    )  # fmt: skip


STUDY = Study(
    name="claims",
    help="the draft's own sentences, each with a verdict",
    title="Claims and verdicts",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    repeats=6,
    least_repeats=3,
    repeated="seeds of each tree, and timed runs of those without a seed",
)
