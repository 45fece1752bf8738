"""Rays from inside closed meshes through Mitsuba itself, under any accelerator: what is missed was lost."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..loading import VARIANTS
from ..scalar import active_variant
from ..spec import Spec
from .meshes import Mesh, sphere, tessellated_box
from .rays import INTERIOR_FAMILIES, Rays, grazing_inside, interior_rays
from .wrapped import alone

PLACES = {"": (0, 0, 0), " at 1e3": (1e3, -1e3, 7e2), " at 2.7e5": (148376, 1234, -223423)}

#: Rings of the sphere, as in C03; cells along an edge of the box.
STEPS, CELLS = 50, 20


@cache
def targets() -> dict[str, tuple[Mesh, str]]:
    """Closed meshes and the family of rays fired from inside, by a name to print."""
    found = {}
    for place, centre in PLACES.items():
        mesh = sphere(f"sphere{place}", STEPS, centre)
        found |= {f"sphere{place}: {family}": (mesh, family) for family in INTERIOR_FAMILIES}
    for place in ("", " at 1e3"):
        found[f"box{place}: grazing"] = (tessellated_box(f"box{place}", CELLS, PLACES[place]), "grazing")
    return found


def rays_inside(mesh: Mesh, family: str, count: int, rng: np.random.Generator) -> Rays:
    if family == "grazing":
        return grazing_inside(mesh, count, rng)
    return interior_rays(mesh, count, rng, family)


def missed(mesh: Mesh, spec: Spec, rays: Rays) -> NDArray[np.bool_]:
    """Which rays hit nothing in a Mitsuba scene of this mesh under the accelerator."""
    with _scalar():
        scene = alone(mesh, spec)
        return np.array([_is_missed(scene, o, d) for o, d in zip(*(part.tolist() for part in rays), strict=True)])


def _is_missed(scene: mi.Scene, origin: list[float], direction: list[float]) -> bool:
    ray = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), np.inf, 0.0, [])
    return not scene.ray_intersect_preliminary(ray).is_valid()


@contextmanager
def _scalar() -> Iterator[None]:
    """A scalar variant is set while it lives, and no warnings: far out, the sphere loses its smallest triangles."""
    with active_variant(VARIANTS[0]):
        level = mi.log_level()
        mi.set_log_level(mi.LogLevel.Error)
        try:
            yield
        finally:
            mi.set_log_level(level)
