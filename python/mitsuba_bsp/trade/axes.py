"""What is varied: one setting at a time from the default, and the grid of those that decide most."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

from ..spec import Value, parse_spec, spec_text
from ..verification.subjects import INCUMBENTS

#: Trees that are varied, unless the user says otherwise.
TREES = ("kd", "normals")

#: A setting may be exact for every node, or binned in every node.
ALWAYS_EXACT, ALWAYS_BINNED = 2**30, 1

#: More references per triangle than any tree has that is not made to have them.
UNCAPPED = 1000.0

#: Values of each axis besides the default, as settings; those that a tree has not are left out.
AXES: Mapping[str, tuple[Mapping[str, Value], ...]] = {
    "precision": ({"precision": "epsilon"}, {"precision": "fast"}),
    "triangle_test": ({"triangle_test": "mt"}, {"precision": "fast", "triangle_test": "mt"}),
    "early_exit": ({"early_exit": "plane"},),
    "k": tuple({"k": k} for k in (3, 4, 9, 13, 25)),
    "sweep": ({"exact_below": ALWAYS_EXACT}, {"exact_below": ALWAYS_BINNED}),
    "leaf_size": tuple({"leaf_size": size} for size in (2, 4, 8, 16)),
    "max_references": tuple({"max_references": cap} for cap in (1.5, 2.0, 4.0, UNCAPPED)),
}

#: Fixed directions, and every plane of a triangle: how many directions there are, where that is the question.
MORE_DIRECTIONS = ("rbsp:k=3", "rbsp:k=7", "rbsp:k=9", "rbsp", "rbsp:directions=spiral,k=25", "ize")

#: The grid: every combination of these, and for each tree with directions of these numbers of them.
GRID: Mapping[str, Sequence[Value]] = {
    "precision": ("safe", "epsilon", "fast"),
    "triangle_test": ("woop", "mt"),
    "leaf_size": (1, 4),
}
GRID_DIRECTIONS: Mapping[str, Sequence[int | None]] = {"normals": (None, 13), "rbsp": (7, None)}

#: What is moved away from the origin: the axes along which answers change.
MOVED: Mapping[str, Sequence[Value]] = {"precision": ("safe", "epsilon", "fast"), "triangle_test": ("woop", "mt")}


def factors(tree: str, axes: Sequence[str]) -> list[str]:
    """The default of a tree, and every spec that differs from it in one axis."""
    known = parse_spec(tree).settings
    varied = [spec_text(tree, **change) for axis in axes for change in AXES[axis] if set(change) <= set(known)]
    return [tree, *varied]


def grid(tree: str) -> list[str]:
    """Every combination; where a value is the default it is not written, so that it is the same spec as elsewhere."""
    numbers = GRID_DIRECTIONS.get(tree, (None,))
    return [_spec(tree, {"k": k, **change}) for k in numbers for change in _combinations(GRID)]


def moved(tree: str) -> list[str]:
    """The specs whose answers are looked at far from the origin."""
    return [_spec(tree, change) for change in _combinations(MOVED)]


def all_specs(trees: Sequence[str], axes: Sequence[str], with_grid: bool) -> list[str]:
    """Everything that is measured, each once."""
    found = [*INCUMBENTS, *(spec for tree in trees for spec in factors(tree, axes))]
    if "k" in axes:
        found += MORE_DIRECTIONS
    if with_grid:
        found += [spec for tree in dict.fromkeys((*trees, "rbsp")) for spec in grid(tree)]
    return list(dict.fromkeys(found))


def _combinations(values: Mapping[str, Sequence[Value]]) -> list[dict[str, Value]]:
    return [dict(zip(values, chosen, strict=True)) for chosen in itertools.product(*values.values())]


def _spec(tree: str, change: Mapping[str, Value | None]) -> str:
    """A spec without what is the tree's default anyway, or no setting of it."""
    defaults = parse_spec(tree).settings
    kept = {key: v for key, v in change.items() if key in defaults and v not in (None, defaults[key])}
    return spec_text(tree, **kept)
