"""OpenEXR files of rendered images: lossless 32-bit floats, with what made them in the header."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import OpenEXR

_COLOURS = {0: (), 1: ("Y",), 2: ("Y", "A"), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}


def channels(pixels: np.ndarray, extra: Sequence[str]) -> dict[str, np.ndarray]:
    """Every channel of `pixels` (height, width, channels) by name, each (height, width) float32.

    The last channels are called `extra`, as the integrator says; but of colours that its inner integrators make it
    says always R, G, B, A, also if the film has only some of these.
    """
    colours = pixels.shape[2] - len(extra)
    if colours < 0:
        colours, extra = 0, _inner_colours(extra, -colours)
    names = [*_COLOURS.get(colours, [f"C{index}" for index in range(colours)]), *extra]
    return {name: np.ascontiguousarray(pixels[..., i], np.float32) for i, name in enumerate(names)}


def _inner_colours(names: Sequence[str], missing: int) -> list[str]:
    """The names of channels, of which so many are missing: each inner integrator lacks equally many of R, G, B, A."""
    inner = [name.removesuffix(".A") for name in names if name.endswith(".A")]
    kept = _COLOURS[4 - missing // len(inner)]
    found = []
    for name in names:
        owner, _, channel = name.rpartition(".")
        if owner not in inner or channel not in _COLOURS[4]:
            found.append(name)
        elif channel == "R":
            found += [f"{owner}.{colour}" for colour in kept]
    return found


def write_exr(path: Path, pixels: np.ndarray, extra: Sequence[str], header: Mapping[str, str]) -> None:
    """Write `pixels` (height, width, channels) as float32; the last channels are called `extra`.

    `header` becomes string attributes of the file. The file appears whole or not at all.
    """
    write_channels(path, channels(pixels, extra), header)


def write_channels(path: Path, planes: Mapping[str, np.ndarray], header: Mapping[str, str]) -> None:
    """The same for channels (height, width) float32 by name; several processes may write the same file."""
    attributes = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    unfinished = path.with_name(f".{os.getpid()}-{path.name}")
    with OpenEXR.File(attributes, dict(planes)) as file:
        file.write(str(unfinished))
    unfinished.replace(path)


def read_exr(path: Path) -> dict[str, np.ndarray]:
    """Every channel of a file by name, each (height, width) float32, or float64 of integers, which are kept so.

    ValueError if the file has several parts.
    """
    with OpenEXR.File(str(path), separate_channels=True) as file:
        if len(file.parts) != 1:
            raise ValueError(f"it has {len(file.parts)} parts, and only a file of one part is one image")
        return {name: _plane(channel.pixels) for name, channel in file.channels().items()}


def _plane(pixels: np.ndarray) -> np.ndarray:
    return np.array(pixels, np.float64 if pixels.dtype == np.uint32 else np.float32)


def read_header(path: Path) -> dict[str, str]:
    """The string attributes of a file."""
    with OpenEXR.File(str(path)) as file:
        return {key: value for key, value in file.header().items() if isinstance(value, str)}


def read_corner(path: Path) -> str:
    """Where the upper left pixel of a file lies, as text."""
    with OpenEXR.File(str(path)) as file:
        x, y = file.header()["dataWindow"][0]
    return f"({x}, {y})"
