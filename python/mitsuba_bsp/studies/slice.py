"""A cross-section through a scene and its trees, cells coloured by depth and by cost, and the first planes in space.

The cost of a cell is what a ray pays that ends in it: the steps down to it and the triangles of its leaf, at the tree's
own prices.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..contenders import triangles_of
from ..jobs import Job
from ..loading import open_file
from ..prices import plane_prices
from ..records import Record, ResultsFolder
from ..spec import Spec, parse_spec
from ..speeds import NONE
from ..text_table import TextTable
from ..verification.audit import NeutralTree, depths, neutral_tree
from ..verification.meshes import Mesh
from ..verification.polygons import Polygons, Real, cut, heights, joined
from .normals import Subtrees, only_trees, path_to
from .runs import Runs
from .study import Cell, Study, StudyOptions, arrays_file
from .work import normals_and_areas, save_arrays

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.figure import Figure

SPECS = ("kd", "rbsp", "random", "normals", "clustered", "ize")

#: Levels of split planes that are drawn in space.
PLANE_LEVELS = 5

#: What is shown and weighed is inside a box that holds so much of the triangles, with a margin of its longest side, if
#: that is less than half as long as the scene: a floor without end would else fill every picture.
_SHOWN, _MARGIN = 0.98, 0.05

#: Points of the surface that are drawn with them.
_POINTS, _SEED = 4000, 0

_LEGEND = (
    "The leaf cells that a plane through the scene cuts; where the scene is more than twice as long as the box around "
    "98 % of its triangles, in that box. Cost is what a ray pays that ends in a cell: the steps down to it and the "
    "tests in its leaf, at the tree's own prices. Area-weighted: the mean over the area of the section."
)


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which trees, and where they are cut."""
    group.add_argument("--specs", nargs="+", default=SPECS, metavar="SPEC", help=f"default: {' '.join(SPECS)}")
    group.add_argument(
        "--plane",
        type=_plane,
        metavar="x=N",
        help="x=N, y=N, z=N, or A,B,C,D for Ax + By + Cz = D; default: through the middle, across the most triangles",
    )
    return ("specs", "plane")


def _plane(text: str) -> list[float]:
    """Normal and offset, as the type of an argument."""
    axis, equals, offset = text.partition("=")
    try:
        if equals:
            normal = [float(axis == name) for name in "xyz"]
            found = [*normal, float(offset)]
        else:
            found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != 4 or not np.isfinite(found).all() or not any(found[:3]):
        raise argparse.ArgumentTypeError(f'"{text}" is no plane: give x=N, y=N, z=N, or A,B,C,D')
    return found


def plan(options: StudyOptions) -> list[Cell]:
    """Every tree once."""
    return [Cell("slice", text) for text in only_trees(options.choices["specs"])]


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Build `job.spec` and cut it; polygons, and the scene's own section, go into `job.arrays`."""
    spec = parse_spec(job.spec)
    stage(f"loading {job.scene}")
    vertices, faces = triangles_of(open_file(job.scene, params=job.params).meshes).merged()
    corners = vertices[faces].astype(float)
    plane = np.array(job.choices["plane"] or default_plane(corners), float)
    plane /= np.linalg.norm(plane[:3])
    check_crosses(plane, corners)
    stage(f"building {job.spec}")
    tree = neutral_tree(Mesh("scene", vertices, faces), spec)
    box = shown_box(corners)
    if not len(_box_part(plane, box)):
        box = _bounds(corners)  # who asks for a plane beside it wants to see it
    stage(f"cutting {job.spec}")
    cells, leaves = section(tree, tree.seen_plane(plane))
    cells, inside = inside_box(tree.unseen(cells), box)
    leaves = leaves[inside]
    across = basis(plane)
    if len(leaves) and np.argmax(np.ptp((cells @ across.T.astype(Real)).reshape(-1, 2), axis=0)) == 1:
        across = across[::-1]  # the longer side lies across
    flat = (cells @ across.T.astype(Real)).astype(np.float32)
    if not len(flat) or not np.ptp(flat.reshape(-1, 2), axis=0).any():
        raise ValueError(_beside(plane, corners))  # nearer to the scene's end than floats tell
    cost = leaf_costs(tree, spec)[leaves]
    level = depths(tree)[leaves]
    save_arrays(
        Path(job.arrays),
        {
            "cells": flat,
            "depth": level.astype(np.uint8),
            "cost": cost.astype(np.float32),
            "segments": (outline(corners, plane) @ across.T).astype(np.float32),
            **first_planes(tree, box),
            "points": surface_points(corners, box),
            "box": box.astype(np.float32),
        },
    )
    areas = _areas(flat.astype(float))
    total = max(areas.sum(), 1e-300)
    return {
        "plane": plane.tolist(),
        "cells": len(leaves),
        "empty_area": float(areas[tree.count[leaves] == 0].sum() / total),
        "mean_depth": float((areas * level).sum() / total),
        "mean_cost": float((areas * cost).sum() / total),
        "triangles_per_cell": float((areas * tree.count[leaves]).sum() / total),
    }


def shown_box(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lower and upper corner of a box around those triangles (n, 3, 3) that reach least far from the middle, or
    around all of them.
    """
    reach = np.abs(corners - np.median(corners, axis=(0, 1))).max(axis=(1, 2))
    low, high = _bounds(corners[reach <= np.quantile(reach, _SHOWN, method="higher")])
    whole = _bounds(corners)
    if 2 * (high - low).max() > np.ptp(whole, axis=0).max():
        return whole
    margin = _MARGIN * (high - low).max()
    return np.clip([low - margin, high + margin], *whole)


def _bounds(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])


def default_plane(corners: NDArray[np.float64]) -> list[float]:
    """Perpendicular to the axis and through the middle of what is shown, where most triangles are cut."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    middle = shown_box(corners).mean(axis=0)
    axis = int(((low < middle) & (high > middle)).sum(axis=0).argmax())
    return [float(axis == 0), float(axis == 1), float(axis == 2), float(middle[axis])]


def check_crosses(plane: NDArray[np.float64], corners: NDArray[np.float64]) -> None:
    """ValueError unless triangles (n, 3, 3) reach to both sides of the plane, or all of them lie in it."""
    low, high = _reach(plane, corners)
    if not (low < plane[3] < high or low == plane[3] == high):
        raise ValueError(_beside(plane, corners))


def _reach(plane: NDArray[np.float64], corners: NDArray[np.float64]) -> tuple[float, float]:
    """From where to where triangles reach along the normal of a plane."""
    along = corners @ plane[:3]
    return float(along.min()), float(along.max())


def _beside(plane: NDArray[np.float64], corners: NDArray[np.float64]) -> str:
    low, high = _reach(plane, corners)
    return (
        f"the plane {_equation(plane)} does not cut the scene, which reaches from {low:.6g} to {high:.6g} along the "
        "plane's normal"
    )


def _equation(plane: Sequence[float]) -> str:
    *normal, offset = (f"{number:.4g}" for number in plane)
    return f"({', '.join(normal)}) . p = {offset}"


def basis(plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """Two unit vectors (2, 3) along a plane; of a plane across an axis they are the other axes."""
    normal = plane[:3]
    first = np.eye(3)[(np.abs(normal).argmax() + 1) % 3]
    first = first - normal * (first @ normal)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def _square(plane: NDArray[np.float64], box: NDArray[np.float64]) -> Polygons:
    """(1, 4, 3): a part of a plane that covers all of the box."""
    centre = box.mean(axis=0)
    centre = centre + plane[:3] * (plane[3] - centre @ plane[:3])
    first, second = basis(plane) * np.linalg.norm(box[1] - box[0])
    return np.array([[centre + first, centre + second, centre - first, centre - second]], Real)


def _box_part(plane: NDArray[np.float64], box: NDArray[np.float64]) -> Polygons:
    """The part of a plane inside the box; empty if there is none."""
    return inside_box(_square(plane, box), box)[0]


def inside_box(polygons: Polygons, box: NDArray[np.float64]) -> tuple[Polygons, NDArray[np.intp]]:
    """The parts of polygons (m, k, 3) inside a box, and which of them have one."""
    owners = np.arange(len(polygons))
    for axis in range(3):
        for side, sign in ((0, -1.0), (1, 1.0)):
            if len(polygons):
                polygons, kept = cut(polygons, sign * (polygons[..., axis] - Real(box[side, axis])))
                owners = owners[kept]
    return polygons, owners


def section(tree: NeutralTree, plane: NDArray[np.float64]) -> tuple[Polygons, NDArray[np.intp]]:
    """The polygons (m, k, 3) in which a plane meets leaf cells, and their leaves. Works downward, level by level."""
    polygons = _box_part(plane, tree.box)
    nodes, found, leaves = np.zeros(len(polygons), int), [polygons[:0]], [np.zeros(0, int)]
    while len(nodes):
        at_leaf = tree.is_leaf[nodes]
        found.append(polygons[at_leaf])
        leaves.append(nodes[at_leaf])
        nodes, polygons = nodes[~at_leaf], polygons[~at_leaf]
        if not len(nodes):
            break
        height = heights(polygons, tree.normals[nodes], tree.offsets[nodes])
        below, goes_below = cut(polygons, height)
        above, goes_above = cut(polygons, -height)
        nodes = np.concatenate([nodes[goes_below] + 1, tree.above[nodes[goes_above]].astype(int)])
        polygons = joined(below, above)
    return joined(*found), np.concatenate(leaves)


def outline(corners: NDArray[np.float64], plane: NDArray[np.float64]) -> NDArray[np.float64]:
    """The segments (m, 2, 3) in which a plane meets triangles; those that lie in it are left out."""
    height = corners @ plane[:3] - plane[3]
    crossed = (height.min(axis=1) < 0) & (height.max(axis=1) >= 0)
    triangles, height = corners[crossed], height[crossed]
    following, height_following = np.roll(triangles, -1, axis=1), np.roll(height, -1, axis=1)
    crossing = (height < 0) != (height_following < 0)
    step = np.where(crossing, height - height_following, 1)
    points = triangles + (following - triangles) * (height / step)[..., None]
    return points[crossing].reshape(-1, 2, 3)


def leaf_costs(tree: NeutralTree, spec: Spec) -> NDArray[np.float64]:
    """Of every node: the price of the steps down to it, and of a leaf's triangles."""
    axis_plane, oblique_plane = plane_prices(spec.settings)
    oblique = (tree.normals != 0).sum(axis=1) > 1
    step = np.where(oblique, oblique_plane, axis_plane)
    cost = np.zeros(len(tree.is_leaf))
    for node in np.flatnonzero(~tree.is_leaf):
        cost[node + 1] = cost[tree.above[node]] = cost[node] + step[node]
    filled = tree.is_leaf & (tree.count > 0)
    test, visit = float(spec.settings["intersection_cost"]), float(spec.settings["leaf_cost"])
    cost[filled] += visit + test * tree.count[filled]
    return cost


def first_planes(tree: NeutralTree, box: NDArray[np.float64]) -> dict[str, NDArray[np.generic]]:
    """`planes` (p, k, 3): each of the first levels' planes inside its cell and the box, which is the user's; `levels`
    (p,); whether it is `oblique`. Levels begin at the last node that has most of the triangles.
    """
    subtrees = Subtrees(tree)
    top = _top(tree, subtrees)
    polygons, owners = [np.zeros((0, 4, 3), Real)], []
    for node in subtrees.inner_below(top, PLANE_LEVELS):
        plane = np.append(tree.normals[node], tree.offsets[node]) / np.linalg.norm(tree.normals[node])
        part = _box_part(plane, tree.box)
        for ancestor, above in path_to(tree, node):
            if len(part):
                height = heights(part, tree.normals[[ancestor]], tree.offsets[[ancestor]])
                part, _ = cut(part, -height if above else height)
        part, _ = inside_box(tree.unseen(part), box)
        polygons.append(part)
        owners += [node] * len(part)
    return {
        "planes": joined(*polygons).astype(np.float32),
        "levels": (subtrees.depths[owners] - subtrees.depths[top]).astype(np.uint8)
        if owners
        else np.zeros(0, np.uint8),
        "oblique": (tree.normals[owners] != 0).sum(axis=1) > 1 if owners else np.zeros(0, bool),
    }


def _top(tree: NeutralTree, subtrees: Subtrees) -> int:
    """The last node on the way down from the root that has so much of the triangles as is shown."""
    node, least = 0, _SHOWN * len(subtrees.triangles(0))
    while not tree.is_leaf[node]:
        fuller = max((node + 1, int(tree.above[node])), key=lambda child: len(subtrees.triangles(child)))
        if len(subtrees.triangles(fuller)) < least:
            break
        node = fuller
    return node


def surface_points(corners: NDArray[np.float64], box: NDArray[np.float64]) -> NDArray[np.float32]:
    """(n, 3) points drawn uniformly from the surface inside a box."""
    parts, _ = inside_box(corners, box)
    triangles = np.concatenate([parts[:, [0, second, second + 1]] for second in range(1, parts.shape[1] - 1)])
    rng = np.random.default_rng(_SEED)
    _, areas = normals_and_areas(triangles)
    chosen = triangles[rng.choice(len(triangles), _POINTS, p=areas / areas.sum())]
    weights = rng.dirichlet((1, 1, 1), _POINTS)
    return np.einsum("nk,nkj->nj", weights, chosen).astype(np.float32)


def _areas(polygons: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of flat polygons (m, k, 2)."""
    following = np.roll(polygons, -1, axis=1)
    return np.abs((polygons[..., 0] * following[..., 1] - polygons[..., 1] * following[..., 0]).sum(axis=1)) / 2


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The cells that are cut, a table a scene."""
    runs = Runs(rows)
    return [_scene_table(runs, scene) for scene in runs.scenes]


def _scene_table(runs: Runs, scene: str) -> TextTable:
    def cells(row: Record) -> tuple[str, ...]:
        numbers = (row["mean_depth"], row["mean_cost"], row["triangles_per_cell"])
        return (f"{row['cells']:,}", f"{row['empty_area']:.0%}", *(f"{number:.2f}" for number in numbers))

    found = {tree: runs.first(scene, "slice", tree) for tree in runs.ordered(SPECS)}
    plane = next(row["plane"] for row in found.values() if row)
    return TextTable(
        f"{scene}, {runs.triangles(scene):,} triangles, cut by {_equation(plane)}",
        ("spec", "cells", "empty area", "mean depth", "mean cost", "mean triangles"),
        tuple((tree, *(cells(row) if row else (NONE,) * 5)) for tree, row in found.items()),
    )


def figures(rows: Sequence[Record], folder: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """For every scene its cross-sections, and the first planes in space."""
    from .slice_figures import planes_figure, section_figure

    runs = Runs(rows)
    for scene in runs.scenes:
        found = {
            tree: row
            for tree in runs.ordered(SPECS)
            if (row := runs.first(scene, "slice", tree))
            and arrays_file(folder, "slice", scene, str(row["spec"])).is_file()
        }
        if found:
            yield f"slice-{scene}", section_figure(scene, found, folder)
            yield f"slice-planes-{scene}", planes_figure(scene, found, folder)


STUDY = Study(
    name="slice",
    help="a cross-section through scene and tree, and the first split planes in space",
    title="Cross-sections",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
)
