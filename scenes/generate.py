"""Writes the meshes of the built-in scenes: `python generate.py OUTDIR` leaves OUTDIR/SCENE_SHAPE.ply.

The same bytes come out every time: the seeds are fixed, and nothing else is random.
"""

from __future__ import annotations

import sys
from pathlib import Path

import foliage
import knot
import room
from mesh import write_ply

SCENES = {"room": room.meshes, "foliage": foliage.meshes, "knot": knot.meshes}


def generate(folder: Path) -> None:
    """Writes every mesh of every scene into `folder`, which is created if need be."""
    folder.mkdir(parents=True, exist_ok=True)
    for scene, meshes in SCENES.items():
        for shape, mesh in meshes().items():
            write_ply(mesh, folder / f"{scene}_{shape}.ply")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python generate.py OUTDIR")
    generate(Path(sys.argv[1]))
