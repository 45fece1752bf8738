"""The sentences of the thesis's draft, as pairs of trees.

Fast axis nodes exist with binary nodes only, so everything is built with those; what is said of trees at large is asked
of wide nodes as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from ..spec import spec_text
from .runs import DEAREST, HOT_SPOTS, LEAF_TRIANGLES, REFERENCES, RENDER, STEPS, TESTS, Quantity

K = (4, 6, 8)
LAYOUTS = ("binary", "wide")
SOURCES = ("random", "normals", "clustered")


@dataclass(frozen=True)
class Claim:
    """A sentence: `quantity` of the first of each pair of trees is `expected` than that of the second."""

    sentence: str
    expected: Literal["less", "more"]
    quantity: Quantity
    pairs: tuple[tuple[str, str], ...]


def _tree(name: str, **options: object) -> str:
    return spec_text(name, **{"layout": "binary", **options})


def _of_sources(sources: Sequence[str] = SOURCES, ks: Sequence[int] = K, **options: object) -> list[str]:
    return [_tree(name, k=k, axes="fast", **options) for name in sources for k in ks]


def _against_kd(trees: Sequence[str], layout: str) -> tuple[tuple[str, str], ...]:
    return tuple((tree, _tree("kd", layout=layout)) for tree in trees)


def _same_k(one: str, other: str) -> tuple[tuple[str, str], ...]:
    return tuple((_tree(one, k=k, axes=axes), _tree(other, k=k, axes=axes)) for axes in ("fast", "none") for k in K)


def _axes(one: str, other: str) -> tuple[tuple[str, str], ...]:
    return tuple((_tree(name, k=k, axes=one), _tree(name, k=k, axes=other)) for name in SOURCES for k in K)


#: With the axes among the directions, and without.
AXES_PAIRS = _axes("plain", "none")

#: Said of them, and judged over scenes and not on each.
ALIGNMENT = "The axes help because scenes are partly axis-aligned"

#: Both kinds of tree split as long as they can: a test costs as much as eighty steps.
_TO_THE_END = {"intersection_cost": 80.0, "retract": False, "bad_refines": 60}


def _claims() -> tuple[Claim, ...]:
    found = []
    for layout in LAYOUTS:
        pairs = _against_kd(_of_sources(ks=(6,), layout=layout), layout)
        against = f"than kd-trees ({layout} nodes)"
        found += [
            Claim(f"BSP trees need fewer triangle tests {against}", "less", TESTS, pairs),
            Claim(f"BSP trees take more traversal steps {against}", "more", STEPS, pairs),
            Claim(f"BSP trees render in less time {against}", "less", RENDER, pairs),
            Claim(f"BSP trees have cheaper hot spots {against}", "less", DEAREST["path"], pairs),
            Claim(f"BSP trees have fewer hot spots, relative to the mean, {against}", "less", HOT_SPOTS["path"], pairs),
        ]
    apart = tuple((_tree(name, k=6, axes="fast", **_TO_THE_END), _tree("kd", **_TO_THE_END)) for name in SOURCES)
    same = "directions than random ones, at equal k, axes and seed"
    return (
        *found,
        Claim(f"Normals are better {same}: fewer tests", "less", TESTS, _same_k("normals", "random")),
        Claim(f"Normals are better {same}: less time", "less", RENDER, _same_k("normals", "random")),
        Claim("Clustering the normals is better than drawing them: less time", "less", RENDER,
              _same_k("clustered", "normals")),
        Claim("The axes among the directions help: less time with them (plain) than without, at equal k", "less",
              RENDER, AXES_PAIRS),
        Claim("Fast axis nodes help: less time than with plain ones", "less", RENDER, _axes("fast", "plain")),
        Claim("kd-trees cannot separate what BSP trees can: fewer triangles in a leaf when both split to the end",
              "less", LEAF_TRIANGLES, apart),
        Claim("kd-trees cannot separate what BSP trees can: fewer references per triangle when both split to the end",
              "less", REFERENCES, apart),
    )  # fmt: skip


CLAIMS = _claims()
