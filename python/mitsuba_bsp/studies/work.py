"""What the rays of a frame cost under one accelerator: counters by kind of ray, and the cost of every pixel.

The scene's integrator is rendered inside our own `raycost`, with the box filter, so that a pixel has the mean of its
samples. The cost of a ray is the price of its work: steps, visits of leaves and triangle tests at the prices measured
for the tree's layout, in units of one axis-aligned plane. Mitsuba's kd-tree is priced as one with binary nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..contenders import COUNTERS, triangles_of
from ..exr import channels
from ..jobs import Job
from ..prices import PLANES_PER_STEP, plane_prices
from ..rendering import construct, load, provenance, render, samples, write_image
from ..spec import Spec, parse_spec
from ..tree_statistics import statistics

#: Radians: a normal nearer to an axis than this lies on it.
ON_AXIS = np.radians(1)

#: Shares of the pixels whose costs are recorded, from the cheapest pixel to the dearest.
SHARES = np.linspace(0, 1, 101)

#: The rays that a pixel's work is added up over.
PIXELS = {"camera": "camera rays", "path": "whole paths"}

#: What is told of a pixel, and its unit.
QUANTITIES = {"cost": "planes", "steps": "steps", "leaves": "leaves", "tests": "triangle tests"}

#: Counters by ray (camera, shadow, path), each (height, width), the mean of a pixel's samples.
Counted = Mapping[str, Mapping[str, NDArray[np.float32]]]


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Render the scene under `job.spec` and count; all of it goes into `job.image`, if that is the name of a file.

    `pixels` are the spread of each of QUANTITIES over the pixels, of each of PIXELS, per sample.
    """
    spec = parse_spec(job.spec)
    loaded = load(job, stage, box=True, costs=True)
    scene, _ = construct(job, loaded, stage)
    frame = render(job, scene, stage, samples(job, scene))
    counted = read_counters(channels(frame.pixels, scene.integrator().aov_names()))
    if job.image:
        write_image(Path(job.image), frame.pixels, scene.integrator().aov_names(), provenance(job, scene))
    quantities = pixel_quantities(spec, counted)
    return {
        "counters": ray_counters(counted, scene.sensors()[0].sampler().sample_count()),
        "pixels": {name: {of: _spread(values) for of, values in own.items()} for name, own in quantities.items()},
        "statistics": own_statistics(scene) if spec.is_tree else {},
        "axis_area_share": axis_area_share(*triangles_of(loaded.meshes).merged()),
    }


def read_counters(planes: Mapping[str, NDArray[np.float32]]) -> Counted:
    """The counters among the channels of an image; KeyError if it was not made by `raycost`."""
    rays = ("camera", "shadow", "path")
    return {of: {name: planes[f"{of}.{name}"] for name in ("rays", *COUNTERS)} for of in rays}


def ray_counters(counted: Counted, spp: int) -> dict[str, dict[str, int]]:
    """The sums over an image of `spp` samples a pixel, by kind: camera, shadow and bounce rays.

    What belongs to none of the first two is bounce rays'. A path through a medium may ask for less than its camera ray
    alone would, then these are none.
    """

    def total(of: str, name: str) -> int:
        return int(np.rint(counted[of][name].astype(np.float64) * spp).sum())

    found = {of: {name: total(of, name) for name in counted[of]} for of in counted}
    camera, shadow, path = found["camera"], found["shadow"], found["path"]
    bounce = {name: max(0, path[name] - camera[name] - shadow[name]) for name in path}
    return {"camera": camera, "shadow": shadow, "bounce": bounce}


def pixel_quantities(spec: Spec, counted: Counted) -> dict[str, dict[str, NDArray[np.float32]]]:
    """Each of QUANTITIES of each of PIXELS, (height, width), per sample."""
    weights = {
        "cost": _prices(spec),
        "steps": {"axis_steps": 1, "oblique_steps": 1},
        "leaves": {"leaves_visited": 1},
        "tests": {"triangle_tests": 1},
    }
    return {
        quantity: {of: _weighted(counted[of], weights[quantity]).astype(np.float32) for of in PIXELS}
        for quantity in QUANTITIES
    }


def own_statistics(scene: mi.Scene) -> dict[str, Any]:
    """Those of the scene's own tree, whatever its shape groups have; empty if it has none."""
    found = statistics(scene)
    trees = found.get("trees", [found])
    return next((tree for tree in trees if not tree.get("shape_group")), {})


def axis_area_share(vertices: NDArray[np.float32], faces: NDArray[np.uint32]) -> float:
    """The share of the triangles' area whose normals lie on an axis, give or take a degree."""
    normals, areas = normals_and_areas(vertices[faces])
    on_axis = np.abs(normals).max(axis=1, initial=0) >= np.cos(ON_AXIS)
    return float(areas[on_axis].sum() / areas.sum()) if areas.any() else 0.0


def normals_and_areas(corners: NDArray[np.floating]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit normals (n, 3), zero where a triangle has no area, and areas (n,) of triangles (n, 3, 3)."""
    a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    return cross / np.maximum(length, np.finfo(float).tiny)[:, None], length / 2


def _prices(spec: Spec) -> dict[str, float]:
    """Of a unit of each counter, in axis-aligned planes."""
    layout = str(spec.settings.get("layout", "binary"))
    prices = parse_spec(f"random:layout={layout}").settings  # any tree with oblique planes
    axis_plane, oblique_plane = plane_prices(prices)
    weights = {
        "axis_steps": PLANES_PER_STEP[layout] * axis_plane,
        "oblique_steps": PLANES_PER_STEP[layout] * oblique_plane,
        "leaves_visited": float(prices["leaf_cost"]),
        "triangle_tests": float(prices["intersection_cost"]),
    }
    return {name: weight / axis_plane for name, weight in weights.items()}


def _weighted(planes: Mapping[str, NDArray[np.float32]], weights: Mapping[str, float]) -> NDArray[np.float64]:
    return np.sum([weight * planes[name].astype(np.float64) for name, weight in weights.items()], axis=0)


def _spread(values: NDArray[np.float32]) -> dict[str, Any]:
    return {
        "mean": float(values.mean(dtype=np.float64)),
        "deviation": float(values.std(dtype=np.float64)),
        "quantiles": [float(f"{value:.6g}") for value in np.quantile(values, SHARES)],
    }


def save_arrays(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Write an .npz file, all or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".partial.npz")
    np.savez_compressed(unfinished, **arrays)
    unfinished.replace(path)
