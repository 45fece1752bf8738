"""What trees are made of: a table, and the nodes at each depth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..outcomes import Outcome
from ..speeds import NONE
from ..text_table import TextTable
from .charts import order_of

_HEAD = (
    "spec", "nodes", "depth", "oblique nodes", "leaves", "empty", "triangles a leaf", "refs/triangle", "capped leaves",
    "MB", "B/triangle",
)  # fmt: skip


def trees_of(outcome: Outcome) -> dict[str, dict[str, Mapping[str, Any]]]:
    """The statistics of every tree that tells of itself, by scene and spec; of repetitions and seeds the first."""
    found: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in outcome.folder.records():
        if (row.get("statistics") or {}).get("leaves") and not row.get("size"):
            found.setdefault(str(row["scene"]), {}).setdefault(str(row.get("tree", row["spec"])), row["statistics"])
    return found


def anatomy_table(trees: Mapping[str, Mapping[str, Any]]) -> TextTable:
    """One line a tree, those of one kind together."""
    rows = tuple((spec, *_cells(trees[spec])) for spec in sorted(trees, key=order_of))
    return TextTable("Anatomy of the trees", _HEAD, rows)


def _cells(stats: Mapping[str, Any]) -> tuple[str, ...]:
    full = stats["leaves"] - stats["empty_leaves"]
    triangles = max(1, stats["triangles"])
    oblique = stats["oblique_nodes"] / stats["interior_nodes"] if stats["interior_nodes"] else 0
    return (
        f"{stats['nodes']:,}",
        str(stats["max_depth"]),
        f"{oblique:.1%}",
        f"{stats['leaves']:,}",
        f"{stats['empty_leaves'] / stats['leaves']:.1%}",
        f"{stats['references'] / max(1, full):.1f}",
        f"{stats['references'] / triangles:.2f}",
        f"{stats['capped_leaves']:,}" if "capped_leaves" in stats else NONE,
        f"{stats['bytes'] / 1e6:.1f}",
        f"{stats['bytes'] / triangles:.0f}",
    )
