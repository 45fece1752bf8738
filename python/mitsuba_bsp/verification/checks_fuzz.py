"""Nightly: meshes of garbage, after Embree's test GarbageGeometry; but the hits are held against brute force."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from .check import Outcome, Plan, Subject, Unit, check
from .contest import compare, enter, main_subjects, names
from .meshes import Mesh, soup
from .oracle import answered, brute_force
from .rays import Generator, Rays

SCENES, PER_UNIT = 20_000, 500
MAX_TRIANGLES = 255
RAYS = 200  #: in each scene

#: One in so many indices is that of any vertex.
RANDOM_INDICES = 32
#: Kinds of meshes, in turns, and the share of their coordinates that is garbage; the others are those of a soup.
KINDS = (("soup", 1 / 16), ("bits", 1.0))
ODD = np.float32([np.nan, np.inf, -np.inf, 1e30, -0.0, 1e-40])


@check("N08", "equal to brute force on garbage")
def garbage(plan: Plan) -> Iterator[Unit]:
    subjects = main_subjects(plan)
    scenes = plan.count(SCENES)
    for start in range(0, scenes, PER_UNIT):
        numbers = range(start, min(start + PER_UNIT, scenes))
        name = f"scenes {numbers.start} to {numbers.stop - 1}, {names(subjects)}"
        yield Unit(name, "", lambda n=numbers: _fuzz(plan, subjects, n))


def _fuzz(plan: Plan, subjects: tuple[Subject, ...], numbers: range) -> Outcome:
    outcome = Outcome()
    hits = dropped = 0
    for number in numbers:
        rng = plan.rng("garbage", number)
        kind, share = KINDS[number % len(KINDS)]
        mesh = garbage_mesh(f"garbage {number}", share, rng)
        asked = answered(mesh, kind, aimed_rays(mesh, RAYS, rng), plan.seed)
        contestants = enter(mesh, subjects)
        compare(outcome, asked, contestants)
        expected = _dropped(brute_force(mesh))
        for contestant in contestants:
            found = _dropped(contestant.tree)
            sentence = f"{contestant.subject.spec.text}, {mesh.name}: dropped {found} triangles, brute force {expected}"
            outcome.expect("dropped", found == expected, sentence)
        hits += int(np.isfinite(asked.expected["t"]).sum())
        dropped += expected
    outcome.figures |= {"hits": hits, "dropped": dropped}
    return outcome


def garbage_mesh(name: str, share: float, rng: Generator) -> Mesh:
    """At most 255 triangles; a share of their coordinates is random bits or, if not all are, as often an odd number."""
    base = soup(name, int(rng.integers(1, MAX_TRIANGLES + 1)), seed=int(rng.integers(2**31)))
    shape = base.vertices.shape
    bits = rng.integers(0, 2**32, shape, np.uint32).view(np.float32)
    garbage = np.where(rng.random(shape) < 0.5, bits, rng.choice(ODD, shape)) if share < 1 else bits
    vertices = np.where(rng.random(shape) < share, garbage, base.vertices)
    anywhere = rng.integers(0, len(vertices), base.faces.shape, np.uint32)
    faces = np.where(rng.random(base.faces.shape) < 1 / RANDOM_INDICES, anywhere, base.faces)
    return Mesh(name, np.ascontiguousarray(vertices, np.float32), np.ascontiguousarray(faces, np.uint32))


def aimed_rays(mesh: Mesh, count: int, rng: Generator) -> Rays:
    """From near one triangle towards another, half of them at a corner; of numbers that fit into floats."""
    largest = float(np.finfo(np.float32).max)
    with np.errstate(invalid="ignore"):  # signalling NaNs
        corners = np.clip(np.nan_to_num(mesh.vertices[mesh.faces].astype(float)), -largest, largest)
    chosen = corners[rng.integers(len(corners), size=count)]
    weights = rng.dirichlet(np.ones(3), count)
    at_corner = rng.random(count) < 0.5
    weights[at_corner] = np.eye(3)[rng.integers(3, size=int(at_corner.sum()))]
    targets = np.einsum("nk,nkj->nj", weights, chosen)
    near = chosen[rng.permutation(count), 0]
    origins = near + rng.normal(size=(count, 3)) * np.abs(targets - near)
    origins = np.clip(origins, -largest, largest).astype(np.float32)
    directions = np.clip(targets - origins, -largest, largest).astype(np.float32)
    return origins, directions


def _dropped(tree: object) -> int:
    return json.loads(tree.statistics())["dropped_triangles"]
