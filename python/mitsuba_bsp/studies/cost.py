"""What an oblique plane should cost when splits are compared: the price rule, its alpha and the layout, one by one.

A constant price makes nearly every node oblique; a price that grows with the node keeps oblique planes to where they
gain much (Ize, Wald, Parker 2008; Hoobergs 2019), and a retry at the constant price splits what would else stay a leaf.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from statistics import geometric_mean, median
from typing import TYPE_CHECKING

import numpy as np

from ..figures import GUIDE, new_figure, plain
from ..inference import Effect, adjusted, finding, pooled_effect
from ..records import Record, ResultsFolder
from ..spec import spec_text
from ..speeds import NONE
from ..text_table import TextTable
from .runs import RENDER, STEPS, TESTS, Quantity, Runs, spec_of
from .study import Cell, Study, StudyOptions, timed_and_counted
from .verdicts import percent

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ALPHAS = (0.02, 0.05, 0.1, 0.2, 0.5)
LAYOUTS = ("binary", "wide")

#: The rules of oblique prices: the setting `oblique_price`, and whether splits are tried again at the constant price.
RULES = {
    "constant": ("constant", None),
    "linear": ("linear", False),
    "linear, retry": ("linear", True),
    "surcharge, retry": ("surcharge", True),
}

_LEGEND = (
    "Render time, triangle tests and steps of closest-hit rays, in percent of kd with the same layout, against the "
    "price of oblique planes: constant; linear in the number of triangles (axis_cost + alpha * intersection_cost * (n "
    "- 1)), without and with a retry at the constant price; surcharge: oblique_cost + the same. What decides: pairs "
    "of trees that differ in one thing alone, everything else equal, over all scenes and repetitions: the median "
    "ratio of their times with its 95 % interval, Wilcoxon's test, corrected for the number of comparisons "
    "(Benjamini, Hochberg)."
)


@dataclass(frozen=True)
class Price:
    """How a tree prices oblique planes; `alpha` is None where it does not matter."""

    name: str
    layout: str
    rule: str
    alpha: float | None

    def tree(self) -> str:
        """The spec."""
        oblique_price, retry = RULES[self.rule]
        return spec_text(self.name, layout=self.layout, oblique_price=oblique_price, retry=retry, alpha=self.alpha)


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which trees and prices."""
    group.add_argument("--trees", nargs="+", default=["normals"], metavar="NAME", help="default: normals")
    group.add_argument("--alpha", nargs="+", type=float, default=ALPHAS, metavar="X", help=f"default: {ALPHAS}")
    return ("trees", "alpha")


def plan(options: StudyOptions) -> list[Cell]:
    """Times and work of every price, and of kd."""
    trees = [spec_text("kd", layout=layout) for layout in LAYOUTS]
    trees += [price.tree() for price in prices(options.choices["trees"], options.choices["alpha"])]
    return timed_and_counted(trees, options.repeats)


def prices(names: Sequence[str], alphas: Sequence[float]) -> list[Price]:
    """The grid."""
    return [
        Price(name, layout, rule, alpha)
        for name in names
        for layout in LAYOUTS
        for rule in RULES
        for alpha in ([None] if rule == "constant" else alphas)
    ]


def found_prices(runs: Runs) -> dict[Price, str]:
    """The trees of the grid that were measured."""
    oblique = [tree for tree in runs.trees if spec_of(tree).name != "kd"]
    names = sorted({spec_of(tree).name for tree in oblique})
    alphas = sorted({float(spec_of(tree).settings["alpha"]) for tree in oblique if "alpha" in spec_of(tree).options})
    return {price: price.tree() for price in prices(names, alphas) if price.tree() in oblique}


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """What decides, and every price on every scene."""
    runs = Runs(rows)
    found = found_prices(runs)
    return [_deciding_table(runs, found), *(_scene_table(runs, scene, found) for scene in runs.scenes)]


def _scene_table(runs: Runs, scene: str, found: dict[Price, str]) -> TextTable:
    effects = {
        price: {quantity: runs.effect(scene, tree, _kd(price), quantity) for quantity in _QUANTITIES}
        for price, tree in found.items()
    }
    corrected = adjusted([own[RENDER] for own in effects.values()])
    noise = runs.noise()

    def verdict(effect: Effect | None, p: float) -> tuple[str, str]:
        return (f"{p:.2g}", finding(effect, p, noise)) if effect else (NONE, NONE)

    return TextTable(
        f"{runs.title(scene)}: percent of kd (noise {noise:.1%})",
        ("tree", "layout", "price", "alpha", "time", "tests", "steps", "p of time", "finding"),
        tuple(
            (price.name, price.layout, price.rule, NONE if price.alpha is None else f"{price.alpha:g}",
             *(percent(own[quantity]) for quantity in _QUANTITIES), *verdict(own[RENDER], p))
            for (price, own), p in zip(effects.items(), corrected, strict=True)
        ),
    )  # fmt: skip


_QUANTITIES = (RENDER, TESTS, STEPS)


def _kd(price: Price) -> str:
    return spec_text("kd", layout=price.layout)


def _deciding_table(runs: Runs, found: dict[Price, str]) -> TextTable:
    """Each choice against each other one, all else equal; the largest effect first."""
    compared = _comparisons(runs, found)
    effects = [pooled_effect(ratios) for ratios in compared.values()]
    noise = runs.noise()
    lines = [
        (what, one, other, percent(effect), f"{p:.2g}", finding(effect, p, noise), str(len(ratios)))
        for ((what, one, other), ratios), effect, p in zip(compared.items(), effects, adjusted(effects), strict=True)
        if effect
    ]
    size = {
        line[:3]: abs(np.log(effect.ratio.value)) for line, effect in zip(lines, filter(None, effects), strict=True)
    }
    return TextTable(
        f"what decides: render time of the one in percent of the other's (noise {noise:.1%})",
        ("choice", "the one", "the other", "%", "p", "finding", "pairs"),
        tuple(sorted(lines, key=lambda line: -size[line[:3]])),
    )


def _comparisons(runs: Runs, found: dict[Price, str]) -> dict[tuple[str, str, str], list[float]]:
    """Ratios of render times of trees that differ in one choice."""
    ratios: dict[tuple[str, str, str], list[float]] = {}
    for field, values in (("layout", LAYOUTS), ("rule", tuple(RULES)), ("alpha", _alphas(found))):
        for one, other in combinations(values, 2):
            for price, tree in found.items():
                twin = found.get(_with(price, field, one))
                if getattr(price, field) == other and twin:
                    ratios.setdefault((field, str(one), str(other)), []).extend(
                        ratio for scene in runs.scenes for ratio in runs.ratios(scene, twin, tree, RENDER)
                    )
    return ratios


def _with(price: Price, field: str, value: object) -> Price:
    """The same price but for one choice; a constant one has no alpha."""
    changed = replace(price, **{field: value})
    return replace(changed, alpha=None) if changed.rule == "constant" else changed


def _alphas(found: dict[Price, str]) -> tuple[float, ...]:
    return tuple(sorted({price.alpha for price in found if price.alpha is not None}))


def figures(rows: Sequence[Record], _: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """A panel a layout and quantity: the geometric mean over scenes against alpha, and every scene faintly."""
    runs = Runs(rows)
    found = found_prices(runs)
    names = sorted({price.name for price in found})
    figure = new_figure(10.5, 0.9 + 2.6 * len(LAYOUTS) * len(names))
    grid = figure.subplots(len(LAYOUTS) * len(names), 3, sharex=True, squeeze=False)
    for line, (name, layout) in zip(grid, [(n, layout) for n in names for layout in LAYOUTS], strict=True):
        for panel, quantity in zip(line, _QUANTITIES, strict=True):
            _draw(panel, runs, {p: t for p, t in found.items() if (p.name, p.layout) == (name, layout)}, quantity)
        line[0].set_ylabel(f"{name}, {layout}\n% of kd, geometric mean")
    for panel, title in zip(grid[0], ("render time", "triangle tests", "steps"), strict=True):
        panel.set_title(title)
    for panel in grid[-1]:
        panel.set_xlabel("alpha")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    yield "cost", figure


def _draw(panel: Axes, runs: Runs, found: dict[Price, str], quantity: Quantity) -> None:
    panel.axhline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    panel.set_xscale("log")
    for rule, colour in zip(RULES, ("#000000", "#0072B2", "#D55E00", "#009E73"), strict=True):
        own = {price.alpha: tree for price, tree in found.items() if price.rule == rule}
        means = {alpha: _mean(runs, tree, next(iter(found)).layout, quantity) for alpha, tree in own.items()}
        points = [(alpha, value) for alpha, value in means.items() if value is not None]
        if not points:
            continue
        if points[0][0] is None:
            panel.axhline(points[0][1], color=colour, linewidth=1.3, label=rule)
        else:
            panel.plot(*zip(*points, strict=True), "o-", markersize=3.5, linewidth=1.3, color=colour, label=rule)
    alphas = _alphas(found)
    panel.set_xticks(alphas, [f"{alpha:g}" for alpha in alphas], minor=False)
    panel.minorticks_off()
    plain(panel)


def _mean(runs: Runs, tree: str, layout: str, quantity: Quantity) -> float | None:
    """Percent of kd, geometric mean over the scenes."""
    kd = spec_text("kd", layout=layout)
    medians = [median(found) for scene in runs.scenes if (found := runs.ratios(scene, tree, kd, quantity))]
    return 100 * geometric_mean(medians) if medians else None


STUDY = Study(
    name="cost",
    help="prices of oblique planes: constant, linear, with a retry; alpha; both layouts",
    title="The price of an oblique plane",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
    repeats=5,
    least_repeats=3,
    repeated="runs of each, with other seeds where trees have one",
)
