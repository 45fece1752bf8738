"""What of a scene is under accelerators, and what a user must be told about it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Content:
    """What of a scene is under accelerators, and what is not.

    `triangles` and `meshes` are those under any accelerator: that of the scene itself, or that of one of its
    `shape_groups`, which `instances` show. `others` are class names and counts of the shapes that stay with Embree.
    """

    triangles: int
    meshes: int
    others: Mapping[str, int]
    shape_groups: int = 0
    instances: int = 0


def notes(content: Content) -> list[str]:
    """What a user must know about a scene before reading anything into a comparison."""
    said = []
    if content.others:
        listed = ", ".join(f"{count} {kind}" for kind, count in content.others.items())
        said.append(f"only triangle meshes go under the accelerator, so these shapes stay with Embree: {listed}")
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
    if not content.meshes:
        said.append("the scene has no triangle mesh, so the accelerator stays empty")
    return said
