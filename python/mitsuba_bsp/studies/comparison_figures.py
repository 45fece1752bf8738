"""The figures of the comparison: percent of kd beside the thesis's, and the share of kd nodes by depth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..figures import COLOURS, GUIDE, new_figure, plain
from ..spec import spec_text, with_setting
from ..thesis import PUBLISHED_TREES
from .comparison import PUBLISHED_QUANTITIES, WAYS, Findings, baseline_of, same_tree, way_of
from .log_ticks import readable_ticks
from .runs import Runs, spec_of
from .tree_shapes import axis_node_shares, tree_row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

_MARKERS = {"thesis": "o", "binary": "^", "wide": "s"}

#: How far the points of one row are apart.
_APART = 0.22

#: Trees by what they are called without the way that they are built, then by way.
Rows = Mapping[str, Mapping[str, str]]


def rows_of(runs: Runs) -> Rows:
    """The trees that were measured, but for the kd that all are percentages of; those of the thesis first."""
    found: dict[str, dict[str, str]] = {}
    for tree in runs.trees:
        spec = spec_of(tree)
        if not spec.is_tree or tree == baseline_of(runs, tree):
            continue
        options = {key: value for key, value in spec.options.items() if key not in ("cost", "layout")}
        name = spec_text(spec.name, **options)
        found.setdefault(next((other for other in found if same_tree(other, name)), name), {})[way_of(tree)] = tree

    def place(name: str) -> int:
        known = [number for number, other in enumerate(PUBLISHED_TREES) if same_tree(other, name)]
        return known[0] if known else len(PUBLISHED_TREES)

    return {name: found[name] for name in sorted(found, key=lambda name: (place(name), name))}


def _ways(rows: Rows) -> list[str]:
    return [way for way in WAYS if any(way in own for own in rows.values())]


def percent_figure(runs: Runs) -> Figure:
    """A row a scene, a column a quantity: our ways to build, and what was published."""
    rows = rows_of(runs)
    figure = new_figure(13, 0.9 + (0.7 + 0.28 * max(4, len(rows))) * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), 4, sharey=True, squeeze=False)
    published = False
    for line, scene in zip(grid, runs.scenes, strict=True):
        found = Findings(runs, scene)
        published |= any(_published(found, name) for name in rows)
        for panel, quantity in zip(line, PUBLISHED_QUANTITIES, strict=True):
            _draw_quantity(panel, found, quantity, rows)
        line[0].set_yticks([-number for number in range(len(rows))], list(rows))
        line[0].set_ylim(-len(rows) + 0.4, 0.6)
        line[0].set_ylabel(scene)
    for panel, title in zip(grid[0], ("render time", "build time", "triangle tests", "steps"), strict=True):
        panel.set_title(f"{title}, % of kd")
    handles = [_marker(_MARKERS[way], f"ours, {way}") for way in _ways(rows)]
    if published:
        handles.append(_marker("o", "published", fillstyle="none", markersize=7))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _published(found: Findings, name: str) -> dict[str, float]:
    """What the thesis says of a row's tree, built its way."""
    known = next((tree for tree in PUBLISHED_TREES if same_tree(tree, name)), None)
    return found.published(with_setting(known, WAYS["thesis"])) if known else {}


def _marker(marker: str, label: str, **more: object) -> Line2D:
    from matplotlib.lines import Line2D

    return Line2D([], [], linestyle="none", marker=marker, color="0.3", label=label, **more)


def _draw_quantity(panel: Axes, found: Findings, quantity: str, rows: Rows) -> None:
    panel.set_xscale("log")
    panel.update_datalim([(80, 0), (125, 0)])  # or it would be empty where nothing differs
    panel.axvline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    ways = _ways(rows)
    for number, (name, own) in enumerate(rows.items()):
        colour = COLOURS[spec_of(name).name]
        for way, tree in own.items():
            place = -number + _APART * ((len(ways) - 1) / 2 - ways.index(way))
            if evidence := found.evidence(tree, quantity):
                ratio = evidence.effect.ratio
                panel.plot([100 * ratio.low, 100 * ratio.high], [place] * 2, color=colour, linewidth=1)
                panel.plot(100 * ratio.value, place, _MARKERS[way], color=colour, markersize=4.5)
        if theirs := _published(found, name):
            place = -number + _APART * (len(ways) - 1) / 2
            panel.plot(theirs[quantity], place, "o", markersize=7, fillstyle="none", color="0.3")
    readable_ticks(panel.xaxis)
    plain(panel)


def depth_figure(runs: Runs) -> Figure:
    """The share of kd nodes by depth, a panel a scene and way; of trees that have others too."""
    rows = {name: own for name, own in rows_of(runs).items() if spec_of(name).name != "kd" and "axes=plain" not in name}
    ways = _ways(rows) or list(WAYS)[-1:]
    figure = new_figure(max(5.0, 3.4 * len(ways)), 0.9 + 2.4 * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), len(ways), sharex="row", sharey=True, squeeze=False)
    drawn: dict[str, Line2D] = {}
    for line, scene in zip(grid, runs.scenes, strict=True):
        for panel, way in zip(line, ways, strict=True):
            for name, own in rows.items():
                row = tree_row(runs, scene, own[way]) if way in own else None
                shares = enumerate(axis_node_shares(row)) if row else ()
                if shares := [(depth, 100 * share) for depth, share in shares if share is not None]:
                    (drawn[name],) = panel.plot(*zip(*shares, strict=True), color=COLOURS[spec_of(name).name], lw=1.3)
            panel.set_title(f"{scene}, {way}", fontsize=10)
            plain(panel)
        line[0].set_ylabel("% of interior nodes\nthat are kd nodes")
    for panel in grid[-1]:
        panel.set_xlabel("depth")
    if drawn:
        columns = min(len(ways) + 1, 4)
        figure.legend(drawn.values(), drawn.keys(), loc="outside lower center", ncols=columns, frameon=False)
    return figure
