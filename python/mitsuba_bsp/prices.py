"""The prices of the surface area heuristic as the settings have them, for whoever adds up the work of rays."""

from __future__ import annotations

from collections.abc import Mapping

#: Planes on a ray's way through a node of each layout: a wide node has three levels.
PLANES_PER_STEP = {"wide": 3, "binary": 1}


def plane_prices(settings: Mapping[str, object]) -> tuple[float, float]:
    """Of an axis-aligned and of an oblique plane; the planes of a node share the price of its visit."""
    visit = float(settings["node_cost"]) / PLANES_PER_STEP[str(settings["layout"])]
    return visit + float(settings["axis_cost"]), visit + float(settings.get("oblique_cost", 0))
