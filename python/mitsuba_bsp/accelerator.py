"""Our trees without any scene: triangles and rays as NumPy arrays."""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from .messages import choices
from .spec import parse_spec

#: The triangle of a ray that hits nothing.
NO_TRIANGLE = 0xFFFFFFFF


class Accelerator:
    """A tree over triangles, named by a spec text such as `normals:k=6,axes=fast`.

    `vertices` is (n, 3) float32 or float64 (rounded to float32), `faces` is (m, 3) of any integer type, with indices
    below n. ValueError for a wrong spec or shape, TypeError for a wrong type, IndexError for an index out of range.
    Triangles with a vertex that is not finite, or without area, are left out with a warning; the others keep their
    numbers. `cache` is a folder (created if it is missing) in which trees are kept: what was built before is loaded
    from there; trouble with it is a warning, and the tree is built. `fault` plants a mistake in the traversal, one of
    `faults()`, to see whether a test can find it; such a tree is not kept.
    """

    def __init__(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        spec: str = "kd",
        fault: str = "",
        cache: str | Path | None = None,
    ) -> None:
        checked = parse_spec(spec)
        if not checked.is_tree:
            raise ValueError(
                f'spec "{spec}": "{checked.name}" exists only inside Mitsuba (valid here: {choices(_core.trees())})'
            )
        corners = _floats("vertices", vertices, (None, 3))
        indices = _faces(faces, len(corners))
        self.spec = checked
        folder = os.fspath(cache or "")
        self._tree = _core.Accelerator(corners, indices, checked.name, dict(checked.options), fault, folder)
        if warning := self._tree.warning():
            warnings.warn(warning, stacklevel=2)
        dropped = self.statistics()["dropped_triangles"]
        if dropped:
            warnings.warn(
                f"{dropped} of {len(indices)} triangles have no area or a vertex that is not finite: they are left out",
                stacklevel=2,
            )

    def closest(
        self, origins: ArrayLike, directions: ArrayLike, maxt: ArrayLike = np.inf
    ) -> dict[str, NDArray[np.float32] | NDArray[np.uint32]]:
        """The first hit of every ray: arrays (r,) `t`, `u`, `v` (float32) and `triangle` (uint32).

        Rays run from `origins` (r, 3) along `directions` (r, 3), which need not be unit vectors, to `maxt` (one number,
        or one a ray). A ray that hits nothing has `t` infinite and `triangle` NO_TRIANGLE.
        """
        return self._tree.closest(*_rays(origins, directions, maxt))

    def any(self, origins: ArrayLike, directions: ArrayLike, maxt: ArrayLike = np.inf) -> NDArray[np.bool_]:
        """Whether each ray, given as for `closest`, hits anything: bool (r,)."""
        return self._tree.any(*_rays(origins, directions, maxt)).astype(np.bool_)

    def count(
        self, origins: ArrayLike, directions: ArrayLike, maxt: ArrayLike = np.inf, any_hit: bool = False
    ) -> dict[str, NDArray[np.uint64]]:
        """The work for each ray: arrays (r,) `axis_steps`, `oblique_steps`, `leaves_visited`, `triangle_tests`.

        It is that of `closest`, or of `any` if `any_hit`. Slower than either.
        """
        return self._tree.count(*_rays(origins, directions, maxt), any_hit)

    def statistics(self) -> dict[str, Any]:
        """Sizes of the tree, its `sah_cost`, its `build_s`, and whether it was `loaded` in that time, not built."""
        return json.loads(self._tree.statistics())

    def planes(self) -> NDArray[np.float32]:
        """All split planes, (p, 4): normal and offset, normal . x = offset; none for `brute`."""
        return self._tree.planes().reshape(-1, 4)


def survey_planes(vertices: ArrayLike, faces: ArrayLike, spec: str) -> tuple[list[tuple[int, int]], tuple[int, int]]:
    """The planes that the exact sweeps of a build look at: (considered, different) per level, root first; and in all.

    `vertices`, `faces` and errors are as for `Accelerator`; ValueError also for `brute`. Estimates by bins are no
    planes: with `exact_below` as large as the mesh every direction is swept in every node, as in the papers. Figure 2.1
    of Hoobergs's draft.
    """
    checked = parse_spec(spec)
    swept = [tree for tree in _core.trees() if tree != "brute"]
    if checked.name not in swept:
        raise ValueError(f'spec "{spec}": "{checked.name}" sweeps no planes here (valid here: {choices(swept)})')
    corners = _floats("vertices", vertices, (None, 3))
    *levels, whole = _core.survey_planes(corners, _faces(faces, len(corners)), checked.name, dict(checked.options))
    return levels, whole


def faults() -> list[str]:
    """The mistakes that can be planted in the traversal, for tests of tests."""
    return _core.faults()


def _floats(name: str, values: ArrayLike, shape: tuple[int | None, ...]) -> NDArray[np.float32]:
    """A float32 array of this shape (None: any length)."""
    array = np.asarray(values)
    if array.dtype not in (np.float32, np.float64):
        raise TypeError(f"{name} must be float32 or float64, but is {array.dtype}")
    if array.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("n" if want is None else str(want) for want in shape)
        raise ValueError(f"{name} must have the shape ({wanted}{',' * (len(shape) == 1)}), but has {array.shape}")
    with np.errstate(over="ignore"):
        return np.ascontiguousarray(array, np.float32)


def _faces(values: ArrayLike, vertices: int) -> NDArray[np.uint32]:
    """A uint32 array (m, 3) of indices below `vertices`."""
    array = np.asarray(values)
    if not np.issubdtype(array.dtype, np.integer):
        raise TypeError(f"faces must be integers, but are {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"faces must have the shape (n, 3), but has {array.shape}")
    wrong = np.argwhere((array < 0) | (array >= vertices))
    if len(wrong):
        face, corner = wrong[0]
        raise IndexError(f"face {face} refers to vertex {array[face, corner]}, but there are {vertices} vertices")
    return np.ascontiguousarray(array, np.uint32)


def _rays(
    origins: ArrayLike, directions: ArrayLike, maxt: ArrayLike
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Rays as the core takes them."""
    starts = _floats("origins", origins, (None, 3))
    along = _floats("directions", directions, (len(starts), 3))
    ends = np.asarray(maxt, np.float32)
    return starts, along, np.full(len(starts), ends) if ends.ndim == 0 else _floats("maxt", ends, (len(starts),))
