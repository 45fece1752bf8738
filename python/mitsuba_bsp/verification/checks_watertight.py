"""Where a surface has no holes, no ray passes: what is hit is known from topology alone, without any oracle.

The recipe of the sphere is that of Embree's watertightness test, aimed; the square is that of the Vulkan conformance
suite, with its vertices and the midpoints of its edges besides the grid of pixels.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .check import Outcome, Plan, Subject, Unit, check, subject_units
from .contest import main_subjects
from .meshes import Mesh, sphere, split_square
from .oracle import Questions, build, found
from .rays import INTERIOR_FAMILIES, Rays, interior_rays
from .threads import shared

RAYS = 100_000
PLACES = {"0": (0, 0, 0), "1e3": (1e3, -1e3, 7e2), "2.7e5": (148376, 1234, -223423)}

#: Rings of the sphere: 9,800 triangles; variants, which get a tenth of the rays, also get a tenth of the triangles.
STEPS, VARIANT_STEPS = 50, 16

SQUARE_SIZES = (4, 16, 64, 256, 1024, 4096)
VARIANT_SQUARE_SIZES = (4, 16, 64, 256)

#: At night, each with ten seeds.
LARGE_SQUARE_SIZES, SQUARE_SEEDS = (4, 16, 64, 256, 1024, 4096, 16_384, 65_536), 10
PIXELS = 256


@shared()
def closed_sphere(steps: int, place: str) -> Mesh:
    return sphere(f"sphere of {steps} rings at {place}", steps, PLACES[place])


@check("C03", "no ray escapes a closed sphere", at_once=True)
def closed_sphere_is_closed(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _leave_sphere)


def _leave_sphere(plan: Plan, subject: Subject) -> Outcome:
    """Variants: at one of the places, with the rays of all of them."""
    outcome = _outcome(subject)
    places = subject.part_of(list(PLACES), len(PLACES))
    count = plan.count(RAYS * len(PLACES) / len(places), subject)
    for place in places:
        mesh = closed_sphere(STEPS if subject.share == 1 else VARIANT_STEPS, place)
        tree = build(mesh, subject.spec)
        for family in INTERIOR_FAMILIES:
            rays = _interior(mesh, plan.count(RAYS), plan.seed, family)
            _all_hit(outcome, plan, subject, mesh, f"{family} at {place}", _head(rays, count), tree)
    return outcome


@check("C04", "no ray passes through a split square", at_once=True)
def split_square_is_whole(plan: Plan) -> Iterator[Unit]:
    return subject_units(plan, _cross_square)


def _cross_square(plan: Plan, subject: Subject) -> Outcome:
    outcome = _outcome(subject)
    for size in SQUARE_SIZES if subject.share == 1 else VARIANT_SQUARE_SIZES:
        _cross(outcome, plan, subject, size, plan.seed)
    return outcome


@check("N05", "no ray passes through a split square of up to 65,536 triangles", at_once=True)
def large_square_is_whole(plan: Plan) -> Iterator[Unit]:
    for subject in main_subjects(plan):
        text = subject.spec.text
        for size in LARGE_SQUARE_SIZES:
            yield Unit(f"{text} {size}", text, lambda s=subject, n=size: _cross_squares(plan, s, n))


def _cross_squares(plan: Plan, subject: Subject, size: int) -> Outcome:
    outcome = _outcome(subject)
    for seed in range(plan.seed, plan.seed + SQUARE_SEEDS):
        _cross(outcome, plan, subject, size, seed)
    return outcome


def _cross(outcome: Outcome, plan: Plan, subject: Subject, size: int, seed: int) -> None:
    mesh = _square(size, seed)
    tree = build(mesh, subject.spec)
    _all_hit(outcome, plan, subject, mesh, "pixels", _pixels(plan, subject), tree)
    _all_hit(outcome, plan, subject, mesh, "vertices and edges", _aimed(mesh), tree)


def _outcome(subject: Subject) -> Outcome:
    """Moeller and Trumbore's test is not watertight, whatever tree it is in."""
    return Outcome(judged=subject.promises and subject.triangle_test == "woop")


def _all_hit(outcome: Outcome, plan: Plan, subject: Subject, mesh: Mesh, family: str, rays: Rays, tree: object) -> None:
    o, d = rays
    maxt = np.full(len(o), np.inf, np.float32)
    answers = tree.closest(o, d, maxt)
    missed = ~found(answers)
    asked = Questions(mesh, family, plan.seed, o, d, maxt, answers)
    sentence = "lets a ray through a closed surface"
    outcome.add(
        family,
        len(o),
        int(missed.sum()),
        lambda: asked.failure(int(np.argmax(missed)), subject.spec.text, sentence, hit=True),
    )


@shared()
def _interior(mesh: Mesh, count: int, seed: int, family: str) -> Rays:
    return interior_rays(mesh, count, np.random.default_rng([seed, *family.encode()]), family)


def _head(rays: Rays, count: int) -> Rays:
    return rays[0][:count], rays[1][:count]


@shared()
def _square(size: int, seed: int) -> Mesh:
    return split_square(f"square of {size}", size, seed)


def _pixels(plan: Plan, subject: Subject) -> Rays:
    """Straight down through the centres of pixels, a random part of them for variants."""
    x, y = (p.ravel() for p in np.meshgrid(*2 * [(np.arange(PIXELS) + 0.5) / PIXELS]))
    part = plan.rng("pixels").permutation(len(x))[: plan.count(len(x), subject)]
    return _downward(np.stack([x, y], axis=-1)[part])


def _aimed(mesh: Mesh) -> Rays:
    """Straight down through all vertices inside the square, and all midpoints of its edges."""
    edges = np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    points = np.concatenate([mesh.vertices, mesh.vertices[edges].astype(float).mean(axis=1)])[:, :2]
    points = points.astype(np.float32)
    return _downward(points[((points > 0) & (points < 1)).all(axis=1)])


def _downward(points: np.ndarray) -> Rays:
    o = np.concatenate([points, np.ones((len(points), 1))], axis=1).astype(np.float32)
    return o, np.tile(np.float32([0, 0, -1]), (len(o), 1))
