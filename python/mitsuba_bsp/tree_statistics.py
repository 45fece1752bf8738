"""What an accelerator reports about itself through its shape's text, and the ratios drawn from it."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

import mitsuba as mi

_LINE = re.compile(r"^\s*statistics = (\{.*\}),?\s*$", re.MULTILINE)


def statistics(scene: mi.Scene) -> dict[str, Any]:
    """Statistics of the tree in a scene: sizes and `build_s`, with ray counters if counting was asked for.

    Empty if no shape of the scene sits under one of our accelerators.
    """
    for shape in scene.shapes():
        found = _LINE.search(str(shape))
        if found:
            return json.loads(found.group(1))
    return {}


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
