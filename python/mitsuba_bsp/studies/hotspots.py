"""Hot spots: how the cost of pixels is spread, with heat maps. The papers say that BSP trees have fewer of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from ..figures import COLOURS, new_figure, plain
from ..records import Record, ResultsFolder
from ..spec import parse_spec
from ..speeds import NONE
from ..text_table import TextTable
from .runs import DEAREST, HOT_SPOTS, PIXELS, Runs, spec_of
from .study import Cell, Study, StudyOptions, arrays_file, timed_and_counted
from .verdicts import percent
from .work import SHARES

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.figure import Figure

SPECS = ("native", "kd", "rbsp", "ize", "random", "normals", "clustered")
BASELINE = "kd"

_LEGEND = (
    "The cost of a pixel is the price of the work for its rays, in units of one axis-aligned plane, at the prices "
    "measured for the layout; native is priced as a tree of binary nodes, so that its costs are comparable with one "
    "another only. Spread: standard deviation, 99th percentile and maximum over the mean. Trees that have a seed are "
    "built with several: medians."
)


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which accelerators."""
    group.add_argument("--specs", nargs="+", default=SPECS, metavar="SPEC", help=f"default: {' '.join(SPECS)}")
    group.set_defaults(keep_pixels=True)
    return ("specs", "keep_pixels")


def plan(options: StudyOptions) -> list[Cell]:
    """The work of every accelerator, of each seed where there is one."""
    specs = list(dict.fromkeys(options.choices["specs"]))
    if "embree" in {parse_spec(text).name for text in specs}:
        raise ValueError("Embree does not count its work: leave it out of --specs")
    return [cell for cell in timed_and_counted(specs, options.repeats) if cell.measure == "work"]


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The spread of every accelerator's pixels, a table a scene."""
    runs = Runs(rows)
    return [_scene_table(runs, scene, of) for scene in runs.scenes for of in PIXELS]


def _scene_table(runs: Runs, scene: str, of: str) -> TextTable:
    def cells(tree: str) -> tuple[str, ...]:
        pixels = [row["pixels"][of] for row in runs.get(scene, "work", tree).values()]
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
    yield "hotspots", _spread_figure(runs)
    for scene in runs.scenes:
        figure = _heat_maps(runs, scene, folder)
        if figure:
            yield f"hotspots-{scene}", figure


def _spread_figure(runs: Runs) -> Figure:
    """The dearest pixels: cost over the mean against the share of pixels that are dearer."""
    figure = new_figure(1 + 3.1 * len(runs.scenes), 0.9 + 2.5 * len(PIXELS))
    grid = figure.subplots(len(PIXELS), len(runs.scenes), sharex=True, squeeze=False)
    for line, (of, words) in zip(grid, PIXELS.items(), strict=True):
        for panel, scene in zip(line, runs.scenes, strict=True):
            for tree in runs.ordered(SPECS):
                if row := runs.first(scene, "work", tree):
                    relative = np.array(row["pixels"][of]["quantiles"]) / row["pixels"][of]["mean"]
                    panel.plot(100 * SHARES, relative, color=COLOURS[spec_of(tree).name], linewidth=1.2, label=tree)
            panel.set_xlim(50, 100)
            plain(panel)
        line[0].set_ylabel(f"{words}\ncost over the mean")
    for panel, scene in zip(grid[0], runs.scenes, strict=True):
        panel.set_title(scene)
    for panel in grid[-1]:
        panel.set_xlabel("% of the pixels that are cheaper")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _heat_maps(runs: Runs, scene: str, folder: ResultsFolder) -> Figure | None:
    """A column an accelerator, a row for camera rays and one for paths, with one scale for each row."""
    maps = {
        tree: dict(np.load(file))
        for tree in runs.ordered(SPECS)
        if (row := runs.first(scene, "work", tree))
        and (file := arrays_file(folder, "work", scene, str(row["spec"]))).is_file()
    }
    if not maps:
        return None
    height, width = next(iter(maps.values()))["path"].shape
    side = 2.2
    figure = new_figure(0.6 + side * len(maps), 0.5 + 2 * (side * height / width + 0.35))
    grid = figure.subplots(len(PIXELS), len(maps), squeeze=False)
    for line, (of, words) in zip(grid, PIXELS.items(), strict=True):
        ours = [own[of] for tree, own in maps.items() if tree != "native"] or [own[of] for own in maps.values()]
        top = float(np.max([np.quantile(values, 0.995) for values in ours]))
        for panel, (tree, own) in zip(line, maps.items(), strict=True):
            shown = panel.imshow(own[of], cmap="inferno", vmin=0, vmax=top, interpolation="nearest")
            panel.set_title(f"{tree}\nmean {own[of].mean():.0f}, p99 {np.quantile(own[of], 0.99):.0f}", fontsize=9)
            panel.set_xticks([])
            panel.set_yticks([])
        line[0].set_ylabel(words)
        figure.colorbar(shown, ax=list(line), fraction=0.02, pad=0.01, extend="max").set_label("planes")
    return figure


STUDY = Study(
    name="hotspots",
    help="the spread of the cost of pixels, with heat maps",
    title="Hot spots",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
    repeats=3,
    repeated="seeds of trees that have one",
)
