"""Figure 2.1 and table 2.1 of the thesis's draft: how many planes trees look at, how many of them differ, per level.

What is predicted is what the papers say (2 planes per triangle and direction, 4 more along every triangle for `ize`, of
all n triangles at every level); what is counted are the planes that lie inside their node's cell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from .. import _core
from ..accelerator import survey_planes
from ..contenders import build, triangles_of
from ..figures import COLOURS, new_figure, plain
from ..jobs import Job
from ..loading import open_file
from ..records import Record, ResultsFolder
from ..spec import parse_spec, spec_text
from ..speeds import NONE
from ..text_table import TextTable
from .runs import Runs, spec_of
from .study import Cell, Study, StudyOptions

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: The thesis's rules: every direction is swept exactly in every node, and triangles are not clipped.
TREES = tuple(
    spec_text(name, **options, cost="thesis")
    for name, options in (
        ("kd", {}),
        ("rbsp", {"k": 13}),
        ("ize", {}),
        ("random", {"k": 6}),
        ("normals", {"k": 6}),
        ("clustered", {"k": 6}),
    )
)

_LEGEND = (
    "Planes that a build looks at, per level of the tree. Predicted is what the papers say: so many planes per "
    "triangle in every node, of which fixed directions and planes of triangles come back on every level. Considered "
    "planes lie inside their node's cell, equal ones of a node counted once; different planes are counted once "
    "however many nodes look at them, those of a level among the level's own; how many are different up to a level is "
    "predicted only, and counted for all levels together."
)


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which trees."""
    group.add_argument("--specs", nargs="+", default=TREES, metavar="SPEC", help=f"default: {' '.join(TREES)}")
    return ("specs",)


def plan(options: StudyOptions) -> list[Cell]:
    """Every tree once."""
    for text in options.choices["specs"]:
        spec = parse_spec(text)
        if not spec.is_tree or spec.name == "brute":
            raise ValueError(f'"{text}" looks at no planes that could be counted: leave it out of --specs')
    return [Cell("planes", text) for text in dict.fromkeys(options.choices["specs"])]


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Build `job.spec` and count its planes; `planes` are (considered, different) per level, `whole` of the tree."""
    spec = parse_spec(job.spec)
    stage(f"loading {job.scene}")
    triangles = triangles_of(open_file(job.scene, params=job.params).meshes)
    stage(f"building {job.spec}")
    statistics = build(spec, triangles).statistics()
    stage(f"counting the planes of {job.spec}")
    levels, whole = survey_planes(*triangles.merged(), job.spec)
    return {
        "statistics": statistics,
        "planes": levels,
        "whole": whole,
        "traits": _core.traits(spec.name, dict(spec.options)),
    }


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """Table 2.1, and predicted beside counted for every scene, in all and level by level."""
    runs = Runs(rows)
    return [
        *_traits_tables(runs, rows),
        *(_scene_table(runs, scene) for scene in runs.scenes),
        *(table for scene in runs.scenes for table in _level_tables(runs, scene)),
    ]


def _traits_tables(runs: Runs, rows: Sequence[Record]) -> list[TextTable]:
    """What the trees say of themselves."""
    traits = {str(row["tree"]): row["traits"] for row in rows}
    trees = runs.ordered(TREES)

    def different(own: Mapping[str, Any]) -> str:
        new = own["planes_per_triangle"] - own["recurring_per_triangle"]
        return f"{own['recurring_per_triangle']}n" + (f" + {new}n a level" if new else "")

    properties: dict[str, Callable[[str], str]] = {
        "directions of the node's triangles": lambda tree: _yes(traits[tree]["from_triangles"]),
        "drawn at random": lambda tree: _yes(traits[tree]["drawn"]),
        "planes looked at in a node": lambda tree: f"{traits[tree]['planes_per_triangle']}n",
        "different planes": lambda tree: different(traits[tree]),
        "kd nodes of their own": lambda tree: _yes(spec_of(tree).settings.get("axes", "fast") == "fast"),
    }
    return [
        TextTable(
            "the planes that a node may be cut by", ("spec", "planes"), tuple((t, traits[t]["planes"]) for t in trees)
        ),
        TextTable(
            "what a node of n triangles looks at (table 2.1)",
            ("", *map(_short, trees)),
            tuple((name, *map(cell, trees)) for name, cell in properties.items()),
        ),
    ]


def _scene_table(runs: Runs, scene: str) -> TextTable:
    def cells(tree: str) -> tuple[str, ...]:
        row = runs.first(scene, "planes", tree)
        if row is None:
            return (NONE,) * 6
        foreseen, levels = predicted(row), len(row["planes"])
        considered, different = row["whole"]
        return (
            str(levels),
            _millions(sum(foreseen["considered"])),
            _millions(considered),
            _millions(foreseen["different"][-1] if levels else 0),
            _millions(different),
            f"{different / considered:.1%}" if considered else NONE,
        )

    return TextTable(
        f"{scene}, {runs.triangles(scene):,} triangles: millions of planes",
        ("spec", "levels", "considered, predicted", "counted", "different, predicted", "counted", "different share"),
        tuple((tree, *cells(tree)) for tree in runs.ordered(TREES)),
    )


def _level_tables(runs: Runs, scene: str) -> list[TextTable]:
    """A line a level, a column a tree: what is counted, and in brackets what is predicted."""
    found = {tree: row for tree in runs.ordered(TREES) if (row := runs.first(scene, "planes", tree))}
    foreseen = {tree: predicted(row) for tree, row in found.items()}
    levels = max(len(row["planes"]) for row in found.values())

    def table(place: int, name: str, words: str, whole: Callable[[Sequence[int]], int]) -> TextTable:
        def cell(tree: str, level: int) -> str:
            counted = found[tree]["planes"]
            if level >= len(counted):
                return NONE
            return _both(counted[level][place], foreseen[tree][name][level])

        sums = (_both(row["whole"][place], whole(foreseen[tree][name])) for tree, row in found.items())
        lines = (tuple(cell(tree, level) for tree in found) for level in range(levels))
        return TextTable(
            f"{scene}: millions of {words}",
            ("level", *map(_short, found)),
            (*((str(level), *line) for level, line in enumerate(lines)), ("all", *sums)),
        )

    words = "different planes, counted on the level alone (predicted up to it)"
    return [
        table(0, "considered", "planes considered on a level, counted (predicted)", sum),
        table(1, "different", words, lambda up_to: max(up_to, default=0)),
    ]


def _both(counted: float, foreseen: float) -> str:
    return f"{counted / 1e6:.3g} ({foreseen / 1e6:.3g})"


def _short(tree: str) -> str:
    """Without the prices, which all trees of the default have."""
    return tree.removesuffix(",cost=thesis").removesuffix(":cost=thesis")


def predicted(row: Record) -> Mapping[str, list[int]]:
    """Per level: planes `considered` there, and `different` ones up to there, if all n triangles are on every level."""
    n, traits = row["statistics"]["triangles"], row["traits"]
    recurring, levels = traits["recurring_per_triangle"], range(1, len(row["planes"]) + 1)
    new = traits["planes_per_triangle"] - recurring
    return {
        "considered": [traits["planes_per_triangle"] * n for _ in levels],
        "different": [(recurring + new * level) * n for level in levels],
    }


def figures(rows: Sequence[Record], _: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """A panel a scene and tree: considered and different planes per level."""
    runs = Runs(rows)
    trees = runs.ordered(TREES)
    figure = new_figure(1 + 2.2 * len(trees), 0.8 + 2.2 * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), len(trees), sharex="row", sharey="row", squeeze=False)
    labelled: dict[str, Artist] = {}
    for line, scene in zip(grid, runs.scenes, strict=True):
        for panel, tree in zip(line, trees, strict=True):
            if row := runs.first(scene, "planes", tree):
                _draw(panel, row)
                labelled = labelled or {drawn.get_label(): drawn for drawn in panel.lines}
            plain(panel)
        line[0].set_ylabel(f"{scene}\nplanes")
    for panel, tree in zip(grid[0], trees, strict=True):
        panel.set_title(_short(tree), fontsize=9)
    for panel in grid[-1]:
        panel.set_xlabel("level")
    columns = 3 if len(trees) > 2 else 1
    figure.legend(labelled.values(), labelled.keys(), loc="outside lower center", ncols=columns, frameon=False)
    yield "planes", figure


def _draw(panel: Axes, row: Record) -> None:
    colour = COLOURS[spec_of(str(row["tree"])).name]
    levels, foreseen = range(len(row["planes"])), predicted(row)
    panel.set_yscale("log")
    panel.plot(levels, foreseen["considered"], color="0.8", linewidth=3, label="considered, predicted")
    panel.plot(levels, [max(1, considered) for considered, _ in row["planes"]], "-", color=colour, label="considered")
    panel.plot(
        levels, foreseen["different"], ":", color=colour, linewidth=1.8, label="different up to the level, predicted"
    )
    panel.plot(levels, [max(1, new) for _, new in row["planes"]], "--", color=colour, label="different on the level")
    panel.plot(
        levels[-1:], [max(1, row["whole"][1])] * len(levels[-1:]), "D", color=colour, markersize=4,
        label="different in all",
    )  # fmt: skip


def _yes(true: bool) -> str:
    return "yes" if true else "no"


def _millions(count: float) -> str:
    return f"{count / 1e6:.3f}"


STUDY = Study(
    name="planes",
    help="planes considered and different planes, per level (figure 2.1, table 2.1)",
    title="Planes considered, and different planes",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
)
