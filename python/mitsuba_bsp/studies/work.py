"""What the rays of a recorded frame cost under one accelerator: counters by kind of ray, and the cost of every pixel.

The cost of a ray is the price of its work: steps, visits of leaves and triangle tests at the prices measured for the
tree's layout, in units of one axis-aligned plane. Mitsuba's kd-tree is priced as one with binary nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..contenders import COUNTERS, build, triangles_of
from ..jobs import Job
from ..loading import open_file
from ..prices import PLANES_PER_STEP, plane_prices
from ..spec import Spec, parse_spec
from ..streams import Stream, in_use, load, recorded_resolution

#: Radians: a normal nearer to an axis than this lies on it.
ON_AXIS = np.radians(1)

#: Shares of the pixels whose costs are recorded, from the cheapest pixel to the dearest.
SHARES = np.linspace(0, 1, 101)


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Count `job.streams` under `job.spec`; the cost of every pixel goes into `job.arrays` if `keep_pixels` is chosen.

    `pixels` are of the camera rays alone (`camera`) and of whole paths (`path`), per sample.
    """
    spec = parse_spec(job.spec)
    streams = list(in_use(load(Path(job.streams))))
    stage(f"loading {job.scene}")
    triangles = triangles_of(open_file(job.scene, params=job.params).meshes)
    stage(f"building {job.spec} for {job.scene}")
    contender = build(spec, triangles)
    stage(f"counting the rays of {job.scene}")
    found = {stream.kind: contender.tree.count(*stream.arrays, stream.any_hit) for stream in streams}
    costs = pixel_costs(spec, streams, found, recorded_resolution(Path(job.streams)))
    if job.choices.get("keep_pixels"):
        save_arrays(Path(job.arrays), costs)
    return {
        "counters": {
            stream.kind: {"rays": len(stream), **{key: int(found[stream.kind][key].sum()) for key in COUNTERS}}
            for stream in streams
        },
        "pixels": {name: _spread(values) for name, values in costs.items()},
        "statistics": contender.statistics(),
        "tree_sha256": contender.sha256(),
        "axis_area_share": axis_area_share(*triangles.merged()),
    }


def pixel_costs(
    spec: Spec,
    streams: Sequence[Stream],
    found: Mapping[str, Mapping[str, NDArray[np.uint64]]],
    resolution: tuple[int, int],
) -> dict[str, NDArray[np.float32]]:
    """The mean cost of a sample of every pixel, (height, width): of its camera rays, and of all rays of its paths.

    ValueError unless the streams are complete.
    """
    for stream in streams:
        if len(stream) < stream.total:
            raise ValueError(f"of {stream.total:,} {stream.kind} rays only {len(stream):,} are known")
    camera = [stream for stream in streams if stream.kind == "camera"]
    if not camera or min(int(stream.pixels.min()) for stream in streams) < 0:
        raise ValueError("the rays of the camera were not recognised, so no pixel has a cost")
    width, height = resolution
    samples = np.maximum(1, np.bincount(camera[0].pixels, minlength=width * height))

    def total(chosen: Sequence[Stream]) -> NDArray[np.float32]:
        sums = [np.bincount(s.pixels, weights=_cost(spec, found[s.kind]), minlength=width * height) for s in chosen]
        return (np.sum(sums, axis=0) / samples).reshape(height, width).astype(np.float32)

    return {"camera": total(camera), "path": total(streams)}


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


def _cost(spec: Spec, counted: Mapping[str, NDArray[np.uint64]]) -> NDArray[np.float64]:
    """Of every ray, in axis-aligned planes."""
    layout = str(spec.settings.get("layout", "binary"))
    prices = parse_spec(f"random:layout={layout}").settings  # any tree with oblique planes
    axis_plane, oblique_plane = plane_prices(prices)
    weights = {
        "axis_steps": PLANES_PER_STEP[layout] * axis_plane,
        "oblique_steps": PLANES_PER_STEP[layout] * oblique_plane,
        "leaves_visited": float(prices["leaf_cost"]),
        "triangle_tests": float(prices["intersection_cost"]),
    }
    return sum(weight * counted[name] for name, weight in weights.items()) / axis_plane


def _spread(costs: NDArray[np.float32]) -> dict[str, Any]:
    return {
        "mean": float(costs.mean()),
        "deviation": float(costs.std()),
        "quantiles": [float(f"{value:.6g}") for value in np.quantile(costs, SHARES)],
    }


def save_arrays(path: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Write an .npz file, all or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".partial.npz")
    np.savez_compressed(unfinished, **arrays)
    unfinished.replace(path)
