"""Pictures inside a page: renderings without loss, each once however many accelerators made it, and figures."""

from __future__ import annotations

import base64
import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..exr import read_exr
from ..flip import rgb
from ..outcomes import Outcome
from ..records import machine_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Longer side of the pictures in a page, pixels; larger renderings are made smaller by whole factors.
LARGEST = 640


@dataclass(frozen=True)
class Renderings:
    """The images of one scene: `files` are their data by name, `specs` says whose image is which of them."""

    scene: str
    files: Mapping[str, str]
    specs: Mapping[str, str]


@dataclass(frozen=True)
class Picture:
    """One of the images of a page, by its name, and what it shows."""

    name: str
    about: str


def renderings(outcome: Outcome) -> list[Renderings]:
    """Those of a comparison, made on its machine, whose image files are still there."""
    if outcome.command != "compare":
        return []
    found = []
    counted = outcome.folder.counted()
    for scene in outcome.scenes:
        files: dict[str, str] = {}
        specs: dict[str, str] = {}
        for spec in outcome.options.specs:
            row = counted.get((scene.name, spec.text))
            if row is None or machine_of(row) != outcome.machine:
                continue
            data = picture(outcome.folder.path / str(row["image"]))
            name = f"{scene.name}-{hashlib.sha256(data.encode()).hexdigest()[:12]}"
            files[name] = data
            specs[spec.text] = name
        if specs:
            found.append(Renderings(scene.name, files, specs))
    return found


def picture(file: Path) -> str:
    """An EXR image as sRGB, as a data URI without loss. ValueError for a file that is no image."""
    from PIL import Image

    pixels = rgb(read_exr(file))
    step = -(-max(pixels.shape[:2]) // LARGEST)
    height, width = (side // step * step for side in pixels.shape[:2])
    small = pixels[:height, :width].reshape(height // step, step, width // step, step, 3).mean(axis=(1, 3))
    clipped = np.clip(np.nan_to_num(small), 0, 1)
    encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    out = io.BytesIO()
    Image.fromarray(np.round(255 * encoded).astype(np.uint8)).save(out, "WEBP", lossless=True)
    return _uri(out.getvalue(), "image/webp")


def figure_picture(figure: Figure) -> str:
    """A figure as a data URI."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=110, metadata={"Software": None})
    return _uri(out.getvalue(), "image/png")


def _uri(data: bytes, kind: str) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
