"""What this project is about, in a picture: where the normals of a scene point, and which directions trees choose.

Normals are axial (n and -n are the same plane), so a hemisphere holds them all. It is drawn as a disc by Lambert's
azimuthal projection, in which equal areas stay equal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..contenders import triangles_of
from ..figures import COLOURS, new_figure
from ..jobs import Job
from ..loading import open_file
from ..records import Record, ResultsFolder
from ..spec import parse_spec
from ..speeds import NONE
from ..text_table import TextTable
from ..verification.audit import NeutralTree, depths, neutral_tree
from ..verification.meshes import Mesh
from ..verification.polygons import Real, cut, heights
from .runs import Runs, spec_of
from .study import Cell, Study, StudyOptions, arrays_file
from .work import axis_area_share, normals_and_areas, save_arrays

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

SPECS = ("kd", "rbsp", "random", "normals", "clustered", "ize")

#: The nodes that are looked at: at each of these depths the one with most triangles.
DEPTHS = (0, 4, 8)

#: Levels of the tree below a node whose directions are drawn.
LEVELS = 9

#: Cells along a side of the map.
BINS = 64

#: The colours of the map, and the least share that can be told from none.
_GREYS, _LEAST = "Greys", 1e-5

#: Radians: a triangle nearer to a plane's direction than this is parallel to it.
_PARALLEL = np.radians(5)

_LEGEND = (
    "The geometric normals of the triangles of a node, weighted by their area inside its cell, on the hemisphere "
    "(equal areas are equal; normals have no sign), and the directions of the planes that the tree chose in the node "
    f"and the {LEVELS} levels below it. Parallel: the share of a node's area within 5 degrees of the direction that "
    "it is cut along, mean over the nodes of these levels below the root."
)


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which trees."""
    group.add_argument("--specs", nargs="+", default=SPECS, metavar="SPEC", help=f"default: {' '.join(SPECS)}")
    return ("specs",)


def plan(options: StudyOptions) -> list[Cell]:
    """Every tree once."""
    return [Cell("normals", text) for text in only_trees(options.choices["specs"])]


def only_trees(specs: Sequence[str]) -> list[str]:
    """The specs, once each; ValueError for what has no planes to be drawn."""
    for spec in map(parse_spec, specs):
        if not spec.is_tree or spec.name == "brute":
            raise ValueError(f'"{spec.text}" does not show its planes: leave it out of --specs')
    return list(dict.fromkeys(specs))


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Build `job.spec`; the maps of normals and the directions of each chosen node go into `job.arrays`."""
    stage(f"loading {job.scene}")
    vertices, faces = triangles_of(open_file(job.scene, params=job.params).meshes).merged()
    stage(f"building {job.spec}")
    tree = neutral_tree(Mesh("scene", vertices, faces), parse_spec(job.spec))
    stage(f"looking at the nodes of {job.spec}")
    subtrees = Subtrees(tree)
    seen = tree.seen(vertices)[faces]
    nodes = [subtrees.heaviest(depth) for depth in DEPTHS]
    arrays: dict[str, NDArray[np.generic]] = {}
    for number, node in enumerate(nodes):
        normals, areas = normals_and_areas(vertices[faces[subtrees.triangles(node)]])
        areas = _areas_inside(tree, node, seen[subtrees.triangles(node)]) if node else areas
        below = subtrees.inner_below(node, LEVELS)
        arrays |= {
            f"map{number}": _map(normals, areas),
            f"directions{number}": (tree.normals[below] @ tree.axes).astype(np.float32),
            f"depths{number}": (subtrees.depths[below] - subtrees.depths[node]).astype(np.uint8),
        }
    save_arrays(Path(job.arrays), arrays)
    top = subtrees.inner_below(0, LEVELS)
    return {
        "nodes": [{"depth": int(subtrees.depths[n]), "triangles": len(subtrees.triangles(n))} for n in nodes],
        "interior_nodes": int((~tree.is_leaf).sum()),
        "oblique_share": _share(_is_oblique(tree, np.flatnonzero(~tree.is_leaf))),
        "oblique_share_at_top": _share(_is_oblique(tree, top)),
        "parallel_share": float(np.mean([_parallel(tree, subtrees, n, seen) for n in top] or [0])),
        "axis_area_share": axis_area_share(vertices, faces),
    }


class Subtrees:
    """What lies below each node: nodes and references are consecutive, for they are stored depth first."""

    def __init__(self, tree: NeutralTree) -> None:
        self._tree = tree
        self.depths = depths(tree)
        end = np.arange(1, len(tree.is_leaf) + 1)
        for node in np.flatnonzero(~tree.is_leaf)[::-1]:
            end[node] = end[tree.above[node]]
        self._end = end
        self._before = np.concatenate([[0], np.cumsum(np.where(tree.is_leaf, tree.count.astype(int), 0))])

    def triangles(self, node: int) -> NDArray[np.uint32]:
        """The triangles of a node, ascending."""
        return np.unique(self._tree.references[self._before[node] : self._before[self._end[node]]])

    def heaviest(self, depth: int) -> int:
        """The node at a depth with most references below it; where the tree ends earlier, the one above."""
        nodes = np.flatnonzero(self.depths == min(depth, self.depths.max()))
        return int(nodes[np.argmax(self._before[self._end[nodes]] - self._before[nodes])])

    def inner_below(self, node: int, levels: int) -> NDArray[np.intp]:
        """Interior nodes from this one down."""
        span = np.arange(node, self._end[node])
        return span[~self._tree.is_leaf[span] & (self.depths[span] < self.depths[node] + levels)]


def path_to(tree: NeutralTree, node: int) -> list[tuple[int, bool]]:
    """The nodes above a node, from the root, and whether the path goes to the child above the plane."""
    path, at = [], 0
    while at != node:
        above = bool(tree.above[at] <= node)
        path.append((at, above))
        at = int(tree.above[at]) if above else at + 1
    return path


def _areas_inside(tree: NeutralTree, node: int, corners: NDArray[np.float32]) -> NDArray[np.float64]:
    """The areas of triangles inside the cell of a node."""
    owners, polygons = np.arange(len(corners)), corners.astype(Real)
    for plane, above in path_to(tree, node):
        normals, offsets = (
            np.repeat(values[[plane]], len(polygons), axis=0) for values in (tree.normals, tree.offsets)
        )
        height = heights(polygons, normals, offsets)
        # A triangle in a plane is on one side of it, however its corners were rounded.
        polygons, kept = cut(polygons, (-height if above else height) - 2 * tree.plane_tolerance)
        owners = owners[kept]
    fans = np.cross(polygons[:, 1:-1] - polygons[:, :1], polygons[:, 2:] - polygons[:, :1])
    areas = np.linalg.norm(fans.sum(axis=1).astype(float), axis=1) / 2
    return np.bincount(owners, weights=areas, minlength=len(corners))


def _is_oblique(tree: NeutralTree, nodes: NDArray[np.intp]) -> NDArray[np.bool_]:
    return (tree.normals[nodes] != 0).sum(axis=1) > 1


def _share(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else 0.0


def _parallel(tree: NeutralTree, subtrees: Subtrees, node: int, corners: NDArray[np.float32]) -> float:
    normals, areas = normals_and_areas(corners[subtrees.triangles(node)])
    direction = tree.normals[node] / np.linalg.norm(tree.normals[node])
    return float(areas[np.abs(normals @ direction) >= np.cos(_PARALLEL)].sum() / max(areas.sum(), 1e-300))


def project(normals: NDArray[np.floating]) -> NDArray[np.float64]:
    """(n, 2) inside the unit circle: Lambert's azimuthal equal-area projection of the hemisphere z >= 0."""
    up = np.where(normals[:, 2:] < 0, -normals, normals).astype(float)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), np.finfo(float).tiny)
    return up[:, :2] / np.sqrt(1 + up[:, 2:])


def _map(normals: NDArray[np.float64], areas: NDArray[np.float64]) -> NDArray[np.float32]:
    """The share of the area in each cell of the map; what lies on the rim is on both of its sides."""
    points, weights = project(normals), areas / max(areas.sum(), 1e-300)
    on_rim = np.abs(normals[:, 2]) < 1e-3
    points = np.concatenate([points, -points[on_rim]])
    weights = np.concatenate([np.where(on_rim, weights / 2, weights), weights[on_rim] / 2])
    shares, *_ = np.histogram2d(*points.T, bins=BINS, range=[(-1.02, 1.02)] * 2, weights=weights)
    return shares.astype(np.float32)


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """How much of each tree is oblique, and how parallel its planes are to the geometry."""
    runs = Runs(rows)
    return [_scene_table(runs, scene) for scene in runs.scenes]


def _scene_table(runs: Runs, scene: str) -> TextTable:
    def cells(tree: str) -> tuple[str, ...]:
        row = runs.first(scene, "normals", tree)
        if row is None:
            return (NONE,) * 4
        shares = (row["oblique_share"], row["oblique_share_at_top"], row["parallel_share"])
        return (f"{row['interior_nodes']:,}", *(f"{share:.1%}" for share in shares))

    share = next(row["axis_area_share"] for tree in runs.trees if (row := runs.first(scene, "normals", tree)))
    return TextTable(
        f"{scene}, {runs.triangles(scene):,} triangles, {share:.0%} of the area within a degree of an axis",
        ("spec", "interior nodes", "oblique", f"oblique, top {LEVELS} levels", "parallel"),
        tuple((tree, *cells(tree)) for tree in runs.ordered(SPECS)),
    )


def figures(rows: Sequence[Record], folder: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """A figure a scene: a column a tree, a row a chosen node."""
    runs = Runs(rows)
    for scene in runs.scenes:
        trees = [
            t for t in runs.ordered(SPECS) if (r := runs.first(scene, "normals", t)) and _file(folder, r).is_file()
        ]
        if trees:
            yield f"normals-{scene}", _figure(runs, scene, trees, folder)


def _file(folder: ResultsFolder, row: Record) -> Path:
    return arrays_file(folder, "normals", str(row["scene"]), str(row["spec"]))


def _figure(runs: Runs, scene: str, trees: Sequence[str], folder: ResultsFolder) -> Figure:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    found = {tree: runs.first(scene, "normals", tree) for tree in trees}
    loaded = {tree: _load(_file(folder, row)) for tree, row in found.items()}
    most = max(float(arrays[f"map{number}"].max()) for arrays in loaded.values() for number in range(len(DEPTHS)))
    norm = LogNorm(_LEAST, max(2 * _LEAST, most))
    figure = new_figure(1.2 + 2.5 * len(trees), 0.9 + 2.75 * len(DEPTHS))
    grid = figure.subplots(len(DEPTHS), len(trees), squeeze=False)
    for column, (tree, arrays) in enumerate(loaded.items()):
        for number, node in enumerate(found[tree]["nodes"]):
            parts = (arrays[f"{part}{number}"] for part in ("map", "directions", "depths"))
            _draw(grid[number, column], *parts, COLOURS[spec_of(tree).name], norm)
            where = "the whole scene" if node["depth"] == 0 else f"depth {node['depth']}"
            grid[number, column].set_title(f"{where}, {node['triangles']:,} triangles", fontsize=8)
        grid[0, column].set_title(f"{tree}\n{grid[0, column].get_title()}", fontsize=9)
    figure.suptitle(f"{scene}: normals by area (grey), and the directions that trees cut along (circles)", fontsize=10)
    figure.colorbar(
        ScalarMappable(norm, _GREYS), ax=grid, fraction=0.02, pad=0.01, extend="min",
        label=f"share of the node's area, of each of {BINS} x {BINS} cells",
    )  # fmt: skip
    figure.legend(handles=_sizes(), loc="outside lower center", ncols=5, frameon=False, fontsize=9)
    return figure


def _load(file: Path) -> dict[str, NDArray[np.generic]]:
    with np.load(file) as arrays:
        return dict(arrays)


def _draw(
    panel: Axes,
    shares: NDArray[np.float32],
    directions: NDArray[np.float32],
    levels: NDArray[np.uint8],
    colour: str,
    norm: Normalize,
) -> None:
    from matplotlib.patches import Circle

    shown = np.ma.masked_less_equal(shares.T, 0)
    panel.add_patch(Circle((0, 0), 1, fill=False, edgecolor="0.5", linewidth=0.8, zorder=1.5))
    panel.imshow(
        shown, origin="lower", extent=(-1.02, 1.02, -1.02, 1.02), cmap=_GREYS, norm=norm, interpolation="nearest",
        zorder=1, rasterized=True,
    )  # fmt: skip
    if len(directions):
        points = project(directions)
        rim = np.abs(directions[:, 2]) < 1e-6
        points, sizes = np.concatenate([points, -points[rim]]), _area(np.concatenate([levels, levels[rim]]))
        panel.scatter(*points.T, s=sizes, facecolors="none", edgecolors=colour, linewidths=0.8, zorder=2)
    for name, place in (("x", (1.14, 0)), ("y", (0, 1.14)), ("z", (0.12, 0.1))):
        panel.text(*place, name, ha="center", va="center", fontsize=9, color="0.3", zorder=3)
    panel.set_aspect("equal")
    panel.set_xlim(-1.2, 1.2)
    panel.set_ylim(-1.2, 1.2)
    panel.set_axis_off()


def _area(levels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Of the circle of a direction, in square points: nodes farther down have smaller ones."""
    return 60 * 0.72 ** levels.astype(float)


def _sizes() -> list[Line2D]:
    """What the sizes of circles mean."""
    from matplotlib.lines import Line2D

    return [
        Line2D(
            [], [], linestyle="none", marker="o", color="0.3", markerfacecolor="none", markeredgewidth=0.8,
            markersize=float(np.sqrt(_area(np.array(level)))),
            label=f"{level} levels below" if level else "a plane of the node",
        )
        for level in range(0, LEVELS, 2)
    ]  # fmt: skip


STUDY = Study(
    name="normals",
    help="the distribution of normals on the sphere, and the directions that trees choose",
    title="Normals, and the directions of planes",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
)
