"""The picture of a difference: both images, where and how much they differ, what noise explains, and FLIP."""

from __future__ import annotations

import textwrap
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from .flip import flip, rgb
from .gates import NoisyPair, Place, finite_pixels, z_scores
from .judging import Judgement, Rendering

_PANEL = 3.6  # inches
_MARK = "#00c800"


def draw(path: Path, one: Rendering, other: Rendering, judgement: Judgement) -> float | None:
    """Write the picture as PNG; returns the mean of FLIP, None if its package is not installed."""
    height, width = next(iter(one.image.values())).shape
    aspect = float(np.clip(height / width, 0.3, 3))
    columns = 2 if judgement.noise is None else 3
    figure = Figure(figsize=(columns * _PANEL * 1.15, 2 * (_PANEL * aspect + 0.4) + 1.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(2, columns)
    white = _white(other)
    _show(grid[0, 0], one, white, f"A: {_short(one)}")
    _show(grid[0, 1], other, white, f"B: {_short(other)}")
    _show_difference(figure, grid[1, 0], one, other)
    error = flip(one.image, other.image)
    flip_axes = grid[0, 2] if columns == 3 else grid[1, 1]
    if error is None:
        _nothing(flip_axes, "FLIP: flip-evaluator\nis not installed")
    else:
        _map(figure, flip_axes, error, f"FLIP, mean {error.mean():.4f}", "magma", 0, 1)
    if judgement.noise is not None:
        _show_scores(figure, grid[1, 1], judgement.noise, 1)
        _show_scores(figure, grid[1, 2], judgement.noise, 16)
    for axes in grid.flat:
        axes.set_xticks([])
        axes.set_yticks([])
    for place in {gate.place for gate in judgement.failed if gate.place}:
        for axes in grid[:, :2].flat:
            _mark(axes, place, width)
    figure.suptitle(
        _heading(judgement, 50 * columns),
        fontsize=10,
        ha="left",
        x=0.01,
        color="black" if judgement.same else "#b00000",
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    return None if error is None else float(error.mean())


def _heading(judgement: Judgement, width: int) -> str:
    words = ["same" if judgement.same else "DIFFERENT"]
    words += [f"{gate.name} {'passed' if gate.passed else 'FAILED'}: {gate.found}" for gate in judgement.gates]
    return "\n".join(textwrap.fill(line, width, subsequent_indent="    ") for line in words)


def _short(rendering: Rendering) -> str:
    spec = rendering.header.get("spec", "")
    return textwrap.shorten(f"{Path(rendering.name).name} {f'({spec})' if spec else ''}", 45, placeholder="...")


def _white(rendering: Rendering) -> float:
    """The level shown as white: bright, but not the brightest pixel."""
    level = float(np.percentile(rgb(rendering.image), 98))
    return level if level > 0 else max(float(rgb(rendering.image).max()), 1e-6)


def _show(axes: Axes, rendering: Rendering, white: float, title: str) -> None:
    linear = np.clip(rgb(rendering.image) / white, 0, 1)
    shown = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.power(linear, 1 / 2.4) - 0.055)
    shown[~finite_pixels(rendering.image)] = (1, 0, 1)  # what is no number cannot be overlooked
    axes.imshow(shown, interpolation="nearest")
    axes.set_title(title, fontsize=9)


def _show_difference(figure: Figure, axes: Axes, one: Rendering, other: Rendering) -> None:
    first, second = rgb(one.image).mean(axis=2), rgb(other.image).mean(axis=2)
    gap = (first - second).astype(np.float64)
    reach = float(np.percentile(np.abs(gap), 99.5)) or float(np.abs(gap).max()) or 1e-6
    _map(figure, axes, gap, "A - B, mean of the colours", "RdBu_r", -reach, reach, extend="both")


def _show_scores(figure: Figure, axes: Axes, noise: NoisyPair, side: int) -> None:
    scores = z_scores(noise, side)
    channel = np.abs(scores).argmax(axis=2)[..., None]
    worst = np.take_along_axis(scores, channel, axis=2)[..., 0]
    height, width = noise.image.shape[:2]
    shown = np.kron(worst, np.ones((side, side)))[:height, :width]
    what = "pixels" if side == 1 else f"{side}x{side} blocks"
    _map(figure, axes, shown, f"z of {what} (worst channel)", "PuOr_r", -6, 6, extend="both")


def _map(
    figure: Figure, axes: Axes, values: np.ndarray, title: str, colours: str, low: float, high: float,
    extend: str = "neither",
) -> None:  # fmt: skip
    shown = axes.imshow(values, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
    bar = figure.colorbar(shown, ax=axes, fraction=0.046, pad=0.02, extend=extend)
    bar.ax.tick_params(labelsize=8)
    bar.formatter.set_powerlimits((-3, 3))
    axes.set_title(title, fontsize=9)


def _nothing(axes: Axes, text: str) -> None:
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, ha="center", va="center", fontsize=10, color="#606060", transform=axes.transAxes)


def _mark(axes: Axes, place: Place, width: int) -> None:
    """A frame around a place, wide enough to be seen around a single pixel."""
    margin = max(1.0, width / 60)
    corner = (place.x - 0.5 - margin, place.y - 0.5 - margin)
    side = place.side + 2 * margin
    axes.add_patch(Rectangle(corner, side, side, fill=False, edgecolor=_MARK, linewidth=1.6))
