"""What an accelerator reports about itself through its shape's text, and the ratios drawn from it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from typing import Any

import mitsuba as mi

_LINE = re.compile(r"^\s*statistics = (\{.*\}),?\s*$", re.MULTILINE)


#: What of several trees together is the sum; of the depths it is the largest.
_ADDED = (
    "triangles", "dropped_triangles", "primitives", "nodes", "interior_nodes", "axis_nodes", "oblique_nodes", "leaves",
    "empty_leaves", "capped_leaves", "references", "bytes", "build_s",
)  # fmt: skip


def shapes(scene: mi.Scene) -> list[mi.Shape]:
    """The shapes that are under our accelerators, in the scene's order, then those of its shape groups.

    `scene.shapes()` lists others in their places, which stand for them: with their ids, materials and parameters, but
    without a mesh's own methods, such as `vertex_count`. Edit these through `mitsuba.traverse(scene)`, as ever.
    """
    members = [shape for _, listed in _containers(scene) for shape in listed if shape.class_name() == "Member"]
    return [shape for member in members for shape in member.expand()]


def statistics(scene: mi.Scene) -> dict[str, Any]:
    """Statistics of the tree in a scene: sizes and `build_s`, with ray counters if counting was asked for.

    If there are several, because shape groups have their own, these are the sums, and under `trees` stands every tree
    alone, with the id of its `shape_group` (that of the scene itself is empty). Empty if there is no tree.
    """
    trees = [
        {**json.loads(found.group(1)), "shape_group": group}
        for group, listed in _containers(scene)
        for shape in listed
        if (found := _LINE.search(str(shape)))
    ]
    if len(trees) > 1:
        return _together(trees)
    return {key: value for key, value in trees[0].items() if key != "shape_group"} if trees else {}


def _containers(scene: mi.Scene) -> list[tuple[str, list[mi.Shape]]]:
    """The scene's shapes, each once, without a name, and those of each of its shape groups with its id."""
    groups = [child for child in _children(scene) if child.class_name() == "ShapeGroupPlugin"]
    return [("", _each_once(scene.shapes())), *((group.id(), _children(group)) for group in _each_once(groups))]


def _children(parent: mi.Object) -> list[mi.Object]:
    """The objects that an object shows to Mitsuba's parameter editing, in order."""
    found: list[mi.Object] = []

    class Collect(mi.TraversalCallback):
        def put(self, name: str, value: object, flags: object, cpptype: object = None) -> None:
            if isinstance(value, mi.Object):
                found.append(value)

    parent.traverse(Collect())
    return _each_once(found)


def _each_once(objects: Iterable[mi.Object]) -> list[mi.Object]:
    return list({thing.ptr: thing for thing in objects}.values())


def _together(trees: list[dict[str, Any]]) -> dict[str, Any]:
    total: dict[str, Any] = {"spec": " + ".join(dict.fromkeys(tree["spec"] for tree in trees))}
    total |= {key: sum(tree[key] for tree in trees) for key in _ADDED if all(key in tree for tree in trees)}
    total["max_depth"] = max(tree["max_depth"] for tree in trees)
    total["loaded"] = all(tree.get("loaded", False) for tree in trees)
    counted = [tree["counters"] for tree in trees if "counters" in tree]
    if counted:
        total["counters"] = {
            kind: {name: sum(counters[kind][name] for counters in counted) for name in counted[0][kind]}
            for kind in counted[0]
        }
    return total | {"trees": trees}


def per_ray(stats: Mapping[str, Any], counters: Mapping[str, Mapping[str, int]]) -> dict[str, float | None]:
    """Steps and tests per ray, and the oblique shares; None where an accelerator does not report them.

    `counters` holds those of closest-hit and of any-hit rays, which count alike.
    """

    def total(name: str) -> int:
        return sum(kind[name] for kind in counters.values())

    steps = total("axis_steps") + total("oblique_steps")
    return {
        "interior_steps_per_ray": _ratio(steps, total("rays")),
        "triangle_tests_per_ray": _ratio(total("triangle_tests"), total("rays")),
        "oblique_steps_share": _ratio(total("oblique_steps"), steps),
        "oblique_nodes_share": _ratio(stats.get("oblique_nodes"), stats.get("interior_nodes")),
    }


def _ratio(part: object, whole: object) -> float | None:
    return float(part) / float(whole) if whole else None
