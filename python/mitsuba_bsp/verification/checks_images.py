"""Images: with the same seed every tree renders the same pixels as brute force, to the last bit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..scalar import mitsuba
from ..spec import Spec, parse_spec
from .check import Failure, Outcome, Plan, Subject, Unit, check
from .meshes import Mesh, cornell, soup, sphere
from .wrapped import group, to_mitsuba

RESOLUTION, SAMPLES, SEED = 64, 16, 3
Description = dict[str, Any]


def _moved(mesh: Mesh, scale: float) -> Mesh:
    """Around the origin, which the camera looks at."""
    vertices = ((mesh.vertices - mesh.centre) * scale).astype(np.float32)
    return Mesh(mesh.name, vertices, mesh.faces)


def _room() -> Description:
    """Boxes in a box, a lamp of triangles."""
    lamp = {"type": "area", "radiance": {"type": "rgb", "value": 20.0}}
    return {
        "room": to_mitsuba(_moved(cornell("room"), 3.0)),
        "lamp": to_mitsuba(_moved(sphere("lamp", 5), 0.3), child=lamp),
    }


def _glass() -> Description:
    """A bumpy ball of glass: long paths, many of them along the surface."""
    return {"ball": to_mitsuba(_moved(sphere("ball", 9, bumps=0.1), 0.8), child={"type": "dielectric"})}


def _soup() -> Description:
    """Overlapping triangles, rough metal."""
    return {"soup": to_mitsuba(_moved(soup("soup", 300), 1.5), child={"type": "roughconductor"})}


SCENES: dict[str, Callable[[], Description]] = {"room": _room, "glass": _glass, "soup": _soup}


def view(samples: int, origin: Sequence[float] = (0, -6, 2), depth: int = 6) -> Description:
    """A scene without shapes. Fixed blocks and a box filter: elsewhere Mitsuba varies with the number of threads."""
    mi = mitsuba()
    camera = {
        "type": "perspective",
        "fov": 50,
        "to_world": mi.ScalarTransform4f().look_at(origin=list(origin), target=[0, 0, 0], up=[0, 0, 1]),
        "sampler": {"type": "independent", "sample_count": samples},
        "film": {"type": "hdrfilm", "width": RESOLUTION, "height": RESOLUTION, "rfilter": {"type": "box"}},
    }
    integrator = {"type": "path", "max_depth": depth, "rr_depth": 1000, "block_size": 16}
    return {"type": "scene", "integrator": integrator, "camera": camera}


def _render(scene: str, spec: Spec, samples: int) -> np.ndarray:
    mi = mitsuba()
    description = {**view(samples), "sky": {"type": "constant"}, "meshes": group(spec, SCENES[scene]())}
    return np.array(mi.render(mi.load_dict(description, optimize=False), seed=SEED), np.float32)


@lru_cache(maxsize=2 * len(SCENES))
def _expected(scene: str, triangle_test: str, samples: int) -> np.ndarray:
    return _render(scene, parse_spec(f"brute:triangle_test={triangle_test}"), samples)


@check("C17", "every tree renders the pixels of brute force")
def image_smoke(plan: Plan) -> Iterator[Unit]:
    for subject in plan.subjects:
        for scene in subject.part_of(list(SCENES), len(SCENES)):
            yield Unit(f"{subject.spec.text} {scene}", subject.spec.text, lambda s=subject, k=scene: _smoke(plan, s, k))


def _smoke(plan: Plan, subject: Subject, scene: str) -> Outcome:
    samples = plan.count(SAMPLES, subject)
    expected = _expected(scene, subject.triangle_test, samples)
    return compare_pixels(subject, scene, _render(scene, subject.spec, samples), expected)


def compare_pixels(subject: Subject, scene: str, image: np.ndarray, expected: np.ndarray) -> Outcome:
    """Every pixel that differs in a bit of any channel is wrong; so is an image of nothing."""
    outcome = Outcome(what="pixels", judged=subject.promises)
    differ = (image.view(np.uint32) != expected.view(np.uint32)).any(axis=2)
    where = np.argwhere(differ).tolist()[:1]
    text = f"{subject.spec.text} renders other pixels of {scene} than brute force, seed {SEED}, the first at {where}"
    outcome.add(scene, differ.size, int(differ.sum()), lambda: Failure(text))
    outcome.expect("contrast", bool(np.isfinite(expected).all() and expected.std() > 0), f"{scene} shows nothing")
    return outcome
