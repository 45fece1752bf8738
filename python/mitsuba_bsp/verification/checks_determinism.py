"""The same triangles and settings make the same tree, byte by byte, on any number of threads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import cache

from .. import _core
from ..loading import thread_count
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .meshes import Mesh, fan, grid, slivers, soup, sphere
from .oracle import build

THREADS = (1, 2, 8)
REPEATS = 3


@check("C14", "the same tree on any number of threads")
def same_tree(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _build_again)


def _build_again(plan: Plan, subject: Subject) -> Outcome:
    """Variants build one of the meshes, on the least and the most threads."""
    outcome = Outcome(what="builds")
    everything = subject.share == 1
    meshes = _meshes() if everything else _meshes()[:1]
    for mesh in meshes:
        first = ""
        for threads in THREADS if everything else (1, 8):
            with thread_count(threads):
                for _ in range(plan.count(REPEATS) if everything else 1):
                    digest = _digest(build(mesh, subject.spec))
                    first = first or digest
                    sentence = f"{subject.spec.text}, {mesh.name}: another tree on {threads} threads"
                    outcome.expect(mesh.name, digest == first, sentence)
    return outcome


def _digest(tree: _core.Accelerator) -> str:
    digest = hashlib.sha256()
    for part in tree.memory():
        digest.update(part)
    return digest.hexdigest()


@cache
def _meshes() -> tuple[Mesh, ...]:
    """So large that both children of the root have over 1,024 triangles: they are built by different threads."""
    return (
        soup("soup", 2_500, edge=0.05),
        sphere("bumpy sphere", 26, bumps=0.05),
        grid("lattice", 36),
        slivers("slivers", 2_500, 1e3),
        fan("fan", 2_500),
    )
