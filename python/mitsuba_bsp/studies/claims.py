"""The sentences of the thesis's draft (`claim_list`), each with a verdict.

A claim is judged scene by scene, all its pairs of trees together, and the evidence of every pair is listed.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from statistics import geometric_mean
from typing import TYPE_CHECKING

import numpy as np

from ..figures import GUIDE, new_figure, plain
from ..inference import ALPHA, Effect, adjusted, effect_of, effect_over_scenes, finding
from ..records import Record, ResultsFolder
from ..speeds import NONE
from ..text_table import TextTable
from .claim_list import ALIGNMENT, AXES_PAIRS, CLAIMS, Claim
from .runs import RENDER, Runs
from .study import Cell, Study, StudyOptions, timed_and_counted
from .verdicts import Evidence, Verdict, judge, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {"confirmed": "#009E73", "refuted": "#D55E00", "open": "#0072B2"}

_XLABEL = "% of what it is held against; strokes: scenes; dot and bar: all of them, with the 95 % interval"

_LEGEND = (
    "Sentences of the draft, each about pairs of trees. The effect on a scene is the geometric mean over the pairs, "
    "its median over repetitions; trees that draw directions have another seed in each repetition, and pairs share "
    "their seed. Over all scenes it is the geometric mean of theirs. Intervals are bootstraps (95 %) of repetitions "
    "or of scenes. Confirmed: at least half of the scenes show it beyond the noise and none the opposite; refuted: "
    "the other way round; open: neither. The noise is that of as many runs of one and the same tree on the scene (of "
    "pairs of different trees, that of their mean), at least 5 %; counters have none, but those within 1 % are called "
    "alike. Probabilities are Wilcoxon's over scenes, Student's for a scene or a pair of trees; those of a claim are "
    "corrected for their number (Benjamini, Hochberg). That the axes help because scenes are partly axis-aligned is "
    "judged by the ranks of scenes: those of the time with the axes against those of the area along them, in whole "
    "percent; open if chance gives such a correlation more often than one time in twenty, or if the times of scenes "
    "differ by no more than the noise."
)


@dataclass(frozen=True)
class Judged:
    """A claim, and what was found: on each scene, over all of them, and the verdict.

    `correlation` is what is claimed of the scenes together; there is no effect over all of them then.
    """

    claim: Claim
    scenes: list[Evidence]
    overall: Effect | None
    verdict: Verdict
    correlation: Correlation | None = None


@dataclass(frozen=True)
class Correlation:
    """A rank correlation, and how probable it and its opposite are by chance; below 0 is claimed."""

    value: float
    p_below: float
    p_above: float

    def __str__(self) -> str:
        return f"rank correlation {self.value:.2f}"


def plan(options: StudyOptions) -> list[Cell]:
    """Every tree that a claim names."""
    trees = [tree for claim in CLAIMS for pair in claim.pairs for tree in pair]
    return timed_and_counted(list(dict.fromkeys(trees)), options.repeats)


def judge_claim(runs: Runs, claim: Claim) -> Judged:
    """The verdict on a claim."""
    counted = claim.quantity.counted
    effects = {scene: effect_of(_ratios(runs, claim, scene), counted) for scene in runs.scenes}
    corrected = adjusted(list(effects.values()))
    evidence = [
        Evidence(scene, effect, p, finding(effect, p, _limit(runs, claim, scene), counted))
        for (scene, effect), p in zip(effects.items(), corrected, strict=True)
        if effect
    ]
    overall = effect_over_scenes([item.effect.ratio.value for item in evidence])
    return Judged(claim, evidence, overall, judge(claim.expected, evidence))


def _limit(runs: Runs, claim: Claim, scene: str) -> float:
    """What the effect on a scene must exceed: pairs of different trees make up for each other's noise."""
    trees = {tree for pair in claim.pairs for tree in pair}
    return runs.limit(scene, claim.quantity, len(claim.pairs) if len(trees) == 2 * len(claim.pairs) else 1)


def _ratios(runs: Runs, claim: Claim, scene: str) -> list[float]:
    """The geometric mean over the pairs of a claim, for each repetition that all of them have."""
    found = [runs.ratios(scene, *pair, claim.quantity) for pair in claim.pairs]
    repeats = set.intersection(*map(set, found))
    return [geometric_mean(ratios[repeat] for ratios in found) for repeat in sorted(repeats)]


def judge_alignment(runs: Runs) -> Judged:
    """The verdict on why the axes help: the more of a scene lies along them, the less time it takes."""
    axes = judge_claim(runs, next(claim for claim in CLAIMS if claim.pairs == AXES_PAIRS and claim.quantity == RENDER))
    shares = _axis_shares(runs)
    scenes = [item for item in axes.scenes if item.scene in shares]
    ratios = [item.effect.ratio.value for item in scenes]
    own = [shares[item.scene] for item in scenes]
    found = _correlation(own, ratios)
    claim = replace(axes.claim, sentence=ALIGNMENT)
    noise = max(_limit(runs, axes.claim, scene) for scene in runs.scenes)
    return Judged(claim, scenes, None, _verdict_on(found, own, ratios, noise), found)


def _axis_shares(runs: Runs) -> dict[str, int]:
    """Percent of each scene's area along an axis; whole ones, for fewer decide nothing."""
    tree = AXES_PAIRS[0][0]
    rows = {scene: runs.first(scene, "work", tree) for scene in runs.scenes}
    return {scene: round(100 * row["axis_area_share"]) for scene, row in rows.items() if row}


def _correlation(shares: Sequence[int], ratios: Sequence[float]) -> Correlation | None:
    """Of ranks; scenes are few, so that all orders can be tried."""
    from scipy.stats import permutation_test, spearmanr

    if len(ratios) < 3 or not np.ptp(shares) or not np.ptp(ratios):
        return None
    below, above = (
        permutation_test(
            (ratios,),
            lambda ratios: spearmanr(shares, ratios).statistic,
            permutation_type="pairings",
            alternative=alternative,
            rng=0,
        )
        for alternative in ("less", "greater")
    )
    return Correlation(float(below.statistic), float(below.pvalue), float(above.pvalue))


def _verdict_on(found: Correlation | None, shares: Sequence[int], ratios: Sequence[float], noise: float) -> Verdict:
    if found is None:
        return Verdict("open", "too few scenes for a correlation")
    best = _correlation(shares, np.negative(shares))
    if best is None or best.p_below >= ALPHA:
        return Verdict("open", f"{found}; too few scenes, and too alike, for any order of them to decide it")
    apart = max(ratios) / min(ratios) - 1
    why = f"{found}; the times of scenes differ by {100 * apart:.0f} %, the noise is {100 * noise:.0f} %"
    if apart <= noise or min(found.p_below, found.p_above) >= ALPHA:
        return Verdict("open", why)
    return Verdict("confirmed" if found.p_below < ALPHA else "refuted", why)


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The verdicts; whether the axes help more in scenes that are more axis-aligned; and the evidence of each claim."""
    runs = Runs(rows)
    alignment = judge_alignment(runs)
    found = [*(judge_claim(runs, claim) for claim in CLAIMS), alignment]
    noises = [runs.noise(scene) for scene in runs.scenes]
    verdicts = TextTable(
        f"verdicts (noise {min(noises):.1%} to {max(noises):.1%})",
        ("claim", "found, %", "p", "verdict", "why"),
        tuple((own.claim.sentence, percent(own.overall), _p(own), own.verdict.word, own.verdict.why) for own in found),
    )
    return [verdicts, _axes_table(runs, alignment), *(_evidence_table(runs, claim) for claim in CLAIMS)]


def _p(own: Judged) -> str:
    if own.correlation:
        return f"{own.correlation.p_below:.2g}"
    return f"{own.overall.p:.2g}" if own.overall else NONE


def _axes_table(runs: Runs, own: Judged) -> TextTable:
    shares = _axis_shares(runs)
    found = own.correlation
    told = f"{found} (p {found.p_below:.2g}); below 0 is claimed" if found else own.verdict.why
    return TextTable(
        f"{ALIGNMENT}: {told}",
        ("scene", "area within a degree of an axis", "time with the axes, % of without"),
        tuple((item.scene, f"{shares[item.scene]}%", percent(item.effect)) for item in own.scenes),
    )


def _evidence_table(runs: Runs, claim: Claim) -> TextTable:
    effects = {(s, pair): runs.effect(s, *pair, claim.quantity) for s in runs.scenes for pair in claim.pairs}
    corrected = adjusted(list(effects.values()))
    counted = claim.quantity.counted
    limits = {scene: runs.limit(scene, claim.quantity) for scene in runs.scenes}
    return TextTable(
        f"{claim.sentence} ({claim.quantity.name})",
        ("scene", "tree", "against", "%", "p", "finding"),
        tuple(
            (scene, *pair, percent(effect), f"{p:.2g}", finding(effect, p, limits[scene], counted))
            for ((scene, pair), effect), p in zip(effects.items(), corrected, strict=True)
            if effect
        ),
    )


def figures(rows: Sequence[Record], _: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """One line a claim: what was found over all scenes, and a stroke for each."""
    runs = Runs(rows)
    found = [judge_alignment(runs), *(judge_claim(runs, claim) for claim in reversed(CLAIMS))]
    figure = new_figure(10, 0.7 + 0.62 * len(found))
    axes = figure.add_subplot(xscale="log", xlabel=_XLABEL)
    axes.update_datalim([(95, 0), (105, 0)])  # or it would be empty where nothing differs
    axes.axvline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    for place, own in enumerate(found):
        _draw(axes, place, own)
    axes.set_yticks(range(len(found)), [textwrap.fill(_label(own), 48) for own in found], fontsize=8)
    for which in ("major", "minor"):
        axes.tick_params(axis="x", which=which, labelsize=8)
        getattr(axes.xaxis, f"set_{which}_formatter")("{x:g}")
    plain(axes)
    yield "claims", figure


def _label(own: Judged) -> str:
    return f"{own.claim.sentence} ({own.correlation})" if own.correlation else own.claim.sentence


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
