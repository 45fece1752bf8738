"""Table 5.1 of the thesis's draft: render time against the number of directions, for every tree that has one.

Trees that draw their directions are built with a new seed in every repetition; others are the same every time, and
show the noise.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import median, stdev
from typing import TYPE_CHECKING

from ..figures import COLOURS, GUIDE, new_figure, plain
from ..inference import adjusted, finding
from ..messages import choices
from ..records import Record, ResultsFolder
from ..spec import parse_spec, spec_text
from ..speeds import BASELINES, NONE
from ..text_table import TextTable
from ..thesis import PUBLISHED_RENDER, published_scene
from .runs import RENDER, Runs, spec_of
from .study import Cell, Study, StudyOptions
from .verdicts import percent

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DRAWN = ("random", "normals", "clustered")
K = (3, 4, 5, 6, 7, 8, 9, 10, 13, 16)
KDOP_K, SPIRAL_K = (3, 7, 9, 13), range(4, 17)

#: Inches that a label takes in the figure's legend, and by how much of a k curves are drawn apart.
_LABEL, _APART = 2.4, 0.07

_LEGEND = (
    "Render time of a frame against k, the number of directions swept in a node, the axes included. Times are medians "
    "of all repetitions and their standard deviations; trees that draw directions have another seed each time. "
    "Percent are of the time of kd with the same layout, with 95 % bootstrap intervals; probabilities are corrected "
    "for the number of comparisons on the scene (Benjamini, Hochberg). What is within the noise of the scene is called "
    "so: that of as many runs of one and the same tree, at least 5 %."
)


@dataclass(frozen=True)
class Curve:
    """What is drawn as one line: trees that differ by k alone."""

    name: str
    axes: str
    layout: str
    directions: str = ""
    cached_dots: bool = True

    @property
    def title(self) -> str:
        extra = [self.directions] * bool(self.directions) + ["dots not cached"] * (not self.cached_dots)
        return ", ".join([f"{self.name}, axes {self.axes}", *extra, self.layout])


def add_options(group: OptionGroup) -> Sequence[str]:
    """What the curves are made of."""
    group.add_argument("--trees", nargs="+", default=[*DRAWN, "rbsp"], metavar="NAME", help="default: %(default)s")
    group.add_argument("--k", nargs="+", type=int, metavar="K", help=f"default: {choices(map(str, K))}; rbsp: its sets")
    group.add_argument("--axes", nargs="+", default=["none", "plain", "fast"], metavar="POLICY", help="%(default)s")
    group.add_argument(
        "--layouts",
        nargs="+",
        default=["binary", "wide"],
        metavar="LAYOUT",
        help="wide only with axes fast; %(default)s",
    )
    group.add_argument("--cost", default="measured", help="prices and rules of all trees, default: %(default)s")
    return ("trees", "k", "axes", "layouts", "cost")


def plan(options: StudyOptions) -> list[Cell]:
    """Every tree, with a new seed each time where it has one."""
    trees = list(BASELINES)
    wanted = options.choices
    for layout in wanted["layouts"]:
        trees.append(spec_text("kd", **_common(wanted, layout)))
        for axes in wanted["axes"] if layout == "binary" else {"fast"}.intersection(wanted["axes"]):
            for name in wanted["trees"]:
                trees += _trees(name, axes, layout, wanted)
    if wanted["layouts"] == ["wide"] and "fast" not in wanted["axes"]:
        raise ValueError(f"--layouts wide: trees with axes {choices(wanted['axes'])} have binary nodes only")
    seeded = {tree: "seed" in parse_spec(tree).settings for tree in trees}
    return [Cell("time", tree, options.repeats, seeded[tree]) for tree in seeded]


def _common(wanted: dict, layout: str) -> dict[str, str | None]:
    return {"layout": layout, "cost": None if wanted["cost"] == "measured" else wanted["cost"]}


def _trees(name: str, axes: str, layout: str, wanted: dict) -> list[str]:
    common = {"axes": axes, **_common(wanted, layout)}
    if name in DRAWN:
        return [spec_text(name, k=k, **common) for k in wanted["k"] or K]
    if name != "rbsp":
        raise ValueError(f'--trees: "{name}" has no number of directions (valid: {choices([*DRAWN, "rbsp"])})')
    if axes == "none":
        return []
    sets = [("kdop", k) for k in KDOP_K] + [("spiral", k) for k in SPIRAL_K]
    return [
        spec_text("rbsp", directions=directions, k=k, cached_dots=cached, **common)
        for directions, k in sets
        if not wanted["k"] or k in wanted["k"]
        for cached in ([None, False] if layout == "binary" else [None])
    ]


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """Seconds by k and scene, a table a curve; the best k of each; and what was published."""
    runs = Runs(rows)
    found = curves(runs)
    seconds = [
        TextTable(
            f"seconds: {curve.title}",
            ("k", *runs.scenes),
            tuple((str(k), *(_seconds(runs, scene, tree) for scene in runs.scenes)) for k, tree in by_k.items()),
        )
        for curve, by_k in found.items()
    ]
    by_scene = [table for scene in runs.scenes for table in _scene_tables(runs, scene, found)]
    published = _published_table(runs, found)
    return [*by_scene, *([published] if published else []), *seconds]


def curves(runs: Runs) -> dict[Curve, dict[int, str]]:
    """The trees of every curve by k, both in order."""
    found: dict[Curve, dict[int, str]] = {}
    for tree in runs.trees:
        settings = spec_of(tree).settings
        if "k" in settings:
            curve = Curve(
                spec_of(tree).name,
                str(settings["axes"]),
                str(settings["layout"]),
                str(settings.get("directions", "")),
                bool(settings.get("cached_dots", True)),
            )
            found.setdefault(curve, {})[int(settings["k"])] = tree
    order = {name: place for place, name in enumerate((*DRAWN, "rbsp"))}
    by_place = sorted(found, key=lambda c: (c.layout, order[c.name], c.axes, c.directions, not c.cached_dots))
    return {curve: dict(sorted(found[curve].items())) for curve in by_place}


def baseline(runs: Runs, layout: str) -> str | None:
    """The kd of a layout, if it was measured yet."""
    found = (t for t in runs.trees if spec_of(t).name == "kd" and spec_of(t).settings["layout"] == layout)
    return next(found, None)


def _seconds(runs: Runs, scene: str, tree: str) -> str:
    times = list(runs.values(scene, tree, RENDER).values())
    if not times:
        return NONE
    return f"{median(times):.3f} ± {stdev(times) if len(times) > 1 else 0:.3f}"


def _scene_tables(runs: Runs, scene: str, found: dict[Curve, dict[int, str]]) -> tuple[TextTable, TextTable]:
    """The k of the least median and the percent at every k, with all comparisons of the scene corrected together."""
    noise = runs.noise(scene)
    effects = {
        (curve, k): runs.effect(scene, tree, baseline(runs, curve.layout), RENDER)
        for curve, by_k in found.items()
        for k, tree in by_k.items()
    }
    corrected = dict(zip(effects, adjusted(list(effects.values())), strict=True))

    def word(curve: Curve, k: int) -> str:
        effect = effects[curve, k]
        return finding(effect, corrected[curve, k], noise) if effect else NONE

    def best(curve: Curve) -> tuple[str, ...]:
        own = {k: effect for (c, k), effect in effects.items() if c == curve and effect}
        if not own:
            return (NONE,) * 4
        k = min(own, key=lambda k: own[k].ratio.value)
        return (str(k), percent(own[k]), f"{corrected[curve, k]:.2g}", word(curve, k))

    def at(curve: Curve, k: int) -> str:
        effect = effects.get((curve, k))
        if not effect:
            return NONE
        return f"{100 * effect.ratio.value:.0f}{' *' if word(curve, k) in ('less', 'more') else ''}"

    every_k = sorted({k for _, k in effects})
    return (
        TextTable(
            f"{runs.title(scene)}: the best k (noise {noise:.1%})",
            ("trees", "k", "% of kd", "p", "finding"),
            tuple((curve.title, *best(curve)) for curve in found),
        ),
        TextTable(
            f"{scene}: percent of kd at every k (* is less or more, all else noise or unclear)",
            ("trees", *map(str, every_k)),
            tuple((curve.title, *(at(curve, k) for k in every_k)) for curve in found),
        ),
    )


def _published_table(runs: Runs, found: dict[Curve, dict[int, str]]) -> TextTable | None:
    """Ours beside the thesis's, for its scenes and those that stand in for one."""
    scenes = {scene: known for scene in runs.scenes if (known := published_scene(scene, runs.triangles(scene)))}
    names = [name for name, _ in scenes.values()]
    rows = []
    for curve, by_k in found.items():
        for k, tree in by_k.items():
            theirs = [PUBLISHED_RENDER[name].get(f"{curve.name}:k={k},axes={curve.axes}") for name in names]
            if curve.directions == "spiral" or not any(theirs):
                continue
            cells = []
            for scene, other in zip(scenes, theirs, strict=True):
                ours = runs.effect(scene, tree, baseline(runs, curve.layout), RENDER)
                cells += [f"{100 * ours.ratio.value:.1f}" if ours else NONE, f"{other:g}" if other else NONE]
            rows.append((curve.title, str(k), *cells))
    if not rows:
        return None
    other = [
        f"{scene} has other triangles" if name == scene else f"{scene} stands in for {name}"
        for scene, (name, same) in scenes.items()
        if not same
    ]
    title = "percent of kd, beside the thesis's" + f" ({'; '.join(other)})" * bool(other)
    head = (cell for scene in scenes for cell in (f"{scene} %", "thesis"))
    return TextTable(title, ("trees", "k", *head), tuple(rows))


def figures(rows: Sequence[Record], _: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """A panel a scene and kind of trees: percent of kd against k, with the interval of each median."""
    runs = Runs(rows)
    found = curves(runs)
    kinds = sorted({(curve.layout, curve.axes) for curve in found}, key=lambda kind: (kind[0], "npf".index(kind[1][0])))
    width = 1 + max(4.5, 2.9 * len(runs.scenes))
    figure = new_figure(width, 1.2 + 2.3 * len(kinds))
    grid = figure.subplots(len(kinds), len(runs.scenes), sharex=True, sharey="col", squeeze=False)
    for row, (layout, axes) in zip(grid, kinds, strict=True):
        for panel, scene in zip(row, runs.scenes, strict=True):
            _draw(panel, runs, scene, {c: by_k for c, by_k in found.items() if (c.layout, c.axes) == (layout, axes)})
            _draw_baselines(panel, runs, scene, layout)
            plain(panel)
        row[0].set_ylabel(f"axes {axes}, {layout}\n% of kd's time")
    for panel, scene in zip(grid[0], runs.scenes, strict=True):
        panel.set_title(scene)
    for panel in grid[-1]:
        panel.set_xlabel("directions k")
    lines = {line.get_label(): line for panel in grid.flat for line in panel.get_lines()}
    shown = {label: line for label, line in lines.items() if not label.startswith("_")}
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=int(width // _LABEL), frameon=False)
    yield "directions", figure


def _draw(panel: Axes, runs: Runs, scene: str, found: dict[Curve, dict[int, str]]) -> None:
    from matplotlib.ticker import MaxNLocator

    styles = {"": ("o", "-"), "kdop": ("s", "-"), "spiral": ("D", "--")}
    for place, (curve, by_k) in enumerate(found.items()):
        effects = {k: runs.effect(scene, tree, baseline(runs, curve.layout), RENDER) for k, tree in by_k.items()}
        points = [(k, effect.ratio) for k, effect in effects.items() if effect]
        if not points:
            continue
        marker, style = styles[curve.directions]
        ks = [k + _APART * (place - (len(found) - 1) / 2) for k, _ in points]
        label = ", ".join([curve.name, *[curve.directions] * bool(curve.directions)])
        label += "" if curve.cached_dots else ", dots not cached"
        face = COLOURS[curve.name] if curve.cached_dots else "white"
        panel.plot(
            ks, [100 * ratio.value for _, ratio in points], style, marker=marker, markersize=3.5, linewidth=1.2,
            color=COLOURS[curve.name], markerfacecolor=face, label=label,
        )  # fmt: skip
        interval = [100 * ratio.low for _, ratio in points], [100 * ratio.high for _, ratio in points]
        panel.vlines(ks, *interval, color=COLOURS[curve.name], linewidth=0.8, alpha=0.6)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))


def _draw_baselines(panel: Axes, runs: Runs, scene: str, layout: str) -> None:
    panel.axhline(100, color=GUIDE, linewidth=0.8, linestyle=":")
    if embree := runs.effect(scene, "embree", baseline(runs, layout), RENDER):
        panel.axhline(100 * embree.ratio.value, color=COLOURS["embree"], linewidth=1, linestyle="-.", label="embree")


STUDY = Study(
    name="directions",
    help="render time against the number of directions (table 5.1)",
    title="Render time against the number of directions",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
    repeats=6,
    least_repeats=6,
    repeated="seeds of each tree, and timed runs of those without a seed",
)
