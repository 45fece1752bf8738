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
from ..figures import COLOURS, GUIDE, new_figure, plain
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
    "however many nodes look at them."
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
    """Table 2.1, and predicted beside counted for every scene."""
    runs = Runs(rows)
    return [*_traits_tables(runs, rows), *(_scene_table(runs, scene) for scene in runs.scenes)]


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
            ("", *(tree.partition(",cost")[0].partition(":cost")[0] for tree in trees)),
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
        f"{scene}, {runs.first(scene, 'planes', runs.trees[0])['triangles']:,} triangles: millions of planes",
        ("spec", "levels", "considered, predicted", "counted", "different, predicted", "counted", "different share"),
        tuple((tree, *cells(tree)) for tree in runs.ordered(TREES)),
    )


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
    for line, scene in zip(grid, runs.scenes, strict=True):
        for panel, tree in zip(line, trees, strict=True):
            if row := runs.first(scene, "planes", tree):
                _draw(panel, row)
            plain(panel)
        line[0].set_ylabel(f"{scene}\nplanes")
    for panel, tree in zip(grid[0], trees, strict=True):
        panel.set_title(tree.removesuffix(",cost=thesis").removesuffix(":cost=thesis"), fontsize=9)
    for panel in grid[-1]:
        panel.set_xlabel("level")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    yield "planes", figure


def _draw(panel: Axes, row: Record) -> None:
    colour = COLOURS[spec_of(str(row["tree"])).name]
    levels = range(len(row["planes"]))
    panel.set_yscale("log")
    panel.plot(levels, predicted(row)["considered"], ":", color=GUIDE, label="considered, predicted")
    panel.plot(levels, [max(1, considered) for considered, _ in row["planes"]], "-", color=colour, label="considered")
    panel.plot(levels, [max(1, new) for _, new in row["planes"]], "--", color=colour, label="different on the level")


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
