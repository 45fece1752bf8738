"""Nightly: images of two million samples under every tree against Embree's, and furnaces whose radiance is known."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from ..image_regression import Setup, render
from ..judging import Rendering, judge
from ..noise import LEAST_SAMPLES
from .check import Outcome, Plan, Unit, check
from .checks_images import RESOLUTION, SCENES, SEED, Description, view
from .contest import main_subjects
from .meshes import Mesh, boxes, sphere
from .wrapped import to_mitsuba

SAMPLES = -(-2_000_000 // RESOLUTION**2)  #: of a pixel
REFERENCE = "embree:robust=true"

#: Added to the seed for the image that is compared by its noise.
OTHER_SEED = 1000

#: Standard errors that a furnace's mean may be off.
FURNACE_ERRORS = 4.0

#: Paths in a furnace are ten times as long as others, so it gets a quarter of the samples.
LONG_PATHS = 4

#: Radiance outside the furnaces, which a single path that escapes brings into its pixel, and what no noise makes of 1.
OUTSIDE, BRIGHT = 1e9, 100.0


def _furnaces() -> dict[str, Mesh]:
    """Closed: of large triangles, and of many."""
    return {"box furnace": boxes("box", [((-1, -1, -1), (1, 1, 1))]), "sphere furnace": sphere("sphere", 40)}


@check("N12", "images of two million samples: Embree's, and furnaces of radiance 1")
def image_set(plan: Plan) -> Iterator[Unit]:
    samples = max(LEAST_SAMPLES, plan.count(SAMPLES))
    for scene in SCENES:
        for subject in main_subjects(plan):
            text = subject.spec.text
            yield Unit(f"{scene} under {text}", text, lambda k=scene, s=text: _against_embree(k, s, samples))
    for furnace in _furnaces():
        for subject in main_subjects(plan):
            text = subject.spec.text
            yield Unit(
                f"{furnace} under {text}", text, lambda k=furnace, s=text: _furnace(k, s, -(-samples // LONG_PATHS))
            )


def _scene(name: str, samples: int) -> Description:
    return {**view(samples), "sky": {"type": "constant"}, **SCENES[name]()}


@lru_cache(maxsize=4)
def _reference(name: str, samples: int, seed: int) -> Rendering:
    return render(_scene(name, samples), REFERENCE, name, Setup(seed=seed))


def _against_embree(name: str, spec: str, samples: int) -> Outcome:
    """The same seed must differ without bias, another seed within the noise; noise gets a second try."""
    outcome = Outcome(what="images")
    image = render(_scene(name, samples), spec, name, Setup(seed=SEED))
    for gate, seeds in (("paired", (SEED,)), ("z", (SEED + OTHER_SEED, SEED + 2 * OTHER_SEED))):
        judgements = []
        for seed in seeds:
            judgements.append(judge(image, _reference(name, samples, seed), gate))
            if judgements[-1].same:
                break
        found = "; ".join(judgements[-1].lines)
        outcome.expect(gate, judgements[-1].same, f"{name} under {spec} against {REFERENCE}: {found}")
    return outcome


def _furnace(name: str, spec: str, samples: int) -> Outcome:
    """Walls that emit a half and reflect a half: radiance 1 wherever one looks, unless a path escapes."""
    half = {"type": "rgb", "value": 0.5}
    lamp, paint = (
        {"type": "area", "radiance": half},
        {"type": "twosided", "b": {"type": "diffuse", "reflectance": half}},
    )
    mesh = inside_out(_furnaces()[name])  # area lights shine to the side of the normal
    walls = to_mitsuba(mesh, child=lamp, bsdf=paint)
    outside = {"type": "constant", "radiance": {"type": "rgb", "value": OUTSIDE}}
    scene = {**view(samples, (0.1, -0.5, 0.2), depth=64), "walls": walls, "sky": outside}
    image = render(scene, spec, name, Setup(seed=SEED))
    pixels = np.stack([plane.astype(np.float64) for plane in image.image.values()], axis=2)
    means = pixels.mean(axis=2)
    error = float(means.std() / np.sqrt(means.size))
    outcome = Outcome(what="images", figures={"mean": float(means.mean()), "standard error": error})
    escaped = int((means > BRIGHT).sum())
    # What rounding makes of sums of halves is no noise.
    off, allowed = abs(float(means.mean()) - 1), max(FURNACE_ERRORS * error, 1e-5)
    text = f"{name} under {spec}"
    outcome.expect("mean", off <= allowed, f"{text}: the mean radiance is {means.mean()}, 1 +- {allowed:.2g} is right")
    outcome.expect("escapes", escaped == 0, f"{text}: from {escaped} pixels a path got out")
    return outcome


def inside_out(mesh: Mesh) -> Mesh:
    """With its normals to the other side."""
    return Mesh(mesh.name, mesh.vertices, np.ascontiguousarray(mesh.faces[:, ::-1]), mesh.closed)
