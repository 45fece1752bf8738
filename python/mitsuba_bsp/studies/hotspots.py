"""Hot spots: how the cost of pixels is spread, with heat maps. The papers say that BSP trees have fewer of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from ..figures import COLOURS, lines_of, new_figure, plain
from ..records import Record, ResultsFolder
from ..speeds import NONE
from ..text_table import TextTable
from .heatmap import add_specs, chosen_specs, heat_maps
from .log_ticks import readable_ticks
from .runs import DEAREST, HOT_SPOTS, Runs, spec_of
from .study import Cell, Study, StudyOptions, timed_and_counted
from .verdicts import percent
from .work import PIXELS, SHARES

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPECS = ("native", "kd", "rbsp", "ize", "random", "normals", "clustered")
BASELINE = "kd"

#: The kd-tree along axes of the scene's own, whose line must not look like that of the other.
ORIENTED = "kd:orientation=scene"

#: Scenes beside each other in the figure.
_COLUMNS = 3

_LEGEND = (
    "The cost of a pixel is the price of the work for its rays, in units of one axis-aligned plane, at the prices "
    "measured for the layout; native is priced as a tree of binary nodes, so that its costs are comparable with one "
    "another only. Spread: standard deviation, 99th percentile and maximum over the mean. Trees that have a seed are "
    "built with several: medians."
)


def plan(options: StudyOptions) -> list[Cell]:
    """The work of every accelerator, of each seed where there is one."""
    cells = timed_and_counted(chosen_specs(options), options.repeats)
    return [cell for cell in cells if cell.measure == "work"]


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The spread of every accelerator's pixels, a table a scene."""
    runs = Runs(rows)
    return [_scene_table(runs, scene, of) for scene in runs.scenes for of in PIXELS]


def _scene_table(runs: Runs, scene: str, of: str) -> TextTable:
    def cells(tree: str) -> tuple[str, ...]:
        pixels = [row["pixels"]["cost"][of] for row in runs.get(scene, "work", tree).values()]
        if not pixels:
            return (NONE,) * 5
        mean, deviation = (
            median(values) for values in zip(*((p["mean"], p["deviation"]) for p in pixels), strict=True)
        )
        dearest, most = (median(own["quantiles"][place] for own in pixels) for place in (99, 100))
        over_mean = (f"{value / mean:.2f}" for value in (deviation, dearest, most))
        return (f"{mean:.1f}", f"{dearest:.1f}", *over_mean)

    def against(tree: str) -> tuple[str, ...]:
        return tuple(percent(runs.effect(scene, tree, BASELINE, quantity[of])) for quantity in (DEAREST, HOT_SPOTS))

    return TextTable(
        f"{runs.title(scene)}: {PIXELS[of]}",
        ("spec", "mean", "p99", "s.d. / mean", "p99 / mean", "max / mean", f"p99, % of {BASELINE}", "p99 / mean, %"),
        tuple((tree, *cells(tree), *against(tree)) for tree in runs.ordered(SPECS)),
    )


def figures(rows: Sequence[Record], folder: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """How the cost of pixels is spread, and for every scene the heat maps of all accelerators."""
    runs = Runs(rows)
    if figure := _spread_figure(runs):
        yield "hotspots", figure
    for scene in runs.scenes:
        figure = heat_maps(runs, scene, folder, SPECS, "cost")
        if figure:
            yield f"hotspots-{scene}", figure


def _spread_figure(runs: Runs) -> Figure | None:
    """The dearest pixels: cost over the mean of kd's against the share of pixels that are cheaper.

    Mitsuba's kd-tree is left out: its costs are in another unit. None if nothing else was measured.
    """
    styles = {tree: style for tree, style in lines_of(runs.ordered(SPECS)).items() if spec_of(tree).is_tree}
    if ORIENTED in styles:
        styles[ORIENTED] = {"color": COLOURS["embree"], "linestyle": "--"}  # which tells no costs
    scenes = [scene for scene in runs.scenes if any(runs.first(scene, "work", tree) for tree in styles)]
    if not scenes:
        return None
    columns = min(_COLUMNS, len(scenes))
    lines = -(-len(scenes) // columns)
    figure = new_figure(1 + 3.4 * columns, 1 + len(PIXELS) * (0.4 + 2.6 * lines))
    parts = figure.subfigures(len(PIXELS), squeeze=False, hspace=0.03)[:, 0]
    labelled: dict[str, Artist] = {}
    for part, (of, words) in zip(parts, PIXELS.items(), strict=True):
        part.suptitle(f"{words}: cost over the mean of {BASELINE}")
        panels = part.subplots(lines, columns, sharex=True, squeeze=False).ravel()
        for panel, scene in zip(panels, scenes, strict=False):
            _draw(panel, runs, scene, of, styles)
            labelled |= {line.get_label(): line for line in panel.lines}
        for panel in panels[: len(scenes)][-columns:]:
            panel.xaxis.set_tick_params(labelbottom=True)
            panel.set_xlabel("% of the pixels that are cheaper")
        for panel in panels[len(scenes) :]:
            panel.set_axis_off()
    shown = [tree for tree in styles if tree in labelled]
    handles = [labelled[tree] for tree in shown]
    figure.legend(handles, shown, loc="outside lower center", ncols=min(len(shown), 2 * columns), frameon=False)
    return figure


def _draw(panel: Axes, runs: Runs, scene: str, of: str, styles: Mapping[str, Mapping[str, str]]) -> None:
    """The costs of one scene, whose title tells where kd's are missing."""
    base = runs.first(scene, "work", BASELINE)
    unit = base["pixels"]["cost"][of]["mean"] if base else 1
    for tree, style in styles.items():
        if row := runs.first(scene, "work", tree):
            costs = np.array(row["pixels"]["cost"][of]["quantiles"]) / unit
            panel.plot(100 * SHARES, costs, **style, linewidth=1.2, label=tree)
    panel.set_title(scene if base else f"{scene}, cost itself: no {BASELINE}")
    _scale(panel)


def _scale(panel: Axes) -> None:
    """The dearer half, on logarithmic axes, on which equal ratios are as far apart everywhere."""
    panel.set_xlim(50, 100)
    panel.set_yscale("log")
    shown = np.concatenate([line.get_ydata()[SHARES >= 0.5] for line in panel.lines])
    panel.set_ylim(0.9 * max(shown.min(), 1e-3 * shown.max()), 1.1 * shown.max())
    readable_ticks(panel.yaxis)
    plain(panel)


STUDY = Study(
    name="hotspots",
    help="the spread of the cost of pixels, with heat maps",
    title="Hot spots",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=partial(add_specs, default=SPECS),
    repeats=3,
    repeated="seeds of trees that have one",
)
