"""What an oblique plane should cost when splits are compared: the price rule, its alpha and the layout, one by one.

A constant price makes nearly every node oblique; a price that grows with the node keeps oblique planes to where they
gain much (Ize, Wald, Parker 2008; Hoobergs 2019), and a retry at the constant price splits what would else stay a leaf.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, cycle
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
    from matplotlib.lines import Line2D

ALPHAS = (0.02, 0.05, 0.1, 0.2, 0.5)
LAYOUTS = ("binary", "wide")

#: Of scenes in the figure.
_MARKERS, _FAINT = "os^Dv*", 0.45

#: Where the lanes of rules lie in the band of an alpha, which is 1 wide; scenes share the width of a lane.
_LANES, _WIDTH = (0, -0.27, 0, 0.27), 0.16

#: The rules of oblique prices: the setting `oblique_price`, and whether splits are tried again at the constant price.
RULES = {
    "constant": ("constant", None),
    "linear": ("linear", False),
    "linear, retry": ("linear", True),
    "surcharge, retry": ("surcharge", True),
}

_COLOURS = dict(zip(RULES, ("#000000", "#0072B2", "#D55E00", "#009E73"), strict=True))

_LEGEND = (
    "Render time, triangle tests and steps of closest-hit rays, in percent of kd with the same layout, against the "
    "price of oblique planes: constant; linear in the number of triangles (axis_cost + alpha * intersection_cost * (n "
    "- 1)), without and with a retry at the constant price; surcharge: oblique_cost + the same. What decides: pairs "
    "of trees that differ in one thing alone, everything else equal, over all scenes and repetitions, then on each "
    "scene and in each layout: the median ratio of their times with its 95 % interval, and Wilcoxon's test, corrected "
    "for the number of comparisons in both tables together (Benjamini, Hochberg). A constant price, which has no "
    "alpha, is paired with that of every alpha: such pairs share a tree, and their p is too small."
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
    group.add_argument("--alpha", nargs="+", type=float, default=ALPHAS, metavar="X", help="default: %(default)s")
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
    """What decides, over all scenes and on each, and every price on every scene."""
    runs = Runs(rows)
    found = found_prices(runs)
    return [*_deciding_tables(runs, found), *(_scene_table(runs, scene, found) for scene in runs.scenes)]


def _scene_table(runs: Runs, scene: str, found: dict[Price, str]) -> TextTable:
    effects = {
        price: {quantity: runs.effect(scene, tree, _kd(price.layout), quantity) for quantity in _QUANTITIES}
        for price, tree in found.items()
    }
    corrected = adjusted([own[RENDER] for own in effects.values()])
    noise = runs.noise(scene)

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


def _kd(layout: str) -> str:
    return spec_text("kd", layout=layout)


@dataclass(frozen=True)
class Compared:
    """Trees that differ in one choice alone; `scene` and `layout` are empty where all are pooled."""

    choice: str
    one: str
    other: str
    scene: str = ""
    layout: str = ""


def _deciding_tables(runs: Runs, found: dict[Price, str]) -> list[TextTable]:
    """Each choice against each other one, all else equal, pooled and where they were made; the largest effect first."""
    pooled = _comparisons(runs, found)
    apart = _comparisons(runs, found, apart=True)
    both = [*pooled.items(), *apart.items()]
    effects = [pooled_effect(ratios) for _, ratios in both]
    corrected = adjusted(effects)  # all of them are one family
    noises = {scene: runs.noise(scene) for scene in runs.scenes}
    noise = max(noises.values())
    lines: dict[Compared, tuple[float, tuple[str, ...]]] = {}
    for (key, ratios), effect, p in zip(both, effects, corrected, strict=True):
        if effect:
            cells = (percent(effect), f"{p:.2g}", finding(effect, p, noises.get(key.scene, noise)), str(len(ratios)))
            lines[key] = (abs(float(np.log(effect.ratio.value))), cells)

    def ordered(keys: Iterable[Compared]) -> list[Compared]:
        return sorted((key for key in keys if key in lines), key=lambda key: -lines[key][0])

    title, head = "render time of the one in percent of the other's", ("choice", "the one", "the other")
    numbers = ("%", "p", "finding", "pairs")
    return [
        TextTable(
            f"what decides: {title} (noise {noise:.1%})",
            (*head, *numbers),
            tuple((key.choice, key.one, key.other, *lines[key][1]) for key in ordered(pooled)),
        ),
        TextTable(
            f"the same on each scene and in each layout: {title}",
            (*head, "scene", "layout", *numbers),
            tuple(
                (key.choice, key.one, key.other, key.scene, key.layout or NONE, *lines[key][1])
                for key in ordered(apart)
            ),
        ),
    ]


def _comparisons(runs: Runs, found: dict[Price, str], apart: bool = False) -> dict[Compared, list[float]]:
    """Ratios of render times of trees that differ in one choice, pooled, or `apart` by scene and layout."""
    ratios: dict[Compared, list[float]] = {}
    for choice, values in (("layout", LAYOUTS), ("rule", tuple(RULES)), ("alpha", _alphas(found))):
        for one, other in combinations(values, 2):
            for price, tree in found.items():
                twin = found.get(_with(price, choice, one))
                if getattr(price, choice) == other and twin:
                    for scene in runs.scenes:
                        layout = "" if choice == "layout" else price.layout
                        where = (scene, layout) if apart else ()
                        key = Compared(choice, str(one), str(other), *where)
                        ratios.setdefault(key, []).extend(runs.ratios(scene, twin, tree, RENDER).values())
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
    if not names:
        return
    figure = new_figure(13, 0.9 + 3.6 * len(LAYOUTS) * len(names))
    grid = figure.subplots(len(LAYOUTS) * len(names), 3, sharex=True, squeeze=False)
    for line, (name, layout) in zip(grid, [(n, layout) for n in names for layout in LAYOUTS], strict=True):
        for panel, quantity in zip(line, _QUANTITIES, strict=True):
            own = {p: t for p, t in found.items() if (p.name, p.layout) == (name, layout)}
            _draw(panel, runs, own, layout, quantity)
        line[0].set_ylabel(f"{name}, {layout}\n% of kd; thick: geometric mean of scenes")
    for panel, title in zip(grid[0], ("render time", "triangle tests", "steps"), strict=True):
        panel.set_title(title)
    for panel in grid[-1]:
        panel.set_xlabel("alpha")
    figure.legend(handles=_legend_lines(runs), loc="outside lower center", ncols=4, frameon=False)
    yield "cost", figure


def _draw(panel: Axes, runs: Runs, found: dict[Price, str], layout: str, quantity: Quantity) -> None:
    """A band an alpha, with a lane a rule; what has none is left of them, with a line across."""
    panel.axhline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    alphas = _alphas(found)
    for band in range(0, len(alphas) + 1, 2):
        panel.axvspan(band - 0.5, band + 0.5, color="0.96", zorder=0)
    places = {alpha: place for place, alpha in enumerate((None, *alphas))}
    for lane, (rule, colour) in zip(_LANES, _COLOURS.items(), strict=True):
        own = {places[price.alpha] + lane: tree for price, tree in found.items() if price.rule == rule}
        for number, scene in enumerate(runs.scenes):
            effects = {place: runs.effect(scene, tree, _kd(layout), quantity) for place, tree in own.items()}
            aside = _WIDTH * ((number + 0.5) / len(runs.scenes) - 0.5)
            points = [(place + aside, effect.ratio) for place, effect in effects.items() if effect]
            for place, ratio in points:
                panel.plot([place] * 2, [100 * ratio.low, 100 * ratio.high], color=colour, alpha=_FAINT, linewidth=1)
            marker = _MARKERS[number % len(_MARKERS)]
            line = [(place, 100 * ratio.value) for place, ratio in points]
            if line:
                panel.plot(*zip(*line, strict=True), marker, color=colour, alpha=_FAINT, markersize=4)
                panel.plot(*zip(*line, strict=True), color=colour, alpha=_FAINT / 2, linewidth=0.7)
        means = {place: _mean(runs, tree, layout, quantity) for place, tree in own.items()}
        line = [(place, value) for place, value in means.items() if value is not None]
        if line and rule == "constant":
            panel.axhline(line[0][1], color=colour, linewidth=1.6)
        elif line:
            panel.plot(*zip(*line, strict=True), color=colour, linewidth=1.6)
    panel.set_xticks(list(places.values()), ["none", *(f"{alpha:g}" for alpha in alphas)])
    panel.set_xlim(-0.5, len(alphas) + 0.5)
    plain(panel)
    panel.grid(visible=False, axis="x")


def _legend_lines(runs: Runs) -> list[Line2D]:
    from matplotlib.lines import Line2D

    rules = [Line2D([], [], color=colour, linewidth=1.6, label=rule) for rule, colour in _COLOURS.items()]
    scenes = [
        Line2D([], [], color="0.3", alpha=_FAINT, marker=marker, markersize=4, linewidth=1, label=scene)
        for scene, marker in zip(runs.scenes, cycle(_MARKERS))
    ]
    return [*rules, *scenes]


def _mean(runs: Runs, tree: str, layout: str, quantity: Quantity) -> float | None:
    """Percent of kd, geometric mean over the scenes."""
    found = (runs.ratios(scene, tree, _kd(layout), quantity) for scene in runs.scenes)
    medians = [median(ratios.values()) for ratios in found if ratios]
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
