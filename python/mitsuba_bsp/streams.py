"""Streams of real rays: those that one rendered frame asked a tree about, sorted by kind, hashed, kept in a file.

A camera ray is a closest-hit query that starts on the sensor's near plane, behind its lens; any-hit queries are shadow
rays; all other queries are bounce rays, also those that start at a sensor without a near plane. They stay in the order
in which the renderer asked.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

KINDS = ("camera", "shadow", "bounce")

#: A ray and its answer as the plugin `bsptree` writes them.
RECORDED = np.dtype(
    [("o", "<f4", 3), ("d", "<f4", 3), ("maxt", "<f4"), ("any_hit", "<u4"), ("t", "<f4"), ("uv", "<f4", 2),
     ("triangle", "<u4")]
)  # fmt: skip

#: What a file has of each stream.
_PARTS = ("origins", "directions", "maxt", "total")

#: The seed of the choice of rays where there are too many.
SAMPLE_SEED = 0

#: Rounding that may part a camera ray's origin from where the sensor put it, relative to the coordinates.
_TOLERANCE = 2.0**-18


@dataclass(frozen=True)
class Stream:
    """Rays of one kind, float32 (n, 3), (n, 3), (n,); `total` were recorded, of which these are a sample."""

    kind: str
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    maxt: NDArray[np.float32]
    total: int

    @property
    def any_hit(self) -> bool:
        """Whether these rays ask for any hit instead of the closest."""
        return self.kind == "shadow"

    @property
    def arrays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """The rays as the extensions take them."""
        return self.origins, self.directions, self.maxt

    def __len__(self) -> int:
        return len(self.maxt)

    def sha256(self) -> str:
        """Of all bytes of all rays."""
        digest = hashlib.sha256()
        for array in self.arrays:
            digest.update(array)
        return digest.hexdigest()


def check_recording(path: Path, expected: int) -> None:
    """OSError unless a `bsptree` could write as many rays to its file as it counted."""
    written = path.stat().st_size // RECORDED.itemsize
    if written != expected:
        raise OSError(f"of {expected:,} rays only {written:,} could be written to {path}: the disk may be full")


def read_recording(path: Path) -> NDArray[np.void]:
    """The rays that a `bsptree` wrote."""
    return np.fromfile(path, RECORDED)


def split(rays: NDArray[np.void], sensor: mi.Sensor, max_rays: int) -> list[Stream]:
    """The recorded rays by kind; of more than `max_rays` of a kind a random sample, always the same."""
    shadow = rays["any_hit"] != 0
    camera = ~shadow & from_sensor(rays["o"], rays["d"], sensor)
    return [
        _sample(kind, rays[chosen], max_rays)
        for kind, chosen in zip(KINDS, (camera, shadow, ~shadow & ~camera), strict=True)
    ]


def can_tell_camera_rays(sensor: mi.Sensor) -> bool:
    """Whether its rays start on a near plane, as those of all sensors do that project a picture."""
    return "near_clip" in mi.traverse(sensor)


def from_sensor(origins: NDArray[np.float32], directions: NDArray[np.float32], sensor: mi.Sensor) -> NDArray[np.bool_]:
    """Which rays start on the near plane of `sensor`, and come through its lens if it has one; none without a plane."""
    if not can_tell_camera_rays(sensor):
        return np.zeros(len(origins), bool)
    params = mi.traverse(sensor)
    near = float(params["near_clip"])
    lens = float(params["aperture_radius"]) if "aperture_radius" in params else 0.0
    to_world = np.array(sensor.world_transform().matrix, np.float64)
    to_local = np.linalg.inv(to_world)
    o = origins @ to_local[:3, :3].T + to_local[:3, 3]
    d = directions @ to_local[:3, :3].T
    tolerance = _TOLERANCE * (np.abs(to_world[:3, 3]).max() + near + lens) * np.abs(to_local[:3, :3]).max()
    on_plane = np.abs(o[:, 2] - near) <= tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        at_lens = o[:, :2] - d[:, :2] * (o[:, 2] / d[:, 2])[:, None]
    if "orthographic" in sensor.class_name().lower():
        return on_plane & (np.abs(d[:, :2]).max(axis=1) <= _TOLERANCE)
    return on_plane & (np.hypot(*at_lens.T) <= lens + 4 * tolerance)


def save(path: Path, streams: list[Stream], origin: Mapping[str, Any]) -> None:
    """Write streams to an .npz file, all or nothing; `origin` says how they were made."""
    arrays: dict[str, NDArray[Any]] = {"origin": np.array(json.dumps({**origin, "sha256": _digests(streams)}))}
    for stream in streams:
        arrays |= {f"{stream.kind}_{part}": np.asarray(getattr(stream, part)) for part in _PARTS}
    partial = path.with_suffix(".partial.npz")
    np.savez_compressed(partial, **arrays)
    partial.replace(path)


def load(path: Path) -> list[Stream]:
    """The streams in a file; ValueError if they are not what was written."""
    with np.load(path) as arrays:
        streams = [
            Stream(kind, *(arrays[f"{kind}_{part}"] for part in _PARTS[:-1]), int(arrays[f"{kind}_{_PARTS[-1]}"]))
            for kind in KINDS
        ]
        if json.loads(str(arrays["origin"]))["sha256"] != _digests(streams):
            raise ValueError(f"the rays in {path} are not those that were recorded: delete the file")
    return streams


def is_recorded(path: Path, origin: Mapping[str, Any]) -> bool:
    """Whether the file holds streams made exactly so."""
    if not path.is_file():
        return False
    with np.load(path) as arrays:
        found = json.loads(str(arrays["origin"]))
    return {key: found.get(key) for key in origin} == json.loads(json.dumps(origin))


def _digests(streams: list[Stream]) -> dict[str, str]:
    return {stream.kind: stream.sha256() for stream in streams}


def _sample(kind: str, rays: NDArray[np.void], max_rays: int) -> Stream:
    total = len(rays)
    if total > max_rays:
        chosen = np.sort(np.random.default_rng(SAMPLE_SEED).choice(total, max_rays, replace=False, shuffle=False))
        rays = rays[chosen]
    return Stream(kind, *map(np.ascontiguousarray, (rays["o"], rays["d"], rays["maxt"])), total)


def in_use(streams: list[Stream]) -> Iterator[Stream]:
    """Those that have rays."""
    return (stream for stream in streams if len(stream))
