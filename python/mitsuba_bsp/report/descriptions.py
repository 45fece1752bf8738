"""What figures show, in words: by their names, in which `*` stands for a scene."""

from __future__ import annotations

import re
from collections.abc import Sequence

_MAPS = (
    "Maps of {} for every pixel of {{scene}}, brighter where more: a column an accelerator, above camera rays alone, "
    "below whole paths; in front of them the picture, and how many pixels cost how much."
)

DESCRIPTIONS = {
    "claims": "A line for every claim of the thesis: what was found over all scenes, with its interval, in percent of "
    "what it is held against; a stroke for each scene, and the verdict.",
    "comparison": "Points in percent of kd built the same way, a row a scene and a column each for render time, build "
    "time, triangle tests and steps: every tree built in three ways, beside what was published.",
    "comparison-depth": "Lines of the share of interior nodes that are kd nodes against depth, for every tree; a row "
    "a scene, a column a way to build.",
    "convergence": "Lines of the error of the image (relMSE and FLIP) against seconds, building included, for every "
    "accelerator; a row a scene.",
    "convergence-*": "Pictures of {scene} after the same time under every accelerator, with their passes and errors.",
    "cost": "Lines of render time, triangle tests and steps in percent of kd against alpha, the price of an oblique "
    "plane; a row a tree and node layout.",
    "directions": "Lines of render time in percent of kd against the number of directions, with intervals; a column a "
    "scene, a row a policy of axes and node layout.",
    "growth": "Points of build time against the number of triangles on logarithmic axes, with the fitted power of each "
    "tree and n log n for comparison.",
    "heatmap-*-cost": _MAPS.format("the price of all work"),
    "heatmap-*-leaves": _MAPS.format("leaves visited"),
    "heatmap-*-steps": _MAPS.format("steps through nodes"),
    "heatmap-*-tests": _MAPS.format("triangle tests"),
    "hotspots": "Lines of the cost of pixels over kd's mean against the percentage of pixels that are cheaper, for "
    "every accelerator; a column a scene, above camera rays, below whole paths.",
    "hotspots-*": _MAPS.format("the price of all work"),
    "normals-*": "Discs of the normals of {scene} by area, in grey, with circles for the directions that a tree cuts "
    "along; a column a tree, a row a chosen node.",
    "planes": "Lines of the number of planes against level: considered, different and predicted; a row a scene, a "
    "column a tree.",
    "slice-*": "Cross-sections through {scene} in black over the cells of its trees, a column a tree: coloured by "
    "depth, the densest part enlarged, and the cost there.",
    "slice-planes-*": "The planes of the first levels of every tree in space, with points of the surface of {scene}; "
    "oblique planes are coloured.",
    "trade-bounds": "Bars of the percentage of steps and of time that bounds on errors add (safe over fast), by scene, "
    "tree and kind of ray.",
    "trade-distance": "Lines of failures per ray, of the worst family of rays, against how far the scene was moved "
    "from the origin; a panel a scene, a line a tree.",
    "trade-front": "Points of speed against failures per ray, of the worst family of rays, for every tree and mode, "
    "with the line of those that no other beats in both; a panel a scene.",
    "trade-references": "Lines of references per triangle against the number of directions, with a level line for each "
    "triangle's own planes; a panel a scene.",
}  # fmt: skip


def described(figure: str, title: str, scenes: Sequence[str]) -> tuple[str, str]:
    """The scene that a figure is about, empty for all together, and what it shows; `title` is what measured it."""
    for name, text in DESCRIPTIONS.items():
        found = re.fullmatch(re.escape(name).replace(r"\*", "(.+)"), figure)
        scene = found[1] if found and found.groups() else ""
        if found and scene in ("", *scenes):
            return scene, text.format(scene=scene)
    return "", f"{title}: {figure}."
