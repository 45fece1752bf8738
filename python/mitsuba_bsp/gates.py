"""The gates that two images of one scene must pass, each with what it found and where.

`identical` sees every bit. `paired` is for the same seed under arithmetic that rounds differently: it sees a bias of
the whole image far below the noise of a pixel, but a mean over all pixels hardly moves when a few of them are wrong.
`z_test` knows the noise: it sees what no noise explains, in a single pixel (a crack, a firefly) or in a block of 4x4 or
16x16 pixels (a missing shadow, too faint to stand out in one pixel). `finite` sees pixels that only one image lacks.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .images import BIAS_P_VALUE, DARK, compare_images

#: The probability with which `z_test` fails two images that differ by noise alone, over all of its blocks together.
ALPHA = 0.01

#: Sides of the blocks that are averaged, in pixels.
BLOCKS = (1, 4, 16)

#: Sums of float32 samples know no variance below this share of the second moment, whose square root is taken to be at
#: least DARK of the image's mean.
VARIANCE_FLOOR = 1e-6

Image = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Place:
    """A square of pixels: x to the right and y down, from 0; `side` in pixels."""

    x: int
    y: int
    side: int = 1

    def __str__(self) -> str:
        at = f"({self.x}, {self.y})"
        return f"pixel {at}" if self.side == 1 else f"the {self.side}x{self.side} block at {at}"


@dataclass(frozen=True)
class Gate:
    """What a gate found, in one sentence, and the place to look at first, if any."""

    name: str
    passed: bool
    found: str
    place: Place | None = None


def pixel_text(image: Image, x: int, y: int) -> str:
    """The colours of one pixel, in digits that tell any two float32 apart."""
    return " ".join(f"{name}={image[name][y, x]:.9g}" for name in _colours_first(image)[:4])


def identical(image: Image, reference: Image) -> Gate:
    """All channels of all pixels have the same bits."""
    differs = _differing(image, reference)
    count = int(differs.sum())
    if not count:
        return Gate("identical", True, f"all {differs.size} pixels have the same bits")
    y, x = (int(i) for i in np.argwhere(differs)[np.argmax(_gap(image, reference)[differs])])
    shown = [name for name in _colours_first(image) if _bits(image[name])[y, x] != _bits(reference[name])[y, x]][:3]
    values = ", ".join(f"{name} {image[name][y, x]:.9g} and {reference[name][y, x]:.9g}" for name in shown)
    found = f"{count} of {differs.size} pixels differ ({count / differs.size:.2%}), most at pixel ({x}, {y}): {values}"
    return Gate("identical", False, found, Place(x, y))


def finite(image: Image, reference: Image) -> Gate:
    """A pixel is NaN or infinite in both images or in neither."""
    bad, bad_reference = ~finite_pixels(image), ~finite_pixels(reference)
    only = bad != bad_reference
    if not only.any():
        both = int(bad.sum())
        said = f"{both} pixels are NaN or infinite in both images and left out" if both else "all pixels are finite"
        return Gate("finite", True, said)
    y, x = (int(i) for i in np.argwhere(only)[0])
    found = (
        f"{int((only & bad).sum())} pixels are NaN or infinite in the first image only, "
        f"{int((only & bad_reference).sum())} in the second only, one is pixel ({x}, {y}): "
        f"{pixel_text(image, x, y)} and {pixel_text(reference, x, y)}"
    )
    return Gate("finite", False, found, Place(x, y))


def paired(image: Image, reference: Image) -> Gate:
    """The mean of the signed difference is no farther from zero than 3.3 of its standard errors."""
    from scipy.stats import norm

    difference = compare_images(image, reference)
    gap = _gap(image, reference)
    y, x = (int(i) for i in np.unravel_index(np.argmax(gap), gap.shape))
    errors = float(norm.isf(difference.p_value / 2))
    limit = norm.isf(BIAS_P_VALUE / 2)
    found = (
        f"{difference.differing_pixels} of {gap.size} pixels differ, {difference.share:.2%} by more than 0.1 %, "
        f"most at pixel ({x}, {y}) by {gap[y, x]:.3g}; the mean difference {difference.mean:.3g} is "
        f"{f'{errors:.1f}' if np.isfinite(errors) else 'more than 37'} standard errors from 0 (limit {limit:.1f})"
    )
    passed = difference.verdict in ("identical", "rounding")
    if passed and errors > limit:
        found += ", but no more than rounding"
    return Gate("paired", passed, found, Place(x, y) if difference.differing_pixels else None)


@dataclass(frozen=True)
class NoisyPair:
    """The means of independent samples in two images, and the variance of one sample, which is the same in both.

    `image`, `reference` and `variance` are (height, width, channels) float64, `samples` those of a pixel in each image.
    """

    image: np.ndarray
    reference: np.ndarray
    variance: np.ndarray
    samples: tuple[int, int]


def z_scores(pair: NoisyPair, side: int) -> np.ndarray:
    """(rows, columns, channels): how many standard deviations the blocks' means are apart, with sign.

    The blocks at the right and lower edge have the pixels that are left. Pixels that are not finite in both images are
    in no block. The noise of light is skewed: a pixel that is bright once in a thousand samples is far from a normal
    distribution. So scores beyond 3 are those of the normal or of the gamma distribution with the same mean and
    variance, whichever makes the block less unusual.
    """
    planes = (pair.image, pair.reference, pair.variance)
    good = np.all([np.isfinite(plane) for plane in planes], axis=0).all(axis=2, keepdims=True)
    first, second, variance = (np.where(good, plane, 0.0) for plane in planes)
    count, count_reference = pair.samples
    mean = (count * first + count_reference * second) / (count + count_reference)
    level = np.abs(second).mean(axis=(0, 1), where=good) if good.any() else np.zeros(second.shape[2])
    least = VARIANCE_FLOOR * np.maximum(np.square(mean) + variance, np.square(DARK * level))
    total = _block_sums(np.where(good, np.maximum(variance, least), 0.0), side)
    light = _block_sums(first, side), _block_sums(second, side)
    gap = light[0] - light[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        scores = np.where(gap == 0.0, 0.0, gap / np.sqrt(total * (1 / count + 1 / count_reference)))
    floor = np.broadcast_to(VARIANCE_FLOOR * DARK * level, scores.shape)
    far = (np.abs(scores) > 3) & (light[0] >= 0) & (light[1] >= 0)
    skewed = _gamma_scores(
        *(values[far] for values in (*light, _block_sums(mean, side), total, floor)), samples=pair.samples
    )
    scores[far] = np.where(np.abs(skewed) < np.abs(scores[far]), skewed, scores[far])
    return scores


def _gamma_scores(
    first: np.ndarray,
    second: np.ndarray,
    mean: np.ndarray,
    variance: np.ndarray,
    floor: np.ndarray,
    samples: tuple[int, int],
) -> np.ndarray:
    """The z-scores if samples have a gamma distribution: the share of the first image in all light has a beta one.

    Sums over blocks; none is negative, and all are taken to be `floor` at least.
    """
    from scipy.special import betainc, betaincc
    from scipy.stats import norm

    with np.errstate(divide="ignore", invalid="ignore"):
        shape = np.square(np.maximum(mean, floor)) / variance
        light = [count * np.maximum(total, floor) for count, total in zip(samples, (first, second), strict=True)]
        share = light[0] / (light[0] + light[1])
    below = betainc(samples[0] * shape, samples[1] * shape, share)
    above = betaincc(samples[0] * shape, samples[1] * shape, share)
    return np.where(above < below, norm.isf(above), norm.ppf(below))


def z_test(pair: NoisyPair, alpha: float = ALPHA) -> Gate:
    """No block of any size differs by more than noise, with probability `alpha` of failing on noise alone.

    The limit for one block is that of Sidak for all blocks of all sizes and channels.
    """
    from scipy.stats import norm

    scores = {side: z_scores(pair, side) for side in BLOCKS}
    tests = sum(score.size for score in scores.values())
    limit = float(norm.isf(-math.expm1(math.log1p(-alpha) / tests) / 2))
    sizes = []
    for side, score in scores.items():
        failed = int((np.abs(score) > limit).any(axis=2).sum())
        kind = "pixels" if side == 1 else f"{side}x{side} blocks"
        sizes.append(f"{failed} of {score.shape[0] * score.shape[1]} {kind}")
    side = max(scores, key=lambda s: float(np.abs(scores[s]).max()))
    row, column, channel = (int(i) for i in np.unravel_index(np.argmax(np.abs(scores[side])), scores[side].shape))
    worst, place = float(scores[side][row, column, channel]), Place(column * side, row * side, side)
    found = (
        f"too far apart for noise are {', '.join(sizes)}; the worst is {place} with z = {worst:.1f} (limit {limit:.1f})"
    )
    return Gate("z", abs(worst) <= limit, found, place)


def finite_pixels(image: Image) -> np.ndarray:
    """Which pixels are finite in all channels, (height, width)."""
    return np.all([np.isfinite(plane) for plane in image.values()], axis=0)


def _differing(image: Image, reference: Image) -> np.ndarray:
    return np.any([_bits(image[name]) != _bits(reference[name]) for name in image], axis=0)


def _bits(plane: np.ndarray) -> np.ndarray:
    plane = np.ascontiguousarray(plane)
    return plane.view(np.uint64 if plane.itemsize == 8 else np.uint32)


def _gap(image: Image, reference: Image) -> np.ndarray:
    """The largest absolute difference of any channel, infinite where one is not finite and the other one differs."""
    largest = np.zeros(next(iter(image.values())).shape)
    for name, plane in image.items():
        with np.errstate(invalid="ignore", over="ignore"):
            gap = np.abs(plane.astype(np.float64) - reference[name])
        lost = ~np.isfinite(gap)
        gap[lost] = np.where(_bits(plane) == _bits(reference[name]), 0.0, np.inf)[lost]
        largest = np.maximum(largest, gap)
    return largest


def _block_sums(values: np.ndarray, side: int) -> np.ndarray:
    rows = np.add.reduceat(values, np.arange(0, values.shape[0], side), axis=0)
    return np.add.reduceat(rows, np.arange(0, values.shape[1], side), axis=1)


def _colours_first(image: Image) -> list[str]:
    usual = [name for name in ("R", "G", "B", "Y", "A") if name in image]
    return usual + sorted(set(image) - set(usual))
