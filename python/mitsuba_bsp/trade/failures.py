"""How often an accelerator is wrong: against brute force, and confirmed by the exact oracle, family by family.

A ray is wrong if its answer is not that of a loop over all triangles with the watertight test, and an answer is another
one if one hits where the other misses, or if their t differ by more than rounding (`contenders.T_TOLERANCE`). The
exact oracle confirms it if the answer is none that it allows either: so no accelerator is blamed for an answer that is
as good as brute force's own, as there may be where a ray grazes an edge. Of our own trees, which answer with a
triangle and the bits of t, it is counted besides how often these are not those of the loop with the same test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contenders import T_TOLERANCE, Contender, build, triangles_of
from ..jobs import Job
from ..loading import open_file
from ..spec import parse_spec
from ..verification.exact import ExactRay
from ..verification.meshes import Mesh
from . import questions
from .questions import Aimed

#: Of the wrong rays of a family so many are held against the exact oracle, which takes milliseconds for each.
CONFIRMED_AT_MOST = 40

#: How far from the origin a scene is moved, in its own size.
DISTANCES = (0.0, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7)

#: An answer may be off by this share of the largest coordinate that it was computed from: 64 units in the last place.
_ROUNDING = 64 * 2.0**-24


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """The failures of `job.spec` in the scene as it is: `families`, each with its counts."""
    stage(f"loading {job.scene}")
    triangles = triangles_of(open_file(job.scene, params=job.params).meshes)
    return {"families": _families(job, stage, triangles, "")}


def measure_far(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """The same for the scene moved by each of DISTANCES: `distances`, each with its size and families."""
    stage(f"loading {job.scene}")
    triangles = triangles_of(open_file(job.scene, params=job.params).meshes)
    found = [
        {"sizes": sizes, "families": _families(job, stage, questions.moved(triangles, sizes), f"-moved-{sizes:g}")}
        for sizes in DISTANCES
    ]
    return {"distances": found}


def _families(
    job: Job, stage: Callable[[str], None], triangles: questions.Triangles, place: str
) -> dict[str, dict[str, int]]:
    spec, count = parse_spec(job.spec), int(job.choices["rays"])
    if place:
        count = max(1, count // 4)
    mesh = questions.mesh_of(Path(job.scene).stem, triangles)
    file = Path(job.arrays).parent.parent / "rays" / f"{mesh.name}{place}-{count}-{triangles.sha256()[:12]}.npz"
    asked = questions.aimed(mesh, count, file, stage)
    stage(f"building {job.spec}")
    contender = build(spec, triangles)
    if spec.is_tree:
        asked.append(questions.in_planes(mesh, contender, count))
    found = {}
    for rays in asked:
        stage(f"asking about {rays.family} rays")
        found[rays.family] = counted(mesh, contender, rays)
    return found


def counted(mesh: Mesh, contender: Contender, asked: Aimed) -> dict[str, int]:
    """How many rays are wrong, and how; see the top of this file.

    `hit_or_miss` and `t` are `wrong` together; of them `checked` were held against the exact oracle, which has
    `confirmed` so many. `triangle` and `bits`: other triangles and other bits of t than those of the same test.
    """
    answers = contender.tree.closest(*asked.arrays)
    t = answers["t"] if contender.spec.is_tree else answers
    truth = asked.truth["woop"]["t"]
    hit_or_miss = np.isfinite(t) != np.isfinite(truth)
    wrong = hit_or_miss | _apart(mesh, asked, t, truth)
    chosen = np.flatnonzero(wrong)[:CONFIRMED_AT_MOST]
    found = {
        "rays": len(asked),
        "wrong": int(wrong.sum()),
        "hit_or_miss": int(hit_or_miss.sum()),
        "t": int((wrong & ~hit_or_miss).sum()),
        "checked": len(chosen),
        "confirmed": sum(not _allowed(mesh, asked, int(index), float(t[index])) for index in chosen),
    }
    if contender.spec.is_tree:
        same_test: Mapping[str, NDArray] = asked.truth[str(contender.spec.settings["triangle_test"])]
        found["triangle"] = int((answers["triangle"] != same_test["triangle"]).sum())
        found["bits"] = int((t.view(np.uint32) != same_test["t"].view(np.uint32)).sum())
    return found


def _apart(mesh: Mesh, asked: Aimed, one: NDArray, other: NDArray) -> NDArray[np.bool_]:
    """Where two hits are farther from one another than rounding can make them."""
    both = np.isfinite(one) & np.isfinite(other)
    gap = np.zeros(len(asked))
    gap[both] = np.abs(one[both].astype(float) - other[both])
    return gap > _tolerance(mesh, asked.origins, asked.directions, np.where(both, other, 0))


def _tolerance(mesh: Mesh, origins: NDArray, directions: NDArray, t: NDArray) -> NDArray[np.float64]:
    """By how much t may be off: relatively, and where it is small beside the coordinates, by the rounding of these."""
    reach = np.maximum(np.abs(origins).max(axis=-1), np.abs(mesh.vertices).max()).astype(float)
    return T_TOLERANCE * np.abs(t) + _ROUNDING * reach / np.abs(directions).max(axis=-1)


def _allowed(mesh: Mesh, asked: Aimed, index: int, t: float) -> bool:
    """Whether the exact oracle has this answer too: a triangle is hit there, and none is clearly before it."""
    ray = ExactRay(asked.origins[index], asked.directions[index])
    exact = [ray.hit(mesh.vertices[mesh.faces[triangle]]) for triangle in ray.candidates(mesh)]
    hits = np.array([float(hit) for hit in exact if hit is not None and hit > Fraction(-1)], float)
    near = float(_tolerance(mesh, asked.origins[index], asked.directions[index], np.array(t if t < np.inf else 0)))
    if t == np.inf:
        return not (hits > near).any()
    return bool((np.abs(hits - t) <= near).any()) and not ((hits > near) & (hits < t - near)).any()
