"""Accelerators over a scene's triangles, without the scene: our trees, Mitsuba's kd-tree and Embree, asked alike."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from . import _core, _incumbents
from .spec import Spec
from .streams import Stream

#: t of two accelerators that differ by more than this, relatively, differ by more than rounding.
T_TOLERANCE = 1e-4

COUNTERS = ("axis_steps", "oblique_steps", "leaves_visited", "triangle_tests")


@dataclass(frozen=True)
class Triangles:
    """The triangles of each mesh of a scene: vertices (n, 3) float32, faces (m, 3) uint32, all vertices finite."""

    meshes: tuple[tuple[NDArray[np.float32], NDArray[np.uint32]], ...]

    def merged(self) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """All of them as one mesh."""
        starts = np.cumsum([0] + [len(vertices) for vertices, _ in self.meshes])
        faces = [faces + np.uint32(start) for (_, faces), start in zip(self.meshes, starts[:-1], strict=True)]
        return np.concatenate([vertices for vertices, _ in self.meshes]), np.concatenate(faces)

    def __len__(self) -> int:
        return sum(len(faces) for _, faces in self.meshes)

    def sha256(self) -> str:
        """Of all vertices and faces."""
        return _sha256([array for mesh in self.meshes for array in mesh])


class Asked(Protocol):
    """What `_core.Accelerator`, `_incumbents.Native` and `_incumbents.Embree` have in common."""

    def any(self, origins: object, directions: object, maxt: object) -> NDArray[np.uint8]:
        """Whether each ray hits anything."""

    def time(self, origins: object, directions: object, maxt: object, any_hit: bool) -> tuple[float, float, int | None]:
        """Processor seconds, seconds on the clock and cache misses of all rays on one thread."""


@dataclass(frozen=True)
class Contender:
    """One accelerator, built."""

    spec: Spec
    tree: Asked

    def answers(self, stream: Stream) -> NDArray[np.float32]:
        """t of every closest hit, infinite without one; for any-hit rays 0 or infinite."""
        if stream.any_hit:
            return np.where(self.tree.any(*stream.arrays), np.float32(0), np.float32(np.inf))
        found = self.tree.closest(*stream.arrays)
        return found["t"] if self.spec.is_tree else found

    def count(self, stream: Stream) -> dict[str, int]:
        """Steps, leaves and tests of the whole stream; empty for Embree, which does not tell."""
        if self.spec.name == "embree":
            return {}
        found = self.tree.count(*stream.arrays, stream.any_hit)
        return {key: int(found[key].sum()) for key in COUNTERS}

    def statistics(self) -> dict[str, Any]:
        """Sizes of the tree and what its building took; empty for Embree and Mitsuba's kd-tree, which do not tell."""
        return json.loads(self.tree.statistics()) if self.spec.is_tree else {}

    def sha256(self) -> str | None:
        """Of nodes and leaves; None for Embree, which keeps them to itself."""
        return None if self.spec.name == "embree" else _sha256(self.tree.memory())


def build(spec: Spec, triangles: Triangles) -> Contender:
    """Build one accelerator."""
    if spec.name == "native":
        return Contender(spec, _incumbents.Native(list(triangles.meshes), dict(spec.settings)))
    merged = triangles.merged()
    if spec.name == "embree":
        return Contender(spec, _incumbents.Embree(*merged, spec.settings["robust"]))
    return Contender(spec, _core.Accelerator(*merged, spec.name, dict(spec.options)))


def triangles_of(meshes: Sequence[mi.Mesh]) -> Triangles:
    """The triangles of Mitsuba's meshes, those with a vertex that is not finite left out.

    ValueError if there are none.
    """
    found = tuple(_usable(mesh) for mesh in meshes)
    triangles = Triangles(found)
    if not len(triangles):
        raise ValueError("the scene has no triangle mesh, so there is nothing to trace rays in")
    return triangles


def differences(answers: NDArray[np.float32], reference: NDArray[np.float32]) -> dict[str, int]:
    """Rays with another answer than the reference: hit against miss, and t that differs by more than rounding."""
    hit, expected = np.isfinite(answers), np.isfinite(reference)
    both = hit & expected
    off = np.abs(answers[both] - reference[both]) > T_TOLERANCE * np.abs(reference[both])
    return {"hit_or_miss": int((hit != expected).sum()), "t": int(off.sum())}


def _usable(mesh: mi.Mesh) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    vertices = np.array(mesh.vertex_positions_buffer(), np.float32).reshape(-1, 3)
    faces = np.array(mesh.faces_buffer(), np.uint32).reshape(-1, 3)
    finite = np.isfinite(vertices).all(axis=1)
    return np.where(finite[:, None], vertices, np.float32(0)), faces[finite[faces].all(axis=1)]


def _sha256(parts: Sequence[NDArray[np.generic]]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()
