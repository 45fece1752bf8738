"""Meshes of real scenes, where their folder is beside the checkout."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..scalar import mitsuba
from .meshes import Mesh

#: Names another folder of real scenes.
VARIABLE = "MITSUBA_BSP_SCENES"


def scenes_folder() -> Path | None:
    """`../shared/scenes` of the checkout that this was started in, or what the variable says."""
    folder = Path(os.environ.get(VARIABLE) or Path.cwd().parent / "shared" / "scenes")
    return folder if folder.is_dir() else None


def real_meshes(at_least: int) -> dict[str, Callable[[], Mesh]]:
    """The PLY files with so many triangles or more, by name; they are read when they are called for."""
    folder = scenes_folder()
    files = sorted(folder.glob("*.ply")) if folder else []
    return {file.stem: lambda f=file: read(f) for file in files if _triangles(file) >= at_least}


def read(file: Path) -> Mesh:
    """A mesh file as Mitsuba reads it."""
    mi = mitsuba()
    params = mi.traverse(mi.load_dict({"type": "ply", "filename": str(file)}))
    vertices = np.array(params["vertex_positions"], np.float32).reshape(-1, 3)
    return Mesh(file.stem, vertices, np.array(params["faces"], np.uint32).reshape(-1, 3))


def _triangles(file: Path) -> int:
    """The number of faces that a PLY header names."""
    with file.open("rb") as stream:
        for line in stream:
            if line.startswith(b"element face"):
                return int(line.split()[2])
            if line.startswith(b"end_header"):
                break
    return 0
