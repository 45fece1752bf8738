"""Nightly: as many aimed rays as needed to show that failures are rarer than one in 3e7, all trees asked alike."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from .. import _core
from .check import Outcome, Plan, Subject, Unit, check
from .contest import (
    BATCH,
    Contestant,
    compare,
    enter,
    family_rays,
    judged_subjects,
    main_subjects,
    names,
    report,
)
from .exactness import against_exact, exactness_tables, publish
from .meshes import Mesh, large_mesh, slivers, small_meshes, soup, sphere
from .oracle import Questions, brute_force, found, questions_to
from .rays import FAMILIES, interior_rays
from .real_meshes import real_meshes

UNIT = 1_000_000  #: rays of a unit

N01_RAYS = 100_000_000  #: of each tree, against brute force
N02_RAYS = 100_000_000  #: between trees, on meshes of a million triangles
N02_REAL_RAYS = 1_000_000  #: on each further mesh
N04_RAYS = 1_000_000  #: of each kind, at each place
N07_RAYS = 1_000_000  #: of each mesh
N07_EXACT_RAYS = 400  #: of each mesh, in exact arithmetic

#: From afar the error bound is as large as the mesh, and a ray visits much of its tree: a millisecond at a million
#: triangles.
LARGE_SHARES = {"far": 1e-3}


def _units(count: int) -> list[int]:
    """So many rays, a million at a time."""
    return [min(UNIT, count - start) for start in range(0, count, UNIT)]


@check("N01", "equal to brute force, 1e8 rays a tree")
def equal_to_brute_at_scale(plan: Plan) -> Iterator[Unit]:
    subjects = judged_subjects(plan)
    for mesh in small_meshes():
        sizes = _units(-(-plan.count(N01_RAYS) // len(small_meshes())))
        for index, size in enumerate(sizes):
            yield Unit(
                f"{mesh.name} {index + 1} of {len(sizes)}, {names(subjects)}",
                "",
                lambda m=mesh, i=index, n=size: _against(plan, m, i, n, brute_force(m), _entered(m, subjects)),
            )


@lru_cache(maxsize=1)
def _entered(mesh: Mesh, subjects: tuple[Subject, ...]) -> list[Contestant]:
    return enter(mesh, subjects)


def _against(
    plan: Plan,
    mesh: Mesh,
    index: int,
    count: int,
    reference: _core.Accelerator,
    contestants: list[Contestant],
    shares: dict[str, float] | None = None,
) -> Outcome:
    outcome = Outcome()
    rng = plan.rng("contest", mesh.name, index)
    for family, rays in family_rays(mesh, count, rng, contestants, shares or {}):
        compare(outcome, questions_to(reference, mesh, plan.seed, family, rays, rng), contestants)
    return outcome


@check("N02", "every tree answers alike on large meshes, 1e8 rays")
def trees_agree_on_large_meshes(plan: Plan) -> Iterator[Unit]:
    subjects = main_subjects(plan)
    million, real = plan.count(N02_RAYS), plan.count(N02_REAL_RAYS)
    meshes = [
        ("bumpy sphere of a million", lambda: sphere("million", 501, bumps=0.02), million // 2),
        ("soup of a million", lambda: soup("million", 1_000_000, edge=0.01), million - million // 2),
        ("bumpy sphere of 100,000", large_mesh, real),
        *((name, load, real) for name, load in real_meshes(at_least=65_000).items()),
    ]
    for name, make, count in meshes:
        for index, size in enumerate(_units(count)):
            yield Unit(
                f"{name} {index + 1}, {names(subjects)}",
                "",
                lambda k=name, f=make, i=index, n=size: _alike(plan, k, f, i, n, subjects),
            )


_Large = tuple[Mesh, list[Contestant]]
_large: dict[str, _Large] = {}


def _trees_of(name: str, make: Callable[[], Mesh], subjects: tuple[Subject, ...]) -> _Large:
    """The trees of one large mesh; those of the one before are given up."""
    if name not in _large:
        _large.clear()
        mesh = make()
        _large[name] = mesh, enter(mesh, subjects)
    return _large[name]


def _alike(
    plan: Plan, name: str, make: Callable[[], Mesh], index: int, count: int, subjects: tuple[Subject, ...]
) -> Outcome:
    mesh, (first, *others) = _trees_of(name, make, subjects)
    outcome = _against(plan, mesh, index, count, first.tree, [first, *others], LARGE_SHARES)
    outcome.figures["triangles"] = len(mesh.faces)
    return outcome


@check("N04", "no ray escapes a closed sphere of 159,200 triangles")
def watertight_at_scale(plan: Plan) -> Iterator[Unit]:
    subjects = main_subjects(plan)
    for place, centre in {"0": (0, 0, 0), "1e3": (1e3, -1e3, 7e2), "2.7e5": (148376, 1234, -223423)}.items():
        for kind in ("random", "edge", "vertex"):
            yield Unit(
                f"{kind} at {place}, {names(subjects)}",
                "",
                lambda p=place, c=centre, k=kind: _escapes(
                    plan, k, _trees_of(f"closed at {p}", lambda: sphere(f"closed at {p}", 200, c), subjects)
                ),
            )


def _escapes(plan: Plan, kind: str, large: _Large) -> Outcome:
    mesh, contestants = large
    outcome = Outcome()
    rng = plan.rng("N04", mesh.name, kind)
    count = plan.count(N04_RAYS)
    for start in range(0, count, BATCH):
        o, d = interior_rays(mesh, min(BATCH, count - start), rng, kind)
        ends = np.full(len(o), np.inf, np.float32)
        for contestant in contestants:
            answers = contestant.tree.closest(o, d, ends)
            asked = Questions(mesh, kind, plan.seed, o, d, ends, answers)
            report(outcome, contestant.subject, asked, ~found(answers))
    return outcome


@check(
    "N07",
    "equal to brute force wherever, however large, however thin",
    exactness_tables(
        "The triangle test at the extremes, against exact arithmetic", lambda unit: unit.partition(",")[0]
    ),
)
def extremes(plan: Plan) -> Iterator[Unit]:
    subjects = judged_subjects(plan)
    for mesh in extreme_meshes():
        yield Unit(f"{mesh.name}, {names(subjects)}", "", lambda m=mesh: _extreme(plan, m, subjects))


def extreme_meshes() -> Iterator[Mesh]:
    """Moved by up to 1e7 sizes, drawn out up to 1e12:1, scaled by 1e-30 to 1e30."""
    ball = sphere("bumpy", 7, bumps=0.1)
    for exponent in np.arange(0, 7.5, 0.5):
        move = ball.size * 10**exponent * np.array([0.6, -0.48, 0.64])
        yield _like(ball, f"moved by 1e{exponent:g}", ball.vertices.astype(float) + move)
    for exponent in range(0, 13):
        yield slivers(f"aspect 1e{exponent}", 150, 10.0**exponent)
    for exponent in range(-30, 31, 5):
        yield _like(ball, f"scaled by 1e{exponent}", ball.vertices.astype(float) * 10.0**exponent)


def _like(mesh: Mesh, name: str, vertices: np.ndarray) -> Mesh:
    return Mesh(name, np.ascontiguousarray(vertices, np.float32), mesh.faces, mesh.closed)


def _extreme(plan: Plan, mesh: Mesh, subjects: tuple[Subject, ...]) -> Outcome:
    contestants = enter(mesh, subjects)
    outcome = _against(plan, mesh, 0, plan.count(N07_RAYS), brute_force(mesh), contestants)
    outcome.figures["dropped triangles"] = json.loads(contestants[0].tree.statistics())["dropped_triangles"]
    for family, make in FAMILIES.items():
        o, d = make(mesh, plan.count(N07_EXACT_RAYS / len(FAMILIES)), plan.rng("N07 exact", mesh.name, family))
        ends = np.full(len(o), np.inf, np.float32)
        asked = Questions(mesh, family, plan.seed, o, d, ends, brute_force(mesh).closest(o, d, ends))
        publish(outcome, asked, against_exact(asked))
    return outcome
