"""How noisy the pixels of an image are: the variance of one sample, as Mitsuba's integrator `moment` leaves it.

Around an integrator called NAME, `moment` adds to the image the channels NAME.X, NAME.Y, NAME.Z (means, in XYZ) and
m2_NAME.X, m2_NAME.Y, m2_NAME.Z (means of the squares). The variance of one sample is the second minus the square of the
first, times n/(n - 1) for n samples; the variance of a pixel of n samples is an n-th of it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .messages import choices

Image = Mapping[str, np.ndarray]

#: Linear sRGB to XYZ (ITU-R BT.709 primaries, white D65), the matrix of Mitsuba's own conversion.
_RGB_TO_XYZ = np.array([[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]])

_SPACES = (("X", "Y", "Z"), ("R", "G", "B"), ("Y",))
_SECOND = re.compile(r"m2_(.+)\.[XYZ]")

#: From fewer samples a variance is not known: most pixels miss what is rare and bright, and seem to have little noise.
LEAST_SAMPLES = 16

#: Channels that stored references have besides their colours.
MEAN, VARIANCE = "mean", "variance"


@dataclass(frozen=True)
class Variance:
    """The variance of one sample of every pixel, (height, width, channels) float64, in the colour space `space`.

    `samples` is how many it was estimated from, None if that is unknown.
    """

    space: tuple[str, ...]
    values: np.ndarray
    samples: int | None

    @property
    def pixels(self) -> tuple[int, int]:
        """Height and width."""
        return self.values.shape[0], self.values.shape[1]


def rendered_channels(image: Image) -> dict[str, np.ndarray]:
    """The channels of `image` that are no statistics of its noise."""
    groups = {MEAN, VARIANCE, *_measured(image)}
    return {c: plane for c, plane in image.items() if not _second_of(c) and c.rpartition(".")[0] not in groups}


def flaw(variance: Variance, finite: np.ndarray) -> str:
    """Why it tells no noise, "" if it does; `finite` (height, width): where both images are."""
    if variance.samples is not None and variance.samples < LEAST_SAMPLES:
        return f"it comes from {variance.samples} samples of each pixel, and {LEAST_SAMPLES} are the least"
    lost = finite & ~np.isfinite(variance.values).all(axis=2)
    if not lost.any():
        return ""
    y, x = (int(i) for i in np.argwhere(lost)[0])
    return f"it is NaN or infinite in {int(lost.sum())} pixels where both images are finite, one is ({x}, {y})"


def own_variance(image: Image, samples: int | None) -> Variance | None:
    """What an image says about its noise; None if it says nothing.

    ValueError if several integrators are nested in its `moment`. What one of them adds besides colours does not count.
    """
    stored = _group(image, f"{VARIANCE}.")
    if stored is not None:
        return Variance(*stored, samples)
    names = [name for name in _measured(image) if all(f"{p}{name}.{c}" in image for p in ("", "m2_") for c in "XYZ")]
    if len(names) > 1:
        raise ValueError(f"it has the moments of several integrators ({choices(names)}), of which only one can be used")
    if not names:
        return None
    (space, mean), (_, second) = _group(image, f"{names[0]}."), _group(image, f"m2_{names[0]}.")
    with np.errstate(invalid="ignore"):
        values = np.maximum(second - np.square(mean), 0.0)
    return Variance(space, values * (samples / (samples - 1) if samples and samples > 1 else 1.0), samples)


def variance_image(image: Image, samples: int | None) -> Variance:
    """The content of a file given as a variance: one made by `moment`, or plain channels X Y Z, R G B, or Y.

    ValueError if it is neither.
    """
    found = own_variance(image, samples)
    if found is None:
        plain = _group(image, "")
        if plain is None:
            raise ValueError(
                f"it has the channels {choices(sorted(image))}, but a variance needs NAME.X and m2_NAME.X as made by "
                "the integrator moment (and likewise Y, Z), or else X Y Z, R G B or Y alone"
            )
        found = Variance(*plain, samples)
    if (found.values < 0).any():
        raise ValueError("it has negative values, so it is no variance")
    return found


def pooled(one: Variance, other: Variance) -> Variance:
    """The estimate from the samples of two images of the same scene."""
    if one.space != other.space or not one.samples or not other.samples:
        raise ValueError("the two variances are in different colour spaces or of an unknown number of samples")
    samples = one.samples + other.samples
    values = (one.samples * one.values + other.samples * other.values) / samples
    return Variance(one.space, values, samples)


def colours_in(image: Image, space: tuple[str, ...]) -> np.ndarray:
    """The colours of an image in a variance's colour space, (height, width, channels) float64.

    Of a grey image (only Y) there is but that channel. ValueError if it cannot be converted.
    """
    if all(name in image for name in space):
        return _stack(image, space)
    if space == ("X", "Y", "Z") and all(name in image for name in "RGB"):
        with np.errstate(invalid="ignore"):
            return _stack(image, ("R", "G", "B")) @ _RGB_TO_XYZ.T
    if space == ("X", "Y", "Z") and "Y" in image:
        return _stack(image, ("Y",))
    raise ValueError(f"the variance is that of {' '.join(space)}, but the images have {choices(sorted(image))}")


def variance_for(image: Image, variance: Variance) -> np.ndarray:
    """The variance of the channels that `colours_in` gives."""
    if variance.space == ("X", "Y", "Z") and "Y" in image and "X" not in image:
        return variance.values[..., 1:2]
    return variance.values


def _measured(image: Image) -> list[str]:
    """The integrators of which there are moments; not what they add besides colours, as NAME.normals.X."""
    names = sorted({name for channel in image if (name := _second_of(channel))})
    return [name for name in names if not any(name.startswith(f"{other}.") for other in names)]


def _second_of(channel: str) -> str | None:
    """NAME, if a channel is m2_NAME.X or the like."""
    found = _SECOND.fullmatch(channel)
    return found[1] if found else None


def _group(image: Image, prefix: str) -> tuple[tuple[str, ...], np.ndarray] | None:
    """The first colour space of which `image` has all channels behind a prefix, with their values."""
    for space in _SPACES:
        if all(prefix + name in image for name in space):
            return space, _stack(image, [prefix + name for name in space])
    return None


def _stack(image: Image, names: tuple[str, ...] | list[str]) -> np.ndarray:
    return np.stack([np.asarray(image[name], np.float64) for name in names], axis=2)
