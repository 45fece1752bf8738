"""Cost images: what every pixel of a scene costs, under several accelerators side by side."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..exr import read_exr
from ..figures import lines_of, new_figure, plain
from ..records import Record, ResultsFolder
from ..spec import parse_spec
from ..speeds import NONE
from ..text_table import TextTable
from .runs import Runs, spec_of
from .study import Cell, Study, StudyOptions
from .work import PIXELS, QUANTITIES, SHARES, pixel_quantities, read_counters

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SPECS = ("native", "kd", "normals", "clustered")

#: The colour scale ends where this share of the pixels of the dearest tree is cheaper, so that a few do not decide it.
BRIGHTEST = 0.995

#: Inches of a map's width.
_SIDE = 2.6

_LEGEND = (
    "Per pixel, the mean of its samples: the camera ray alone, and whole paths with all their bounces and shadow rays. "
    "cost: the price of all work, in units of one axis-aligned plane, at the prices measured for the layout; native is "
    "priced as a tree of binary nodes. steps: through nodes, seven planes at once in wide nodes and one in binary ones "
    "and under native. So steps and costs under native are comparable with one another only, and do not count for the "
    "colour scale. leaves: visited, that have triangles. tests: of triangles. Only what is under the accelerator "
    "counts: not the level above instances, and not shapes that Embree keeps."
)


def add_specs(group: OptionGroup, default: Sequence[str] = SPECS) -> Sequence[str]:
    """Which accelerators."""
    group.add_argument("--specs", nargs="+", default=default, metavar="SPEC", help=f"default: {' '.join(default)}")
    group.set_defaults(keep_pixels=True)
    return ("specs", "keep_pixels")


def chosen_specs(options: StudyOptions) -> list[str]:
    """Those of the command line, each once; ValueError if one does not count its work."""
    specs = list(dict.fromkeys(options.choices["specs"]))
    if "embree" in {parse_spec(text).name for text in specs}:
        raise ValueError("Embree does not count its work: leave it out of --specs")
    return specs


def plan(options: StudyOptions) -> list[Cell]:
    """One frame under each accelerator."""
    return [Cell("work", tree) for tree in chosen_specs(options)]


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The spread of every quantity under every accelerator: a table a scene and kind of ray."""
    runs = Runs(rows)
    return [_spread_table(runs, scene, of) for scene in runs.scenes for of in PIXELS]


def _spread_table(runs: Runs, scene: str, of: str) -> TextTable:
    def cells(tree: str, quantity: str) -> tuple[str, ...]:
        row = runs.first(scene, "work", tree)
        if row is None:
            return (NONE,) * 5
        own = row["pixels"][quantity][of]
        mean, p99, most = own["mean"], own["quantiles"][99], own["quantiles"][100]
        return (*(f"{x:.1f}" for x in (mean, own["deviation"], p99, most)), f"{p99 / mean:.2f}" if mean else NONE)

    return TextTable(
        f"{runs.title(scene)}: {PIXELS[of]}",
        ("spec", "what", "mean", "s.d.", "p99", "max", "p99 / mean"),
        tuple((tree, what, *cells(tree, what)) for what in QUANTITIES for tree in runs.ordered(SPECS)),
    )


def figures(rows: Sequence[Record], folder: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """The maps of every quantity, of all accelerators, for each scene."""
    runs = Runs(rows)
    for scene in runs.scenes:
        for quantity in QUANTITIES:
            figure = heat_maps(runs, scene, folder, SPECS, quantity)
            if figure:
                yield f"heatmap-{scene}-{quantity}", figure


def heat_maps(runs: Runs, scene: str, folder: ResultsFolder, known: Sequence[str], quantity: str) -> Figure | None:
    """A column an accelerator, a row for camera rays and one for whole paths, with one colour scale for each row.

    In front of them, the picture, and how many pixels cost how much. None if no image of the scene is left.
    """
    images = {
        tree: (row, read_exr(file))
        for tree in runs.ordered(known)
        if (row := runs.first(scene, "work", tree)) and (file := folder.image(scene, str(row["spec"]))).is_file()
    }
    if not images:
        return None
    maps = {
        tree: pixel_quantities(spec_of(str(row["spec"])), read_counters(planes))[quantity]
        for tree, (row, planes) in images.items()
    }
    picture = next(iter(images.values()))[1]
    height, width = picture["path.rays"].shape
    side_height = _SIDE * float(np.clip(height / width, 0.4, 2))
    figure = new_figure(1.1 + _SIDE * (len(maps) + 1), 0.4 + 2 * (side_height + 0.45))
    grid = figure.subplots(len(PIXELS), len(maps) + 1, squeeze=False)
    _show_picture(grid[0, 0], picture, scene)
    _show_shares(grid[1, 0], {tree: own["path"] for tree, own in maps.items()}, QUANTITIES[quantity])
    for line, (of, words) in zip(grid[:, 1:], PIXELS.items(), strict=True):
        top = _brightest({tree: own[of] for tree, own in maps.items()}, quantity)
        for panel, (tree, own) in zip(line, maps.items(), strict=True):
            shown = panel.imshow(own[of], cmap="inferno", vmin=0, vmax=top, interpolation="nearest")
            panel.set_title(f"{tree}\nmean {own[of].mean():.0f}, p99 {np.quantile(own[of], 0.99):.0f}", fontsize=8)
            _bare(panel)
        line[0].set_ylabel(words)
        bar = figure.colorbar(shown, ax=list(line), fraction=0.03, pad=0.01, extend="max")
        bar.set_label(f"{QUANTITIES[quantity]} a sample")
    return figure


def _brightest(maps: Mapping[str, NDArray[np.float32]], quantity: str) -> float:
    """Where the colour scale ends. What is comparable with itself only does not count."""
    apart = ("native",) if quantity in ("cost", "steps") else ()
    ours = [own for tree, own in maps.items() if spec_of(tree).name not in apart] or list(maps.values())
    return max(float(np.quantile(own, BRIGHTEST)) for own in ours) or 1.0


def _show_picture(panel: Axes, planes: Mapping[str, NDArray[np.float32]], scene: str) -> None:
    """The rendered image, tone-mapped as previews are."""
    colours = [planes[name] for name in ("R", "G", "B") if name in planes] or [planes["Y"]]
    linear = np.clip(np.nan_to_num(np.stack(colours, axis=2)), 0, 1)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)
    panel.imshow(np.broadcast_to(srgb, (*srgb.shape[:2], 3)), interpolation="nearest")
    panel.set_title(scene, fontsize=9)
    _bare(panel)


def _show_shares(panel: Axes, maps: Mapping[str, NDArray[np.float32]], unit: str) -> None:
    """What the dearer half of the pixels costs."""
    for (tree, line), own in zip(lines_of(maps).items(), maps.values(), strict=True):
        panel.plot(100 * SHARES, np.quantile(own, SHARES), **line, linewidth=1.2, label=tree)
    panel.set_xlim(50, 100)
    panel.set_ylim(0)
    panel.set_xlabel("% of the pixels that are cheaper", fontsize=8)
    panel.set_title(f"whole paths: {unit}", fontsize=9)
    panel.legend(fontsize=7, frameon=False)
    panel.tick_params(labelsize=7)
    plain(panel)


def _bare(panel: Axes) -> None:
    panel.set_xticks([])
    panel.set_yticks([])


STUDY = Study(
    name="heatmap",
    help="what every pixel costs, under several accelerators side by side",
    title="Cost images",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_specs,
)
