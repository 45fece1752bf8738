"""How figures look: one style, one colour for each kind of tree, files that are the same every time."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours that the colour-blind can tell apart (Okabe, Ito 2008), by the name of the accelerator.
COLOURS = {
    "auto": "#E69F00",
    "kd": "#000000",
    "rbsp": "#CC79A7",
    "ize": "#B8860B",
    "random": "#0072B2",
    "normals": "#D55E00",
    "clustered": "#009E73",
    "native": "#8C8C8C",
    "embree": "#56B4E9",
    "brute": "#999999",
}

GUIDE = "0.55"  #: of lines that are no data

_DASHES = ("-", "--", ":", "-.")

_DPI = 160


def new_figure(width: float, height: float) -> Figure:
    """An empty figure; inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def lines_of(specs: Iterable[str]) -> dict[str, dict[str, str]]:
    """How the line of each spec is drawn: the colour is that of its name, and those of one name differ by dashes."""
    found: dict[str, dict[str, str]] = {}
    for spec in specs:
        colour = COLOURS[spec.partition(":")[0]]
        earlier = sum(other["color"] == colour for other in found.values())
        found[spec] = {"color": colour, "linestyle": _DASHES[earlier % len(_DASHES)]}
    return found


def plain(axes: Axes, grid: bool = True) -> Axes:
    """Axes without a box, with a faint grid."""
    axes.spines[["top", "right"]].set_visible(False)
    if grid:
        axes.grid(which="major", color="0.9", linewidth=0.6)
        axes.set_axisbelow(True)
    return axes


def save_figure(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write NAME.png and NAME.svg."""
    import matplotlib as mpl

    files = [folder / f"{name}.png", folder / f"{name}.svg"]
    # Ids and dates would make the same figure another file every time.
    with mpl.rc_context({"svg.hashsalt": name}):
        for file in files:
            metadata = {"Date": None} if file.suffix == ".svg" else {"Software": None}
            figure.savefig(file, dpi=_DPI, metadata=metadata)
    return files
