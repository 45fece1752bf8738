"""What trees look like: the sizes of their leaves, and where their kd nodes are."""

from __future__ import annotations

from collections.abc import Sequence

from ..records import Record
from ..speeds import NONE
from ..text_table import TextTable
from .runs import Runs

#: Leaves are listed by these numbers of triangles, from the one to below the next.
_LEAF_SIZES = (0, 1, 2, 3, 5, 9, 17)


def shape_tables(runs: Runs, scene: str, trees: Sequence[str]) -> list[TextTable]:
    """Of one scene."""
    return [_leaf_table(runs, scene, trees), _depth_table(runs, scene, trees)]


def _leaf_table(runs: Runs, scene: str, trees: Sequence[str]) -> TextTable:
    """How many leaves have how many triangles."""
    bounds = [*_LEAF_SIZES, None]
    names = [_size_name(low, high) for low, high in zip(bounds, bounds[1:], strict=False)]

    def cells(row: Record) -> tuple[str, ...]:
        stats = row["statistics"]
        sizes, leaves = stats["leaf_sizes"], stats["leaves"]
        shares = (sum(sizes[low:high]) / leaves for low, high in zip(bounds, bounds[1:], strict=False))
        filled = max(1, leaves - stats["empty_leaves"])
        return (
            f"{leaves:,}",
            f"{stats['references'] / stats['triangles']:.2f}",
            f"{stats['references'] / filled:.2f}",
            *(f"{share:.1%}" for share in shares),
        )

    rows = [(tree, row) for tree in trees if (row := tree_row(runs, scene, tree))]
    return TextTable(
        f"{scene}: leaves by their number of triangles",
        ("spec", "leaves", "references per triangle", "per filled leaf", *names),
        tuple((tree, *cells(row)) for tree, row in rows),
    )


def _size_name(low: int, high: int | None) -> str:
    return f"{low} or more" if high is None else f"{low}" if high == low + 1 else f"{low} to {high - 1}"


def _depth_table(runs: Runs, scene: str, trees: Sequence[str]) -> TextTable:
    """The share of kd nodes among interior nodes, by depth."""
    rows = [(tree, row) for tree in trees if (row := tree_row(runs, scene, tree))]
    depths = range(0, max((len(row["statistics"]["levels"]) for _, row in rows), default=0), 3)

    def share(row: Record, depth: int) -> str:
        value = axis_node_shares(row)
        return f"{value[depth]:.0%}" if depth < len(value) and value[depth] is not None else NONE

    return TextTable(
        f"{scene}: the share of kd nodes among interior nodes, by depth",
        ("spec", *map(str, depths)),
        tuple((tree, *(share(row, depth) for depth in depths)) for tree, row in rows),
    )


def tree_row(runs: Runs, scene: str, tree: str) -> Record | None:
    """The counted record of one of our trees."""
    row = runs.first(scene, "work", tree)
    return row if row and row["statistics"] else None


def axis_node_shares(row: Record) -> list[float | None]:
    """By depth; None where there are no interior nodes."""
    levels = row["statistics"]["levels"]
    inner = [(level["axis_nodes"], level["axis_nodes"] + level["oblique_nodes"]) for level in levels]
    return [axis / total if total else None for axis, total in inner]
