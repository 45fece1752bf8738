"""Which differences break a promise."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..accelerator import NO_TRIANGLE
from .check import Outcome, Subject
from .exact import ExactRay
from .oracle import Questions


def enter(outcome: Outcome, subject: Subject, asked: Questions, wrong: NDArray[np.bool_], sentence: str) -> None:
    """Count the wrong rays of one family; of `mt` only those for which the exact oracle does not blame the test."""
    if subject.triangle_test == "mt":
        blamed = [index for index in np.flatnonzero(wrong) if mt_erred(asked, index)]
        wrong[blamed] = False
        outcome.figures["mt_erred"] = int(outcome.figures.get("mt_erred", 0)) + len(blamed)
    spec = subject.spec.text
    outcome.add(
        asked.family, len(asked), int(wrong.sum()), lambda: asked.failure(int(np.argmax(wrong)), spec, sentence)
    )


def mt_erred(asked: Questions, index: int) -> bool:
    """Whether the hit that brute force reports is none, or is farther off than the traversal has to allow for.

    Moeller and Trumbore's test knows no bound on its error: as the ray comes close to the triangle's plane, its hit may
    be anywhere. What the traversal allows for is an error of 8 units in the last place of the distance to the far side
    of the scene, as `WoopTest` keeps it.
    """
    triangle = int(asked.expected["triangle"][index])
    if triangle == NO_TRIANGLE:
        return False
    o, d = asked.origins[index].astype(float), asked.directions[index].astype(float)
    t = ExactRay(o, d).hit(asked.mesh.vertices[asked.mesh.faces[triangle]])
    if t is None:
        return True
    reach = np.abs(asked.mesh.vertices.astype(float) - o).max()
    return abs(float(t - Fraction(float(asked.expected["t"][index])))) * np.abs(d).max() > 8 * 2.0**-24 * reach
