"""The figures of the comparison: percent of kd beside the thesis's, and the share of kd nodes by depth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..figures import COLOURS, GUIDE, new_figure, plain
from ..spec import parse_spec, with_setting
from ..thesis import PUBLISHED_TREES
from .comparison import PUBLISHED_QUANTITIES, WAYS, Findings, as_measured, way_of
from .runs import Runs
from .tree_shapes import axis_node_shares, tree_row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_MARKERS = {"thesis": "o", "binary": "^", "wide": "s"}


def percent_figure(runs: Runs) -> Figure:
    """A row a scene, a column a quantity: our three ways to build, and what was published."""
    names = {tree: number for number, tree in enumerate(reversed(PUBLISHED_TREES))}
    figure = new_figure(13, 0.9 + 2.6 * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), 4, sharey=True, squeeze=False)
    noise = runs.noise()
    for line, scene in zip(grid, runs.scenes, strict=True):
        found = Findings(runs, scene, noise)
        for panel, quantity in zip(line, PUBLISHED_QUANTITIES, strict=True):
            _draw_quantity(panel, found, quantity, names)
        line[0].set_yticks(list(names.values()), list(names))
        line[0].set_ylabel(scene)
    for panel, title in zip(grid[0], ("render time", "build time", "triangle tests", "steps"), strict=True):
        panel.set_title(f"{title}, % of kd")
    handles = [_marker(_MARKERS[way], f"ours, {way}") for way in WAYS]
    published = _marker("o", "published", fillstyle="none", markersize=7)
    figure.legend(handles=[*handles, published], loc="outside lower center", ncols=4, frameon=False)
    return figure


def _marker(marker: str, label: str, **more: object) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], linestyle="none", marker=marker, color="0.3", label=label, **more)


def _draw_quantity(panel: Axes, found: Findings, quantity: str, names: dict[str, int]) -> None:
    from matplotlib.ticker import LogLocator

    panel.set_xscale("log")
    panel.update_datalim([(80, 0), (125, 0)])  # or it would be empty where nothing differs
    panel.axvline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    for tree, place in names.items():
        colour = COLOURS[parse_spec(tree).name]
        for shift, (way, added) in zip((0.22, 0, -0.22), WAYS.items(), strict=True):
            evidence = found.evidence(as_measured(found.runs, with_setting(tree, added)), quantity)
            if evidence:
                ratio = evidence.effect.ratio
                panel.plot([100 * ratio.low, 100 * ratio.high], [place + shift] * 2, color=colour, linewidth=1)
                panel.plot(100 * ratio.value, place + shift, _MARKERS[way], color=colour, markersize=4.5)
        if theirs := found.published(with_setting(tree, WAYS["thesis"])):
            panel.plot(
                theirs[quantity], place + 0.22, "o", markersize=7, fillstyle="none", color="0.3", label="published"
            )
    low, high = panel.get_xlim()
    panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 30 * low else (1,)))
    panel.xaxis.set_major_formatter("{x:g}")
    panel.xaxis.set_minor_formatter("")
    plain(panel)


def depth_figure(runs: Runs) -> Figure:
    """The share of kd nodes by depth, a panel a scene and way."""
    measured = {way_of(tree) for tree in runs.trees}
    ways = {way: added for way, added in WAYS.items() if way in measured}
    figure = new_figure(3.4 * len(ways), 0.9 + 2.4 * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), len(ways), sharex="row", sharey=True, squeeze=False)
    drawn: dict[str, Line2D] = {}
    for line, scene in zip(grid, runs.scenes, strict=True):
        for panel, (way, added) in zip(line, ways.items(), strict=True):
            for tree in PUBLISHED_TREES:
                row = tree_row(runs, scene, as_measured(runs, with_setting(tree, added)))
                if row and "axes=plain" not in tree:
                    shares = [(depth, 100 * s) for depth, s in enumerate(axis_node_shares(row)) if s is not None]
                    name = parse_spec(tree).name
                    (drawn[name],) = panel.plot(*zip(*shares, strict=True), color=COLOURS[name], linewidth=1.3)
            panel.set_title(f"{scene}, {way}", fontsize=10)
            plain(panel)
        line[0].set_ylabel("% of interior nodes\nthat are kd nodes")
    for panel in grid[-1]:
        panel.set_xlabel("depth")
    figure.legend(drawn.values(), drawn.keys(), loc="outside lower center", ncols=5, frameon=False)
    return figure
