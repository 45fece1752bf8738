"""Holds an accelerator's answers against those of another one, bit for bit."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .. import _core
from .meshes import Mesh
from .rays import FAMILIES, Rays, plane_rays

#: Rays whose interval ends before infinity: a quarter of them ends exactly at the hit, or just before or after.
INTERVAL_SHARE = 0.25


@dataclass
class Differences:
    """What was compared, and where the answers differ."""

    rays: int = 0
    by_family: dict[str, int] = field(default_factory=dict)
    first: str = ""  #: the first ray that differs, in hexadecimal floats

    @property
    def total(self) -> int:
        return sum(self.by_family.values())

    def __str__(self) -> str:
        families = ", ".join(f"{name} {count}" for name, count in self.by_family.items() if count)
        return f"{self.total} differences in {self.rays} rays ({families}); {self.first}"


def _bits(values: np.ndarray) -> np.ndarray:
    return values.view(np.uint32) if values.dtype == np.float32 else values


def differing(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> np.ndarray:
    """Which rays got another t, u, v or triangle."""
    return np.any([_bits(a[key]) != _bits(b[key]) for key in ("t", "u", "v", "triangle")], axis=0)


def cut_intervals(t: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Ends of intervals: mostly infinite, some exactly at the closest hit, one float below it or above."""
    below, above = np.nextafter(t, np.float32(-np.inf)), np.nextafter(t, np.float32(np.inf))
    cut = np.choose(rng.integers(3, size=len(t)), [t, below, above])
    return np.where(rng.random(len(t)) < INTERVAL_SHARE, cut, np.float32(np.inf)).astype(np.float32)


def describe_ray(o: np.ndarray, d: np.ndarray, maxt: float) -> str:
    numbers = [float(x).hex() for x in (*o, *d, maxt)]
    return "ray o=({}, {}, {}) d=({}, {}, {}) maxt={}".format(*numbers)


class Oracle:
    """The right answers for one mesh: brute force by default, or another tree where that would take too long."""

    def __init__(self, mesh: Mesh, rays_per_family: int, seed: int, tree: str = "brute", triangle_test: str = "woop"):
        self.mesh = mesh
        self.seed = seed
        self.count = rays_per_family
        self.options = {"triangle_test": triangle_test}
        self.reference = _core.Accelerator(mesh.vertices, mesh.faces, tree, self.options)
        self.streams = [
            (name, *self._answered(make(mesh, self.count, self._rng(name)), name)) for name, make in FAMILIES.items()
        ]

    def compare(self, tree: str, options: dict[str, str] | None = None, fault: str = "") -> Differences:
        """Fire every family at the tree the settings describe, closest and any hit."""
        accelerator = _core.Accelerator(
            self.mesh.vertices, self.mesh.faces, tree, {**(options or {}), **self.options}, fault
        )
        planes = accelerator.planes().reshape(-1, 4)
        plane_stream = self._answered(plane_rays(self.mesh, self.count, self._rng("plane"), planes), "plane")
        found = Differences()
        for name, o, d, maxt, expected in [*self.streams, ("plane", *plane_stream)]:
            wrong = differing(accelerator.closest(o, d, maxt), expected)
            wrong |= accelerator.any(o, d, maxt).astype(bool) != (expected["triangle"] != NO_TRIANGLE)
            found.rays += len(o)
            found.by_family[name] = int(wrong.sum())
            if wrong.any() and not found.first:
                i = int(np.argmax(wrong))
                found.first = f"{self.mesh.name}, seed {self.seed}, {name} {i}: " + describe_ray(o[i], d[i], maxt[i])
        return found

    def _rng(self, family: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, *family.encode()])

    def _answered(self, rays: Rays, family: str):
        """Rays, their interval ends, and the right answers."""
        o, d = rays
        unbounded = self.reference.closest(o, d, np.full(len(o), np.inf, np.float32))
        maxt = cut_intervals(unbounded["t"], self._rng(family + " interval"))
        return o, d, maxt, self.reference.closest(o, d, maxt)


NO_TRIANGLE = 0xFFFFFFFF
