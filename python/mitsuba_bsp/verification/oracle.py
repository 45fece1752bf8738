"""Holds an accelerator's answers against those of brute force, bit for bit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..accelerator import NO_TRIANGLE
from ..spec import Spec
from .cases import Case, describe_ray
from .check import Failure, Subject
from .meshes import Mesh, small_meshes
from .rays import FAMILIES, Rays, plane_rays
from .threads import shared

Answers = Mapping[str, NDArray[np.float32] | NDArray[np.uint32]]

#: Rays whose interval ends before infinity: a quarter of them ends exactly at the hit, or just before or after.
INTERVAL_SHARE = 0.25

#: Variants get one in so many of the small meshes, and more rays in each.
VARIANT_MESHES = 3


@dataclass(frozen=True)
class Questions:
    """Rays of one family in one mesh, and the right answers."""

    mesh: Mesh
    family: str
    seed: int
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    maxt: NDArray[np.float32]
    expected: Answers

    @property
    def rays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        return self.origins, self.directions, self.maxt

    def __len__(self) -> int:
        return len(self.origins)

    def head(self, count: int) -> Questions:
        """The first few of them."""
        expected = {key: values[:count] for key, values in self.expected.items()}
        cut = (part[:count] for part in self.rays)
        return Questions(self.mesh, self.family, self.seed, *cut, expected)

    def case(self, index: int, spec: str, why: str, hit: bool | None = None, through: str = "") -> Case:
        """One of the rays, so that it can be asked again; `hit`: whether it must hit anything, where that is known."""
        one = slice(index, index + 1)
        hits = None if hit is None else (hit,)
        return Case(why, self.mesh, *(part[one] for part in self.rays), hits, spec, self.seed, through)

    def failure(self, index: int, spec: str, sentence: str, hit: bool | None = None, through: str = "") -> Failure:
        """One of the rays, of which the sentence says what the spec does with it; the rest as for `case`."""
        case = self.case(index, spec, sentence, hit, through)
        return Failure(f"{spec} {sentence}: {self.describe(index)}", case.to_json())

    def describe(self, index: int) -> str:
        """The ray and the triangle that it should hit, in hexadecimal floats."""
        ray = describe_ray(*(part[index] for part in self.rays))
        text = f"{self.mesh.name}, seed {self.seed}, {self.family} {index}: {ray}"
        triangle = int(self.expected["triangle"][index])
        if triangle == NO_TRIANGLE:
            return f"{text}, which hits nothing"
        corners = self.mesh.vertices[self.mesh.faces[triangle]]
        points = " ".join("({})".format(", ".join(float(x).hex() for x in corner)) for corner in corners)
        return f"{text}, which hits triangle {triangle}, {points}, at t={float(self.expected['t'][index]).hex()}"


def build(mesh: Mesh, spec: Spec, fault: str = "") -> _core.Accelerator:
    """A tree over a mesh, or brute force."""
    return _core.Accelerator(mesh.vertices, mesh.faces, spec.name, dict(spec.options), fault)


@cache
def small_trees(subject: Subject) -> tuple[tuple[Mesh, _core.Accelerator], ...]:
    """The small meshes, of which variants get a part, and their trees; kept, for several checks need them."""
    meshes = subject.part_of(small_meshes(), VARIANT_MESHES)
    return tuple((mesh, build(mesh, subject.spec)) for mesh in meshes)


@shared(256)
def brute_force(mesh: Mesh, triangle_test: str = "woop") -> _core.Accelerator:
    return _core.Accelerator(mesh.vertices, mesh.faces, "brute", {"triangle_test": triangle_test})


def answered(mesh: Mesh, family: str, rays: Rays, seed: int, triangle_test: str = "woop") -> Questions:
    """Rays with interval ends, some of them close to the hit, and the answers of brute force."""
    rng = family_rng(seed, family + " interval")
    return questions_to(brute_force(mesh, triangle_test), mesh, seed, family, rays, rng)


def questions_to(
    reference: _core.Accelerator, mesh: Mesh, seed: int, family: str, rays: Rays, rng: np.random.Generator
) -> Questions:
    """Rays with interval ends, some of them close to the hit, and the answers of `reference`."""
    o, d = rays
    unbounded = reference.closest(o, d, np.full(len(o), np.inf, np.float32))
    maxt = cut_intervals(unbounded["t"], rng)
    return Questions(mesh, family, seed, o, d, maxt, ended(reference, rays, unbounded, maxt))


def ended(reference: _core.Accelerator, rays: Rays, unbounded: Answers, maxt: NDArray[np.float32]) -> Answers:
    """The answers of `reference` for intervals that end at `maxt`, given those for intervals without end.

    The closest hit before an end is the closest of all, or there is none. It is asked again only where t is denormal,
    for what it was before it was rounded to fewer digits decides.
    """
    o, d = rays
    kept = found(unbounded) & (unbounded["t"] <= maxt)
    missed = {"t": np.float32(np.inf), "u": np.float32(0), "v": np.float32(0), "triangle": np.uint32(NO_TRIANGLE)}
    expected = {key: np.where(kept, unbounded[key], missed[key]) for key in missed}
    rounded = np.flatnonzero(unbounded["t"] < np.finfo(np.float32).tiny)
    if len(rounded):
        for key, values in reference.closest(o[rounded], d[rounded], maxt[rounded]).items():
            expected[key][rounded] = values
    return expected


@shared(128)
def questions(mesh: Mesh, count: int, seed: int, triangle_test: str = "woop") -> tuple[Questions, ...]:
    """So many rays of every family that does not depend on the tree."""
    return tuple(
        answered(mesh, name, make(mesh, count, family_rng(seed, name)), seed, triangle_test)
        for name, make in FAMILIES.items()
    )


def plane_questions(
    mesh: Mesh, tree: _core.Accelerator, count: int, seed: int, triangle_test: str = "woop"
) -> Questions:
    """Rays in the split planes of a tree."""
    return _in_planes(mesh, tree.planes().tobytes(), count, seed, triangle_test)


@shared()
def _in_planes(mesh: Mesh, planes: bytes, count: int, seed: int, triangle_test: str) -> Questions:
    """The same for all trees with these planes."""
    rays = plane_rays(mesh, count, family_rng(seed, "plane"), np.frombuffer(planes, np.float32).reshape(-1, 4))
    return answered(mesh, "plane", rays, seed, triangle_test)


def family_rng(seed: int, family: str) -> np.random.Generator:
    return np.random.default_rng([seed, *family.encode()])


def differing(a: Answers, b: Answers) -> NDArray[np.bool_]:
    """Which rays got another t, u, v or triangle."""
    return np.any([_bits(a[key]) != _bits(b[key]) for key in ("t", "u", "v", "triangle")], axis=0)


def found(answers: Answers) -> NDArray[np.bool_]:
    """Which rays hit something."""
    return answers["triangle"] != NO_TRIANGLE


def cut_intervals(t: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """Ends of intervals: mostly infinite, some exactly at the closest hit, one float below it or above."""
    below, above = np.nextafter(t, np.float32(-np.inf)), np.nextafter(t, np.float32(np.inf))
    cut = np.choose(rng.integers(3, size=len(t)), [t, below, above])
    return np.where(rng.random(len(t)) < INTERVAL_SHARE, cut, np.float32(np.inf)).astype(np.float32)


def _bits(values: NDArray) -> NDArray:
    return values.view(np.uint32) if values.dtype == np.float32 else values
