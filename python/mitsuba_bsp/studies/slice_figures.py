"""The figures of a cross-section: cells coloured by depth and cost, and the first planes in space."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..figures import COLOURS, new_figure
from ..records import Record, ResultsFolder
from .runs import spec_of
from .study import arrays_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Arrays = Mapping[str, NDArray[np.generic]]

#: The enlarged part is so much of the longer side.
_ZOOM = 0.2

_SIDE = 2.6  #: inches


def section_figure(scene: str, found: Mapping[str, Record], folder: ResultsFolder) -> Figure:
    """A column a tree; rows: depth, the densest part of it, and the cost there."""
    loaded = _load(found, folder)
    any_arrays = next(iter(loaded.values()))
    cells = any_arrays["cells"]
    low, high = cells.min(axis=(0, 1)), cells.max(axis=(0, 1))
    window = _densest(any_arrays["segments"], low, high)
    width, height = high - low
    tall = _SIDE * float(np.clip(height / width, 0.3, 1.6))
    figure = new_figure(0.9 + _SIDE * len(loaded), 0.8 + tall + 2 * _SIDE)
    grid = figure.subplots(3, len(loaded), squeeze=False, height_ratios=[tall, _SIDE, _SIDE])
    rows = (
        ("depth", (low, high), "depth", "viridis"),
        ("depth", window, "depth, enlarged", "viridis"),
        ("cost", window, "cost, enlarged", "inferno"),
    )
    for line, (values, frame, label, colours) in zip(grid, rows, strict=True):
        reach = _reach(loaded, values, frame)
        for panel, arrays in zip(line, loaded.values(), strict=True):
            shown = _draw(panel, arrays, values, frame, colours, reach)
        line[0].set_ylabel(label)
        figure.colorbar(shown, ax=list(line), fraction=0.03, pad=0.01)
    for panel, (tree, row) in zip(grid[0], found.items(), strict=True):
        panel.set_title(f"{tree}\n{row['cells']:,} cells", fontsize=9)
        _frame(panel, window)
    figure.suptitle(f"{scene}: a cross-section through the scene (black) and the cells of its trees", fontsize=10)
    return figure


def _load(found: Mapping[str, Record], folder: ResultsFolder) -> dict[str, dict[str, NDArray[np.generic]]]:
    loaded = {}
    for tree, row in found.items():
        with np.load(arrays_file(folder, "slice", str(row["scene"]), str(row["spec"]))) as arrays:
            loaded[tree] = dict(arrays)
    return loaded


def _densest(
    segments: NDArray[np.float32], low: NDArray[np.float32], high: NDArray[np.float32]
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """The corners of the square in which the scene's section has most segments."""
    side = float(min(_ZOOM * (high - low).max(), (high - low).min()))
    if not len(segments):
        return low, low + side
    middles = segments.mean(axis=1)
    bins = [np.arange(a, b + side / 2, side / 4) for a, b in zip(low, high, strict=True)]
    counts, *edges = np.histogram2d(*middles.T, bins=bins)
    place = np.unravel_index(counts.argmax(), counts.shape)
    centre = np.array([edge[i] + side / 8 for edge, i in zip(edges, place, strict=True)])
    corner = np.clip(centre - side / 2, low, np.maximum(low, high - side))
    return corner, corner + side


def _reach(loaded: Mapping[str, Arrays], values: str, frame: Sequence[NDArray[np.floating]]) -> tuple[float, float]:
    """One scale for all trees: what is inside the frame, without the dearest percent."""
    inside = []
    for arrays in loaded.values():
        middle = arrays["cells"].mean(axis=1)
        inside.append(arrays[values][((middle >= frame[0]) & (middle <= frame[1])).all(axis=1)])
    both = np.concatenate(inside).astype(float)
    return (float(both.min()), float(np.quantile(both, 0.99))) if len(both) else (0.0, 1.0)


def _draw(
    panel: Axes,
    arrays: Arrays,
    values: str,
    frame: Sequence[NDArray[np.floating]],
    colours: str,
    reach: tuple[float, float],
) -> object:
    from matplotlib.collections import LineCollection, PolyCollection

    enlarged = bool((frame[1] - frame[0]).max() < 0.9 * np.ptp(arrays["cells"].reshape(-1, 2), axis=0).max())
    shown = PolyCollection(
        arrays["cells"], array=arrays[values].astype(float), cmap=colours, clim=reach, rasterized=True,
        edgecolors="white" if enlarged else "face", linewidths=0.25 if enlarged else 0.1,
    )  # fmt: skip
    panel.add_collection(shown, autolim=False)
    lines = LineCollection(arrays["segments"], colors="black", linewidths=1.0 if enlarged else 0.5, rasterized=True)
    panel.add_collection(lines, autolim=False)
    panel.set_xlim(frame[0][0], frame[1][0])
    panel.set_ylim(frame[0][1], frame[1][1])
    panel.set_aspect("equal")
    panel.set_xticks([])
    panel.set_yticks([])
    return shown


def _frame(panel: Axes, window: Sequence[NDArray[np.floating]]) -> None:
    from matplotlib.patches import Rectangle

    panel.add_patch(Rectangle(window[0], *(window[1] - window[0]), fill=False, edgecolor="#D55E00", linewidth=1.2))


def planes_figure(scene: str, found: Mapping[str, Record], folder: ResultsFolder) -> Figure:
    """The first split planes of every tree, with points of the scene's surface."""
    loaded = _load(found, folder)
    columns = -(-len(loaded) // 2)
    figure = new_figure(3.6 * columns, 0.5 + 3.6 * 2)
    for place, (tree, arrays) in enumerate(loaded.items(), start=1):
        panel = figure.add_subplot(2, columns, place, projection="3d")
        _draw_planes(panel, arrays, COLOURS[spec_of(tree).name])
        panel.set_title(tree, fontsize=9)
    figure.suptitle(
        f"{scene}: the first levels of planes below the node with 98 % of the triangles; coloured: oblique ones",
        fontsize=10,
    )
    return figure


def _draw_planes(panel: Axes, arrays: Arrays, colour: str) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    panel.scatter(*arrays["points"].T, s=0.6, color="0.25", linewidths=0, alpha=0.6, rasterized=True)
    for polygon, level, oblique in zip(*(arrays[name] for name in ("planes", "levels", "oblique")), strict=True):
        shade = colour if oblique else "0.6"
        filled = 0.3 if oblique else 0.25 * 0.4 ** int(level)
        panel.add_collection3d(Poly3DCollection([polygon], facecolors=[shade], edgecolors="none", alpha=filled))
        panel.plot(*np.vstack([polygon, polygon[:1]]).T, color=shade, linewidth=0.9 if oblique else 0.4)
    low, high = arrays["box"]
    panel.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    panel.set_box_aspect(high - low, zoom=1.15)
    panel.set_axis_off()
