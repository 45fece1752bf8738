"""Of triangles hit at the same t the smallest id counts, whatever their order and however many threads there are."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

import numpy as np

from ..loading import thread_count
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .judge import enter
from .meshes import Mesh, boxes, soup
from .oracle import Questions, answered, build, differing
from .rays import FAMILIES, in_turns

RAYS = 1_000
COPIES = (2, 3, 64, 10_000)
VARIANT_COPIES = (2, 3, 64, 1_000)
THREADS = (1, 2, 8)
AIMED = ("vertex", "edge", "random", "camera")


@check("C07", "of equal hits the smallest id counts")
def smallest_id_of_ties(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _ties)


def _ties(plan: Plan, subject: Subject) -> Outcome:
    outcome = Outcome(judged=subject.promises)
    is_main = subject.share == 1
    for threads in THREADS if is_main else THREADS[-1:]:
        with thread_count(threads):
            for kind in (*(COPIES if is_main else VARIANT_COPIES), "shared face"):
                for shuffled in (False, True):
                    mesh = _stack(kind, shuffled, plan.seed)
                    asked = _questions(mesh, plan.count(RAYS), plan.seed, subject.triangle_test)
                    asked = asked.head(plan.count(RAYS, subject))
                    wrong = differing(build(mesh, subject.spec).closest(*asked.rays), asked.expected)
                    enter(outcome, subject, asked, wrong, f"breaks a tie on {threads} threads")
    return outcome


@cache
def _stack(kind: int | str, shuffled: bool, seed: int) -> Mesh:
    """Copies of one triangle among a few others, or two boxes that share a face, each in any order."""
    rng = np.random.default_rng(seed)
    if isinstance(kind, int):
        others = soup("", 20)
        copies = np.tile([[60, 61, 62]], (kind, 1))
        vertices = np.concatenate([others.vertices, np.float32([[-0.5, 0, -0.3], [0.7, 0.1, 0], [0, 0.9, 0.4]])])
        faces = np.concatenate([others.faces, copies])
    else:
        pair = boxes("", [((0, 0, 0), (1, 1, 1)), ((1, 0, 0), (2, 1, 1))])
        vertices, faces = pair.vertices, pair.faces
    faces = faces[rng.permutation(len(faces))] if shuffled else faces
    name = f"{kind} copies" if isinstance(kind, int) else kind
    return Mesh(name + (", shuffled" if shuffled else ""), vertices, np.ascontiguousarray(faces, np.uint32))


@cache
def _questions(mesh: Mesh, count: int, seed: int, triangle_test: str) -> Questions:
    """Rays at the mesh of several families, in turns; brute force's answers must themselves be the smallest ids."""
    rng = np.random.default_rng([seed, *mesh.name.encode()])
    parts = [FAMILIES[family](mesh, count, rng) for family in AIMED]
    asked = answered(mesh, "ties", in_turns(parts, count), seed, triangle_test)
    same = {tuple(face): index for index, face in reversed(list(enumerate(mesh.faces.tolist())))}
    smallest = np.array([same[tuple(face)] for face in mesh.faces.tolist()])
    ids = asked.expected["triangle"][asked.expected["triangle"] < len(mesh.faces)]
    if (smallest[ids] != ids).any():
        raise AssertionError("brute force does not give the smallest id")
    return asked
