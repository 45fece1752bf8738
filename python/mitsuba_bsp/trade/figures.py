"""The four figures of the command `trade`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from typing import TYPE_CHECKING

from ..figures import COLOURS, GUIDE, new_figure, plain
from ..records import Record
from ..spec import Spec
from ..studies.runs import Runs, spec_of
from ..verification.subjects import INCUMBENTS
from .found import REFERENCES, families, front, points, time_of, typical, work_per_ray, worst
from .speeds import RAYS
from .tables import ordered

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARKERS = {"safe": "o", "epsilon": "^", "fast": "s", "auto": "D"}

_EARLY = "v"

_STEPS = ("axis_steps", "oblique_steps")

#: How incumbents are written beside their stars.
_SHORT = {"native": "native", "embree": "Embree", "embree:robust=true": "Embree robust"}


#: Inches that a legend needs.
_LEAST_WIDTH = 10.5


def make_figures(rows: Sequence[Record]) -> Iterator[tuple[str, Figure]]:
    """Those for which there are records."""
    runs = Runs(rows)
    if any(points(runs, scene) for scene in runs.scenes):
        yield "trade-front", _front_figure(runs)
    if any(runs.first(scene, "far", tree) for scene in runs.scenes for tree in runs.trees):
        yield "trade-distance", _distance_figure(runs)
    if any(runs.first(scene, "speed", tree) for scene in runs.scenes for tree in runs.trees):
        yield "trade-bounds", _bounds_figure(runs)
        yield "trade-references", _references_figure(runs)


def _grid(runs: Runs, height: float, width: float = 6.2) -> tuple[Figure, list[Axes]]:
    figure = new_figure(max(_LEAST_WIDTH, width * len(runs.scenes)), height)
    panels = list(figure.subplots(1, len(runs.scenes), squeeze=False)[0])
    for panel, scene in zip(panels, runs.scenes, strict=True):
        panel.set_title(f"{scene}, {runs.triangles(scene):,} triangles", fontsize=10)
        plain(panel)
    return figure, panels


def _front_figure(runs: Runs) -> Figure:
    """Speed against failures; what has none is drawn at the rate that its rays exclude, with an arrow."""
    figure, panels = _grid(runs, 5.2)
    for panel, scene in zip(panels, runs.scenes, strict=True):
        panel.set_xscale("log")
        shown = {}
        for tree, (failures, speed) in points(runs, scene).items():
            rate = worst(families(runs, scene, tree))
            x = rate.shown
            shown[tree] = (x, speed)
            if tree in INCUMBENTS:
                panel.plot(x, speed, "*", markersize=15, color=COLOURS[spec_of(tree).name], zorder=4)
                panel.annotate(_SHORT[tree], (x, speed), (7, 4), textcoords="offset points", fontsize=8)
            else:
                panel.plot(x, speed, **_look(spec_of(tree)))
            if failures == 0:
                panel.annotate("", (x / 2.2, speed), (x, speed), arrowprops={"arrowstyle": "->", "color": GUIDE})
                panel.update_datalim([(x / 2.2, speed)])  # which arrows do not, so that they would be cut off
        best = front(shown)
        xs, ys = zip(*(shown[tree] for tree in best), strict=True) if best else ((), ())
        panel.step(xs, ys, where="post", color="0.3", linewidth=1, linestyle="--", zorder=1)
        for tree in best:
            if tree not in INCUMBENTS:
                panel.annotate(tree, shown[tree], (6, -9), textcoords="offset points", fontsize=7, color="0.3")
        panel.set_xlabel("failures per ray, worst family of rays (arrow: none seen, rate excluded at 95 %)")
        panel.margins(x=0.12)
    panels[0].set_ylabel("Mrays/s of one thread, rays of a frame")
    names = sorted({spec_of(tree).name for tree in runs.trees if spec_of(tree).is_tree})
    _legend(figure, names)
    return figure


def _look(spec: Spec) -> dict[str, object]:
    """Colour: the tree; marker: its precision, or that it exits early; filled: the watertight triangle test."""
    woop = spec.settings["triangle_test"] == "woop"
    exits_at_plane = spec.settings["early_exit"] == "plane"
    return {
        "marker": _EARLY if exits_at_plane else _MARKERS[str(spec.settings["precision"])],
        "color": COLOURS[spec.name],
        "fillstyle": "full" if woop else "none",
        "markersize": 5.5,
        "linestyle": "none",
    }


def _legend(figure: Figure, names: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], marker="o", linestyle="none", color=COLOURS[name], label=name) for name in names]
    handles += [
        Line2D([], [], marker=marker, linestyle="none", color="0.4", label=f"precision={precision}")
        for precision, marker in _MARKERS.items()
        if precision != "auto"
    ]
    handles += [
        Line2D([], [], marker=_EARLY, linestyle="none", color="0.4", label="early_exit=plane"),
        Line2D([], [], marker="o", linestyle="none", color="0.4", fillstyle="none", label="triangle_test=mt"),
    ]
    handles.append(Line2D([], [], linestyle="--", color="0.3", label="Pareto front"))
    figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False, fontsize=8)


def _distance_figure(runs: Runs) -> Figure:
    """Failures of the worst family against how far the scene was moved; a floor stands for none."""
    figure, panels = _grid(runs, 4.6)
    for panel, scene in zip(panels, runs.scenes, strict=True):
        panel.set_xscale("symlog", linthresh=1, linscale=0.5)
        panel.set_yscale("log")
        for tree in ordered(runs):
            row = runs.first(scene, "far", tree)
            if row:
                rates = [(place["sizes"], worst(place["families"])) for place in row["distances"]]
                xs, ys = zip(*((sizes, rate.shown) for sizes, rate in rates if rate), strict=True)
                spec = spec_of(tree)
                if tree in INCUMBENTS:
                    style = {"marker": "*", "color": COLOURS[spec.name], "markersize": 9}
                    style["linestyle"] = ":" if spec.options else "-"
                else:
                    style = {**_look(spec), "linestyle": "-" if spec.settings["triangle_test"] == "woop" else "--"}
                panel.plot(xs, ys, **style, linewidth=1.2, label=_SHORT.get(tree, tree))
        panel.set_xlabel("distance from the origin, in sizes of the scene")
    panels[0].set_ylabel("failures per ray, worst family\n(lowest: none seen, rate excluded at 95 %)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=8)
    return figure


def _bounds_figure(runs: Runs) -> Figure:
    """Steps that the bounds on errors add, and time, by scene, tree and kind of ray."""
    figure = new_figure(5.6 * 2, 0.9 + 2.3 * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), 2, sharex="col", squeeze=False)
    trees = [tree for tree in ordered(runs) if ":" not in tree and f"{tree}:precision=fast" in runs.trees]
    for line, scene in zip(grid, runs.scenes, strict=True):
        for number, tree in enumerate(trees):
            for panel, read in zip(line, (_added_steps, _added_time), strict=True):
                found = [read(runs, scene, tree, kind) for kind in RAYS]
                places = [place + 0.8 * (number + 0.5) / len(trees) - 0.4 for place in range(len(RAYS))]
                heights = [0.0 if value is None else 100 * (value - 1) for value in found]
                panel.bar(places, heights, 0.7 / len(trees), color=COLOURS[tree], label=tree)
        for panel, what in zip(line, ("steps", "time"), strict=True):
            panel.axhline(0, color=GUIDE, linewidth=0.8)
            panel.set_xticks(range(len(RAYS)), RAYS)
            panel.set_title(f"{scene}: {what}, safe over fast", fontsize=10)
            plain(panel)
        line[0].set_ylabel("% more")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _added_steps(runs: Runs, scene: str, tree: str, kind: str) -> float | None:
    rows = [runs.first(scene, "speed", name) for name in (tree, f"{tree}:precision=fast")]
    safe, fast = (row and work_per_ray(row, (kind,), *_STEPS) for row in rows)
    return safe / fast if safe and fast else None


def _added_time(runs: Runs, scene: str, tree: str, kind: str) -> float | None:
    ratios = runs.ratios(scene, tree, f"{tree}:precision=fast", time_of((kind,), kind)).values()
    return median(ratios) if ratios else None


def _references_figure(runs: Runs) -> Figure:
    """References per triangle against the number of directions; each plane of a triangle, as a line."""
    figure, panels = _grid(runs, 4.2, 5.2)
    for panel, scene in zip(panels, runs.scenes, strict=True):
        curves: dict[str, dict[int, float]] = {}
        for tree in runs.trees:
            spec, references = spec_of(tree), typical(runs, scene, tree, REFERENCES)
            if not references or not set(spec.options) <= {"k", "directions"}:
                continue
            relative = references / runs.triangles(scene)
            if spec.name == "ize":
                panel.axhline(relative, color=COLOURS["ize"], linestyle=":", label="ize: every triangle's planes")
            else:
                curves.setdefault(spec.name, {})[int(spec.settings.get("k", 3))] = relative
        for name, curve in sorted(curves.items()):
            panel.plot(*zip(*sorted(curve.items()), strict=True), "o-", color=COLOURS[name], markersize=4, label=name)
        panel.set_xlabel("directions (k)")
        panel.set_ylim(bottom=1)
    panels[0].set_ylabel("references per triangle")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure
