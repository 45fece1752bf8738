"""The figure of how building grows: time against triangles on logarithmic axes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .build_table import Growth
from .figures import GUIDE, new_figure, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def growth_figure(title: str, found: Sequence[Growth]) -> Figure:
    """A point a size, the fitted powers, and n log n for the eye."""
    figure = new_figure(6.4, 4.4)
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel="triangles", ylabel="build time (s)", title=title)
    for growth, marker in zip(found, "osD^vPX*" * len(found), strict=False):
        if growth.law is None:
            continue
        n = np.geomspace(growth.triangles[0], growth.triangles[-1], 50)
        (line,) = axes.plot(n, growth.law.seconds(n), linewidth=1.2)
        exponent = growth.law.exponent
        label = f"{growth.spec}: $n^{{{exponent.value:.2f}}}$ [{exponent.low:.2f}, {exponent.high:.2f}]"
        axes.plot(growth.triangles, growth.seconds, marker, color=line.get_color(), label=label)
        guide = growth.seconds[0] * n * np.log(n) / (n[0] * np.log(n[0]))
        axes.plot(n, guide, color=GUIDE, linewidth=0.8, linestyle=":", zorder=1)
    axes.plot([], [], color=GUIDE, linewidth=0.8, linestyle=":", label="n log n, from the smallest size")
    _label_ticks(axes, sorted({size for growth in found for size in growth.triangles}))
    plain(axes).legend(frameon=False)
    return figure


def _label_ticks(axes: Axes, sizes: Sequence[int]) -> None:
    """Ticks at the sizes that were measured, and at round times."""
    from matplotlib.ticker import EngFormatter, LogLocator, NullLocator

    label = EngFormatter(sep="", places=0)
    axes.set_xticks(sizes, [label(size) for size in sizes])
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter("{x:g}")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_minor_locator(NullLocator())
