"""Scenes changed in ways that change no answer, or change it exactly: scaled, mirrored, renumbered."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..accelerator import NO_TRIANGLE
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .judge import enter
from .meshes import Mesh, small_meshes
from .oracle import Answers, Questions, brute_force, build, ended, questions
from .rays import FAMILIES, in_turns
from .threads import shared

RAYS = 200_000

#: Rays of each change of a mesh that are ready to be asked: as many as any subject asks.
PREPARED = 7_000

#: Variants get one in so many meshes, and more rays in each.
VARIANT_MESHES = 4

POWERS = (-60, -20, -1, 1, 20, 60, 100)
Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Change:
    """A change of a scene: the new mesh, where points go, how t changes, and the old numbers of the new triangles.

    Equal to itself only, so that the right answers can be kept.
    """

    name: str
    mesh: Mesh
    move: Callable[[Floats], Floats]
    power: int = 0  #: t is multiplied by 2^power
    old_ids: NDArray[np.uint32] | None = None
    mirror: Floats | None = None  #: factors of directions
    same_bits: bool = True  #: else the order of additions has changed


@check("C10", "scaled by a power of two, the same bits", at_once=True)
def scaled_scenes(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, lambda plan, subject: _compare(plan, subject, _scalings))


@check("C11", "mirrored, renumbered and shuffled, the same hits", at_once=True)
def symmetric_scenes(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, lambda plan, subject: _compare(plan, subject, _symmetries))


def _compare(plan: Plan, subject: Subject, changes: Callable[[Mesh, int], Mapping[str, Change]]) -> Outcome:
    """Each small mesh in every change; for variants a quarter of the meshes, each in one change."""
    outcome = Outcome(judged=subject.promises)
    meshes = subject.part_of(small_meshes(), VARIANT_MESHES)
    for index, mesh in enumerate(meshes):
        of_mesh = [
            change
            for change in changes(mesh, plan.seed).values()
            if change.same_bits or subject.triangle_test == "woop"  # mt's error has no bound
        ]
        chosen = of_mesh if subject.share == 1 else [of_mesh[(subject.turn + index) % len(of_mesh)]]
        count = plan.count(RAYS, subject) // (len(meshes) * len(chosen)) + 1
        for change in chosen:
            changed = _changed(mesh, change, plan.count(PREPARED), plan.seed, subject.triangle_test).head(count)
            answers = build(change.mesh, subject.spec).closest(*changed.rays)
            enter(outcome, subject, changed, _wrong(answers, changed, change), f"answers otherwise when {change.name}")
    return outcome


@shared(512)
def _changed(mesh: Mesh, change: Change, count: int, seed: int, triangle_test: str) -> Questions:
    """Rays of all families in turns in the changed scene; they must hit what they hit in the mesh as it is."""
    o, d, maxt, unbounded = _unchanged(mesh, count, seed, triangle_test)
    ends = _ends(maxt, change)
    expected = ended(brute_force(mesh, triangle_test), (o, d), unbounded, np.ldexp(ends, -change.power))
    rays = change.move(o), d if change.mirror is None else d * change.mirror, ends
    expected = {**expected, "t": np.ldexp(expected["t"], change.power)}
    if change.old_ids is not None:
        expected["triangle"] = _renumbered(expected["triangle"], change.old_ids)
        # Of equal t the smallest number counts, which may be another one now.
        expected["or triangle"] = brute_force(change.mesh, triangle_test).closest(*rays)["triangle"]
    return Questions(change.mesh, change.name, seed, *rays, expected)


@shared(64)
def _unchanged(mesh: Mesh, count: int, seed: int, triangle_test: str) -> tuple[Floats, Floats, Floats, Answers]:
    """Rays of all families in turns in the mesh as it is, the ends of their intervals, and what they hit without."""
    families = [asked.rays for asked in questions(mesh, count // len(FAMILIES) + 1, seed, triangle_test)]
    o, d, maxt = in_turns(families, count)
    return o, d, maxt, brute_force(mesh, triangle_test).closest(o, d, np.full_like(maxt, np.inf))


def _renumbered(ids: NDArray[np.uint32], old_ids: NDArray[np.uint32]) -> NDArray[np.uint32]:
    new_ids = np.empty(len(old_ids), np.uint32)
    new_ids[old_ids] = np.arange(len(old_ids))
    return np.where(ids == NO_TRIANGLE, ids, new_ids[np.minimum(ids, len(new_ids) - 1)])


def _ends(maxt: Floats, change: Change) -> Floats:
    """Ends of intervals in the changed scene, infinite where they have no counterpart there."""
    if not change.same_bits:
        return np.full_like(maxt, np.inf)
    finite = np.where(np.isfinite(maxt), maxt, np.float32(0))
    with np.errstate(over="ignore"):
        moved = np.ldexp(finite, change.power)
    kept = np.isfinite(maxt) & (np.ldexp(moved, -change.power) == finite)  # else it has become too small for a float
    return np.where(kept, moved, np.float32(np.inf))


def _wrong(answers: Answers, asked: Questions, change: Change) -> NDArray[np.bool_]:
    expected = asked.expected
    other_t = answers["t"] != expected["t"]  # zeros of either sign are the same
    if not change.same_bits:
        error = _error_of_t(asked)
        first = np.minimum(answers["t"], expected["t"])
        with np.errstate(invalid="ignore"):
            near = np.abs(answers["t"].astype(float) - expected["t"]) <= error
        return other_t & ~near & (first > error)  # what is hit at the origin itself may be behind it by rounding
    ids = answers["triangle"]
    return other_t | ((ids != expected["triangle"]) & (ids != expected.get("or triangle", expected["triangle"])))


def _error_of_t(asked: Questions) -> NDArray[np.float64]:
    """What another order of additions may do to t: a unit in the last place of the distance to the scene's far side."""
    corners = np.array([asked.mesh.vertices.min(axis=0), asked.mesh.vertices.max(axis=0)], float)
    reach = np.abs(corners - asked.origins[:, None]).max(axis=(1, 2))
    return 2.0**-23 * reach / np.abs(asked.directions).max(axis=1)


@shared()
def _scalings(mesh: Mesh, seed: int) -> dict[str, Change]:
    del seed
    found_changes = {}
    for power in POWERS:
        vertices = np.ldexp(mesh.vertices, power)
        if (np.ldexp(vertices, -power) != mesh.vertices).any():
            raise AssertionError(f"{mesh.name} cannot be scaled by 2^{power}")
        name = f"scaled by 2^{power}"
        scaled = Mesh(f"{mesh.name} {name}", vertices, mesh.faces)
        found_changes[name] = Change(name, scaled, lambda points, power=power: np.ldexp(points, power), power)
    return found_changes


@shared()
def _symmetries(mesh: Mesh, seed: int) -> dict[str, Change]:
    """Seven reflections, the corners of every triangle in the two other orders, and all triangles shuffled."""
    found_changes = {}
    for bits in range(1, 8):
        signs = np.float32([-1 if bits >> axis & 1 else 1 for axis in range(3)])
        name = "mirrored in " + "".join("xyz"[axis] for axis in range(3) if bits >> axis & 1)
        mirrored = Mesh(f"{mesh.name} {name}", mesh.vertices * signs, mesh.faces)
        found_changes[name] = Change(name, mirrored, lambda points, signs=signs: points * signs, mirror=signs)
    for turn in (1, 2):
        name = f"corners turned by {turn}"
        turned = Mesh(f"{mesh.name} {name}", mesh.vertices, np.ascontiguousarray(np.roll(mesh.faces, turn, axis=1)))
        found_changes[name] = Change(name, turned, lambda points: points, same_bits=False)
    order = np.random.default_rng([seed, 11]).permutation(len(mesh.faces)).astype(np.uint32)
    shuffled = Mesh(f"{mesh.name} shuffled", mesh.vertices, np.ascontiguousarray(mesh.faces[order]))
    found_changes["shuffled"] = Change("shuffled", shuffled, lambda points: points, old_ids=order)
    return found_changes
