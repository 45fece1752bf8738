"""Rays aimed at the triangles of a scene, family by family, and what brute force answers: kept in a file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..contenders import Contender, Triangles
from ..studies.work import save_arrays
from ..verification.meshes import Mesh
from ..verification.oracle import brute_force, family_rng
from ..verification.rays import FAMILIES, Rays, plane_rays

SEED = 1

TESTS = ("woop", "mt")

Truth = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True)
class Aimed:
    """Rays of one family, and what a loop over all triangles answers, by triangle test: t, and the triangle."""

    family: str
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    truth: Mapping[str, Truth]

    @property
    def maxt(self) -> NDArray[np.float32]:
        return np.full(len(self.origins), np.inf, np.float32)

    @property
    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """The rays as accelerators take them."""
        return self.origins, self.directions, self.maxt

    def __len__(self) -> int:
        return len(self.origins)


def mesh_of(name: str, triangles: Triangles) -> Mesh:
    """All triangles of a scene as one mesh."""
    return Mesh(name, *triangles.merged())


def moved(triangles: Triangles, sizes: float) -> Triangles:
    """The scene moved away by so many times its size, in a direction along no axis, and rounded to floats."""
    mesh = mesh_of("", triangles)
    away = (sizes * mesh.size * np.array([0.6, -0.48, 0.64])).astype(np.float64)
    placed = tuple(((v.astype(np.float64) + away).astype(np.float32), faces) for v, faces in triangles.meshes)
    return Triangles(placed)


def aimed(mesh: Mesh, count: int, file: Path, stage: Callable[[str], None]) -> list[Aimed]:
    """`count` rays of every family that does not depend on a tree; from the file, or made and written there."""
    if not file.is_file():
        arrays: dict[str, NDArray[np.generic]] = {}
        for family, make in FAMILIES.items():
            stage(f"asking brute force about {family} rays")
            found = answered(mesh, family, make(mesh, count, family_rng(SEED, family)))
            arrays |= {f"{family} o": found.origins, f"{family} d": found.directions}
            arrays |= {f"{family} {test} {key}": v for test in TESTS for key, v in found.truth[test].items()}
        save_arrays(file, arrays)
    return list(_read(file))


def in_planes(mesh: Mesh, contender: Contender, count: int) -> Aimed:
    """Rays in the split planes of one of our trees."""
    planes = contender.tree.planes().reshape(-1, 4)
    return answered(mesh, "plane", plane_rays(mesh, count, family_rng(SEED, "plane"), planes))


def answered(mesh: Mesh, family: str, rays: Rays) -> Aimed:
    """These rays, with the answers of brute force."""
    ends = np.full(len(rays[0]), np.inf, np.float32)
    truth = {}
    for test in TESTS:
        found = brute_force(mesh, test).closest(*rays, ends)
        truth[test] = {key: found[key] for key in ("t", "triangle")}
    return Aimed(family, *rays, truth)


def _read(file: Path) -> Iterator[Aimed]:
    with np.load(file) as arrays:
        for family in FAMILIES:
            truth = {test: {key: arrays[f"{family} {test} {key}"] for key in ("t", "triangle")} for test in TESTS}
            yield Aimed(family, arrays[f"{family} o"], arrays[f"{family} d"], truth)
