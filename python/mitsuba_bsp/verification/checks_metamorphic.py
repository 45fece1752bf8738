"""Scenes changed in ways that change no answer, or change it exactly: scaled, mirrored, renumbered."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ..accelerator import NO_TRIANGLE
from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .checks_brute import RAYS_PER_FAMILY
from .judge import enter
from .meshes import Mesh, small_meshes
from .oracle import Answers, Questions, brute_force, build, questions

RAYS = 200_000
POWERS = (-60, -20, -1, 1, 20, 60, 100)
Floats = NDArray[np.float32]


@dataclass(frozen=True)
class Change:
    """A change of a scene: the new mesh, where points go, how t changes, and the old numbers of the new triangles."""

    name: str
    mesh: Mesh
    move: Callable[[Floats], Floats]
    power: int = 0  #: t is multiplied by 2^power
    old_ids: NDArray[np.uint32] | None = None
    mirror: Floats | None = None  #: factors of directions
    same_bits: bool = True  #: else the order of additions has changed


@check("C10", "scaled by a power of two, the same bits")
def scaled_scenes(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, lambda plan, subject: _compare(plan, subject, _scalings))


@check("C11", "mirrored, renumbered and shuffled, the same hits")
def symmetric_scenes(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, lambda plan, subject: _compare(plan, subject, _symmetries))


def _compare(plan: Plan, subject: Subject, changes: Callable[[Mesh, int], Mapping[str, Change]]) -> Outcome:
    """Each small mesh in every change; for variants in one of them, another one each time."""
    outcome = Outcome(judged=subject.promises)
    for index, mesh in enumerate(small_meshes()):
        found_changes = [
            change
            for change in changes(mesh, plan.seed).values()
            if change.same_bits or subject.triangle_test == "woop"  # mt's error has no bound
        ]
        chosen = found_changes if subject.share == 1 else [found_changes[index % len(found_changes)]]
        asked = _rays(plan, subject, mesh, plan.count(RAYS) // (len(small_meshes()) * len(found_changes)) + 1)
        for change in chosen:
            changed = _changed(asked, change, subject.triangle_test)
            answers = build(change.mesh, subject.spec).closest(*changed.rays)
            wrong = _wrong(answers, changed, change, subject.triangle_test)
            enter(outcome, subject, changed, wrong, f"answers otherwise when {change.name}")
    return outcome


def _rays(plan: Plan, subject: Subject, mesh: Mesh, count: int) -> Questions:
    """Rays of all families in equal parts, and the answers of brute force in the mesh as it is."""
    asked = questions(mesh, plan.count(RAYS_PER_FAMILY), plan.seed, subject.triangle_test)
    each = count // len(asked) + 1
    heads = [family.head(each) for family in asked]
    o, d, maxt = (np.concatenate(parts) for parts in zip(*(head.rays for head in heads), strict=True))
    return Questions(mesh, "all", plan.seed, o, d, maxt, {})


def _expected(asked: Questions, change: Change, triangle_test: str) -> Answers:
    """What the rays hit in the mesh as it is, to ends that have a counterpart in the change."""
    back = np.ldexp(_ends(asked.maxt, change), -change.power)
    return brute_force(asked.mesh, triangle_test).closest(asked.origins, asked.directions, back)


def _changed(asked: Questions, change: Change, triangle_test: str) -> Questions:
    """The same rays in the changed scene, and what they must hit."""
    expected = _expected(asked, change, triangle_test)
    directions = asked.directions if change.mirror is None else asked.directions * change.mirror
    ids = expected["triangle"]
    if change.old_ids is not None:
        new_ids = np.empty(len(change.old_ids), np.uint32)
        new_ids[change.old_ids] = np.arange(len(change.old_ids))
        ids = np.where(ids == NO_TRIANGLE, ids, new_ids[np.minimum(ids, len(new_ids) - 1)])
    expected = {**expected, "triangle": ids, "t": np.ldexp(expected["t"], change.power)}
    maxt = _ends(asked.maxt, change)
    return Questions(change.mesh, change.name, asked.seed, change.move(asked.origins), directions, maxt, expected)


def _ends(maxt: Floats, change: Change) -> Floats:
    """Ends of intervals in the changed scene, infinite where they have no counterpart there."""
    if not change.same_bits:
        return np.full_like(maxt, np.inf)
    finite = np.where(np.isfinite(maxt), maxt, np.float32(0))
    with np.errstate(over="ignore"):
        moved = np.ldexp(finite, change.power)
    kept = np.isfinite(maxt) & (np.ldexp(moved, -change.power) == finite)  # else it has become too small for a float
    return np.where(kept, moved, np.float32(np.inf))


def _wrong(answers: Answers, asked: Questions, change: Change, triangle_test: str) -> NDArray[np.bool_]:
    expected = asked.expected
    other_t = answers["t"] != expected["t"]  # zeros of either sign are the same
    if not change.same_bits:
        error = _error_of_t(asked)
        first = np.minimum(answers["t"], expected["t"])
        with np.errstate(invalid="ignore"):
            near = np.abs(answers["t"].astype(float) - expected["t"]) <= error
        return other_t & ~near & (first > error)  # what is hit at the origin itself may be behind it by rounding
    # Of equal t the smallest number counts: where numbers have changed, brute force tells it.
    numbers = brute_force(change.mesh, triangle_test).closest(*asked.rays)["triangle"]
    other_id = (answers["triangle"] != expected["triangle"]) & (
        (answers["triangle"] != numbers) if change.old_ids is not None else True
    )
    return other_t | other_id


def _error_of_t(asked: Questions) -> NDArray[np.float64]:
    """What another order of additions may do to t: a unit in the last place of the distance to the scene's far side."""
    reach = np.abs(asked.mesh.vertices[None].astype(float) - asked.origins[:, None]).max(axis=(1, 2))
    return 2.0**-23 * reach / np.abs(asked.directions).max(axis=1)


@cache
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


@cache
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
