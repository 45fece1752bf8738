"""What of a scene is under accelerators, and what a user must be told about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Content:
    """What of a scene is under accelerators, and what is not.

    `triangles` and `meshes` are those under any accelerator: that of the scene itself, or that of one of its
    `shape_groups`, which `instances` show and which have `grouped` of the triangles. `bounded` are class names and
    counts of the other shapes under them, `several` those of more than one primitive, and `others` those that stay
    with Embree.
    """

    triangles: int
    meshes: int
    others: Mapping[str, int]
    shape_groups: int = 0
    instances: int = 0
    grouped: int = 0
    bounded: Mapping[str, int] = field(default_factory=dict)
    several: Mapping[str, int] = field(default_factory=dict)


def notes(content: Content, names: Sequence[str]) -> list[str]:
    """What a user must know about a scene before reading anything into a comparison of these accelerators."""
    said = []
    if content.others:
        said.append(f"Mitsuba cannot intersect them alone, so these shapes stay with Embree: {_listed(content.others)}")
    if content.several and "native" in names:
        said.append(
            f"Mitsuba's kd-tree takes shapes of one primitive only, so under native these stay with Embree: "
            f"{_listed(content.several)}"
        )
    if content.bounded and "ize" in names:
        said.append(f"ize takes nothing but triangles, so under it these stay with Embree: {_listed(content.bounded)}")
    if content.shape_groups:
        groups, instances = content.shape_groups, content.instances
        has = (
            "a shape group has an accelerator of its own"
            if groups == 1
            else f"{groups} shape groups have their own accelerators"
        )
        said.append(
            f"{has}, built once; the level above, of {instances} instance{'s' * (instances != 1)}, stays with Embree"
        )
    if not content.meshes and not content.bounded:
        said.append("the scene has no shape that goes under an accelerator, so it stays empty")
    return said


def left_out(content: Content) -> list[str]:
    """What is not asked where a measurement takes the triangles of the scene's own accelerator and nothing else."""
    said = []
    shapes = {**content.bounded, **content.others}
    if shapes:
        said.append(f"these shapes are no triangle meshes, so they are left out here: {_listed(shapes)}")
    if content.shape_groups:
        said.append("what is in shape groups is left out here")
    return said


def _listed(shapes: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in shapes.items())
