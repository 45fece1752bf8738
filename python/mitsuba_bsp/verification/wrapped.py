"""Meshes of the verification inside Mitsuba scenes, in front of them whatever Mitsuba puts there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..loading import load_dict
from ..scalar import mitsuba
from ..spec import Spec
from .meshes import Mesh, boxes, sphere
from .oracle import Answers, found
from .rays import Generator, Rays

#: Where the mesh stands; far from the origin of coordinates the padding of its box must grow.
PLACES = {"0": (0, 0, 0), "1e3": (1000, -1000, 700), "2.7e5": (148376, 1234, -223423)}
KINDS = ("cube", "sphere", "sheet")


def make_mesh(kind: str, place: str) -> Mesh:
    """A cube, whose faces are those of its box; a sphere; a box as flat as a sheet of paper."""
    if kind == "sphere":
        mesh = sphere("sphere", 15)
    else:
        height = 1 if kind == "cube" else 0.001 * (1 + np.abs(PLACES[place]).max() * 1e-4)
        mesh = boxes(kind, [((-1, -1, -height), (1, 1, height))])
    return Mesh(f"{kind} at {place}", (mesh.vertices.astype(float) + PLACES[place]).astype(np.float32), mesh.faces)


def to_mitsuba(
    mesh: Mesh,
    faces: slice = slice(None),
    child: Mapping[str, Any] | None = None,
    bsdf: Mapping[str, Any] | None = None,
) -> Any:
    """Some of the mesh's triangles as a Mitsuba mesh, with an emitter or the like, and a material."""
    mi = mitsuba()
    props = mi.Properties()
    for name, description in (("child", child), ("bsdf", bsdf)):
        if description:
            props[name] = mi.load_dict(dict(description))
    chosen = mesh.faces[faces]
    made = mi.Mesh(mesh.name, len(mesh.vertices), len(chosen), props=props)
    params = mi.traverse(made)
    params["vertex_positions"] = mesh.vertices.ravel()
    params["faces"] = chosen.ravel()
    params.update()
    return made


def group(spec: Spec, shapes: Mapping[str, Any]) -> dict[str, Any]:
    """The shapes under an accelerator, as a user writes it."""
    tree = {"tree": spec.name} if spec.is_tree else {}
    return {"type": spec.plugin, **tree, **{key: spec.settings[key] for key in spec.options}, **shapes}


def box_targets(mesh: Mesh, count: int, rng: Generator) -> np.ndarray:
    """Points of the box's faces, edges and corners, and of the mesh's triangles, edges and vertices."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    points = rng.uniform(size=(count, 3)) * (high - low) + low
    kind = rng.integers(6, size=count)
    for axis in range(3):
        pinned = (kind < 3) & (axis <= kind)
        points[:, axis] = np.where(pinned, np.where(rng.random(count) < 0.5, low[axis], high[axis]), points[:, axis])
    corners = mesh.vertices[mesh.faces[rng.integers(len(mesh.faces), size=count)]].astype(float)
    weights = rng.dirichlet((1, 1, 1), count)
    weights[kind >= 4, 2] = 0
    weights[kind == 5] = (1, 0, 0)
    weights /= weights.sum(axis=1, keepdims=True)
    on_mesh = np.einsum("ni,nij->nj", weights, corners)
    return np.where((kind < 3)[:, None], points, on_mesh).astype(np.float32)


def box_rays(mesh: Mesh, count: int, rng: Generator, sizes: float | None = None) -> Rays:
    """From within ten sizes of the mesh, or from exactly `sizes` away; some nearly parallel to axes."""
    points = box_targets(mesh, count, rng)
    away = rng.normal(size=(count, 3))
    away *= np.where(rng.random((count, 3)) < 0.25, 10 ** rng.uniform(-8, -1, (count, 3)), 1)
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    reach = 10 * rng.random((count, 1)) if sizes is None else sizes
    origins = (points + away * reach * mesh.size).astype(np.float32)
    directions = points - origins
    length = np.linalg.norm(directions, axis=1, keepdims=True)
    unit = rng.random((count, 1)) < 0.5
    directions = (directions / np.where(unit & (length > 0), length, 1)).astype(np.float32)
    directions[~directions.any(axis=1)] = (1, 0, 0)
    return origins, directions


def scene_with(mesh: Mesh, spec: Spec, robust: bool, lamps: bool) -> Any:
    """The mesh, in two parts of which one may glow, and another shape, so that Embree has to choose."""
    half = first_part("fast", mesh)
    parts = {
        "a": to_mitsuba(mesh, slice(half)),
        "b": to_mitsuba(mesh, slice(half, None), {"type": "area"} if lamps else None),
    }
    aside = {"type": "sphere", "center": (mesh.centre + 20 * mesh.size).tolist(), "radius": 1e-3 * mesh.size}
    root = {"type": "scene", "embree_use_robust_intersections": robust}
    return mitsuba().load_dict({**root, "g": group(spec, parts), "aside": aside})


def alone(mesh: Mesh, spec: Spec) -> Any:
    """Nothing but the mesh."""
    return load_dict({"type": "scene", "mesh": to_mitsuba(mesh)}, spec.text)


#: What `answers` gives.
Given = tuple[np.ndarray, np.ndarray, np.ndarray]

#: Scenes with a mesh under an accelerator, by the names that cases use.
SCENES: dict[str, Callable[[Mesh, Spec], Any]] = {
    "alone": alone,
    "fast": lambda mesh, spec: scene_with(mesh, spec, robust=False, lamps=False),
    "robust": lambda mesh, spec: scene_with(mesh, spec, robust=True, lamps=True),
}


def first_part(through: str, mesh: Mesh) -> int:
    """How many of the mesh's triangles are in the first of its parts, in one of SCENES."""
    return len(mesh.faces) if through == "alone" else len(mesh.faces) // 2


def answers(scene: Any, rays: Rays) -> Given:
    """t, triangle within its part (-1: none), and the answer of any-hit rays."""
    mi = mitsuba()
    t, triangle, any_hit = [], [], []
    for origin, direction in zip(*(part.tolist() for part in rays), strict=True):
        sent = mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), np.inf, 0.0, [])
        si = scene.ray_intersect(sent)
        t.append(si.t)
        triangle.append(si.prim_index if si.is_valid() else -1)
        any_hit.append(scene.ray_test(sent))
    return np.array(t, np.float32), np.array(triangle), np.array(any_hit)


def wrong_answers(given: Given, expected: Answers, first: int | None = None) -> np.ndarray:
    """Which rays got another t, another triangle or another answer to any-hit queries than brute force gave.

    `first`: of a mesh in two parts, how many triangles are in the first.
    """
    t, triangle, any_hit = given
    hit = found(expected)
    number = np.where(hit, expected["triangle"].astype(int), -1)
    wrong = (t.view(np.uint32) != expected["t"].view(np.uint32)) | (any_hit != hit)
    return wrong | (triangle != (number if first is None else np.where(number < first, number, number - first)))
