"""Meshes that are degenerate in one way each; only what is not finite or has no area at all is invalid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .exact import normal_is_zero
from .meshes import Mesh, boxes, grid, of_corners, soup
from .threads import shared

#: Put into each coordinate of a triangle in turn.
ODD_VALUES = {"nan": np.nan, "inf": np.inf, "2e18": 2e18, "1e30": 1e30, "1e-40": 1e-40, "-0": -0.0}


@shared()
def zoo() -> tuple[Mesh, ...]:
    """About seventy meshes."""
    rng = np.random.default_rng(8)
    base = soup("soup", 20)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    flat = grid("", 5)
    cube = boxes("", [((-1, -1, -1), (1, 1, 1))])
    one = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    found = [
        base,
        of_corners("empty", np.zeros((0, 3, 3))),
        of_corners("one triangle", one[None]),
        of_corners("point triangles", np.repeat(rng.normal(size=(10, 1, 3)), 3, axis=1)),
        of_corners("line triangles", np.array([[[0, 0, 0], [1, 2, 3], [2, 4, 6]], [[1, 1, 0], [2, 2, 0], [5, 5, 0]]])),
        _with("point triangle in a soup", base, 7, np.float32([[0.5, 0.5, 0.5]] * 3)),
        _with("line triangle in a soup", base, 7, np.float32([[0, 0, 0], [0.25, 0.5, 0.75], [0.5, 1, 1.5]])),
        Mesh("repeated index", base.vertices, np.where(np.arange(20)[:, None] == 7, 21, base.faces).astype(np.uint32)),
        of_corners("aspect 1e12", np.array([[[0, 0, 0], [1, 0, 0], [0.5, 1e-12, 0]], one * 0.5 - 0.1])),
        of_corners("aspect 1e12, oblique", np.array([[[0, 0, 0], [1, 0.7, 0.3], [0.4, 0.28, 0.12]], one])),
        Mesh("coplanar along axes", flat.vertices, flat.faces),
        Mesh("coplanar, oblique", (flat.vertices @ turn.T).astype(np.float32), flat.faces),
        of_corners("coplanar and overlapping", np.pad(rng.uniform(size=(40, 3, 2)), ((0, 0), (0, 0), (0, 1)))),
        of_corners("all vertices equal", np.tile([1.0, 2, 3], (10, 3, 1))),
        of_corners("duplicate vertices", cube.vertices[cube.faces]),
        of_corners("all invalid", np.full((12, 3, 3), np.nan)),
    ]
    for name, value in ODD_VALUES.items():
        for slot in range(9):
            corners = base.vertices[base.faces[7]].copy()
            corners[slot // 3, slot % 3] = value
            found.append(_with(f"{name} in slot {slot}", base, 7, corners))
    return tuple(found)


@shared()
def has_area(mesh: Mesh) -> NDArray[np.bool_]:
    """Which triangles are valid: finite, and their exact normals are not zero."""
    corners = mesh.vertices[mesh.faces]
    finite = np.isfinite(corners).all(axis=(1, 2))
    return np.array([ok and not normal_is_zero(c) for ok, c in zip(finite, corners, strict=True)], bool)


def _with(name: str, base: Mesh, triangle: int, corners: NDArray[np.float32]) -> Mesh:
    """A soup with one triangle changed."""
    vertices = base.vertices.copy()
    vertices[base.faces[triangle]] = corners
    return Mesh(name, vertices, base.faces)
