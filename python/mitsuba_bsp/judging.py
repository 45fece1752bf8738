"""Judge two image files: may they be compared, by which gates, and do they pass?

The rule: pixels with the same bits are the same image. Otherwise
- same seed and samples, both of them our trees in a mode that promises answers, one triangle test, box filter, same
  Mitsuba: nothing but the same bits will do;
- same seed and samples, else: `paired`, and `z` too if the noise is known;
- other or unknown seeds: `z`, if the noise is known. If it is not, images known to have different seeds cannot be
  judged, and of all others the same bits are demanded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .exr import read_corner, read_exr, read_header
from .gates import Gate, Image, NoisyPair, finite, finite_pixels, identical, paired, z_test
from .messages import choices, one_sentence
from .noise import Variance, colours_in, flaw, own_variance, pooled, rendered_channels, variance_for, variance_image
from .spec import parse_spec

#: What may be asked of two images; `auto` is the rule above.
GATES = ("auto", "identical", "paired", "z")

#: Header entries that two images must share, if both have them.
_SHARED = ("scene", "scene_hash", "variant", "corner")

Header = Mapping[str, str]


class NotComparableError(ValueError):
    """Two images that no gate can judge; the text is one sentence."""


@dataclass(frozen=True)
class Rendering:
    """An image with what its file says about it; `name` is for messages.

    `image` has the rendered channels; `samples` per pixel and `variance` of one of them are None if unknown.
    """

    name: str
    image: Image
    header: Header = field(default_factory=dict)
    samples: int | None = None
    variance: Variance | None = None


@dataclass(frozen=True)
class Judgement:
    """The gates that were applied, why these, and what would have allowed more, if anything.

    `noise` is None if it is unknown.
    """

    gates: tuple[Gate, ...]
    why: str
    hint: str = ""
    noise: NoisyPair | None = None

    @property
    def same(self) -> bool:
        """Whether all gates were passed."""
        return all(gate.passed for gate in self.gates)

    @property
    def lines(self) -> list[str]:
        """Which gates there were and why, and a line for each."""
        names = ", ".join(gate.name for gate in self.gates)
        found = [f"{gate.name:9} {'passed' if gate.passed else 'FAILED'}  {gate.found}" for gate in self.gates]
        return [f"gates: {names} ({self.why})", *found]

    @property
    def failed(self) -> list[Gate]:
        """The gates that were not passed, the one that decides first."""
        return [gate for gate in self.gates if not gate.passed]


def read_rendering(path: Path, samples: int | None = None) -> Rendering:
    """An EXR file; `samples` overrides what its header says. NotComparableError if it cannot be read."""
    channels, header = _read(path)
    samples = samples or _number(header, "spp")
    try:
        variance = own_variance(channels, _number(header, "variance_samples") or samples)
    except ValueError as error:
        raise NotComparableError(f"{path} tells no variance: {error}") from None
    image = rendered_channels(channels)
    if not image:
        raise NotComparableError(f"{path} has no rendered channels, only {choices(sorted(channels))}")
    return Rendering(str(path), image, header, samples, variance)


def read_variance(path: Path) -> Variance:
    """A file given as variance. NotComparableError if it is none."""
    channels, header = _read(path)
    try:
        return variance_image(channels, _number(header, "variance_samples") or _number(header, "spp"))
    except ValueError as error:
        raise NotComparableError(f"{path} is no variance image: {error}") from None


def judge(
    one: Rendering, other: Rendering, gate: str = "auto", variance: Variance | None = None, same_seed: bool = False
) -> Judgement:
    """Apply the gates. `variance` (of one sample) overrides what the images say; `same_seed`: they have it for sure.

    NotComparableError, in one sentence, if the images are not of one kind or the gate asked for cannot judge them.
    """
    check_comparable(one, other)
    noise, missing = _noise(one, other, variance)
    bits = identical(one.image, other.image)
    bounds = finite(one.image, other.image)
    if bits.passed or gate == "identical":
        said = () if finite_pixels(one.image).all() else (bounds,)
        return Judgement((bits, *said), "every bit is compared", noise=noise)
    same_paths = same_seed or _same_paths(one, other)
    if gate == "auto" and same_paths and same_arithmetic(one.header, other.header):
        return Judgement((bits,), "the same seed under our trees, which promise the same bits", noise=noise)
    if gate == "paired" or (gate == "auto" and same_paths):
        why = "the same paths, rounded differently" if same_paths else "as asked"
        gates = (bounds, paired(one.image, other.image))
        if gate == "auto" and noise is not None:
            return Judgement((*gates, z_test(noise)), f"{why}, and the noise is known", noise=noise)
        hint = "the mean difference says nothing about a few wrong pixels"
        hint += f"; to judge them too, {missing}" if noise is None else "; --gate z judges them too"
        return Judgement(gates, why, hint, noise)
    if noise is not None:
        return Judgement((bounds, z_test(noise)), "the noise is known", noise=noise)
    if gate == "z":
        raise NotComparableError(f"the z gate has to know the noise of both images: {missing}")
    seeds = one.header.get("seed"), other.header.get("seed")
    if None not in seeds and seeds[0] != seeds[1]:
        raise NotComparableError(
            f"{one.name} has seed {seeds[0]} and {other.name} seed {seeds[1]}, so all pixels may differ by noise, "
            f"which has to be known: {missing} (or ask for --gate paired, which sees a bias of the whole image)"
        )
    return Judgement((bits,), "seeds and noise are unknown", f"to allow for noise, {missing}, or say --same-seed")


def noisy_pair(one: Rendering, other: Rendering, variance: Variance) -> NoisyPair:
    """Two images whose samples are known, in the colour space of the variance. NotComparableError if that fails."""
    size = next(iter(one.image.values())).shape
    if variance.pixels != size:
        raise NotComparableError(
            f"the variance has {variance.pixels[1]}x{variance.pixels[0]} pixels, but the images {size[1]}x{size[0]}"
        )
    try:
        means = [colours_in(rendering.image, variance.space) for rendering in (one, other)]
    except ValueError as error:
        raise NotComparableError(str(error)) from None
    return NoisyPair(*means, variance_for(one.image, variance), (one.samples, other.samples))


def same_arithmetic(one: Header, other: Header) -> bool:
    """Whether two images of the same seed were made so that our promise of identical pixels holds."""
    return (
        one.get("filter") == other.get("filter") == "box"
        and all(one.get(key) == other.get(key) for key in ("version_mitsuba", "version_libc"))
        and _triangle_test(one) is not None
        and _triangle_test(one) == _triangle_test(other)
    )


def _number(header: Header, key: str) -> int | None:
    """A positive integer of a header, None if there is none."""
    text = header.get(key, "")
    return int(text) or None if text.isdecimal() else None


def _read(path: Path) -> tuple[dict[str, np.ndarray], Header]:
    if not path.is_file():
        raise NotComparableError(f"there is no file {path}")
    try:
        return read_exr(path), {**read_header(path), "corner": read_corner(path)}
    except Exception as error:  # noqa: BLE001  (OpenEXR raises several kinds)
        raise NotComparableError(f"{path} is no readable OpenEXR file: {one_sentence(error)}") from None


def check_comparable(one: Rendering, other: Rendering) -> None:
    """Same channels, same size, and nothing in the headers that contradicts."""
    if set(one.image) != set(other.image):
        raise NotComparableError(
            f"{one.name} has the channels {choices(sorted(one.image))}, "
            f"but {other.name} has {choices(sorted(other.image))}"
        )
    sizes = [f"{plane.shape[1]}x{plane.shape[0]}" for r in (one, other) for plane in list(r.image.values())[:1]]
    if sizes[0] != sizes[1]:
        raise NotComparableError(f"{one.name} has {sizes[0]} pixels, but {other.name} has {sizes[1]}")
    for name in one.image:
        if one.image[name].dtype != other.image[name].dtype:
            raise NotComparableError(f"the channel {name} has integers in one of {one.name} and {other.name} only")
    for key in _SHARED:
        values = one.header.get(key), other.header.get(key)
        if None not in values and values[0] != values[1]:
            raise NotComparableError(
                f"{one.name} has {key} {values[0]}, but {other.name} has {values[1]} "
                "(--ignore-header looks at the pixels only)"
            )


def _same_paths(one: Rendering, other: Rendering) -> bool:
    keys = ("seed", "spp")
    return all(key in one.header and one.header[key] == other.header.get(key) for key in keys)


def _triangle_test(header: Header) -> str | None:
    """The triangle test of the tree that made an image; None if it is not known, or promised nothing."""
    try:
        spec = parse_spec(header.get("spec_full", ""))
    except ValueError:
        return None
    return str(spec.settings["triangle_test"]) if spec.is_exact else None


def _noise(one: Rendering, other: Rendering, given: Variance | None) -> tuple[NoisyPair | None, str]:
    """What the z gate needs; or None and what is missing, as an advice."""
    found = given or _own(one, other)
    if found is None:
        return None, "give --variance V.exr (the scene rendered with the integrator moment) and --spp for both images"
    if None in (one.samples, other.samples):
        unknown = choices(rendering.name for rendering in (one, other) if rendering.samples is None)
        return None, f"give the samples per pixel of both images with --spp N --spp N, unknown is that of {unknown}"
    pair = noisy_pair(one, other, found)
    wrong = flaw(found, finite_pixels(one.image) & finite_pixels(other.image))
    if wrong and given:
        raise NotComparableError(f"the variance tells no noise: {wrong}")
    return (None, f"give another variance than that of the images ({wrong})") if wrong else (pair, "")


def _own(one: Rendering, other: Rendering) -> Variance | None:
    """What the images themselves say: both together if possible, or else the one that says something."""
    if one.variance and other.variance and one.variance.samples and other.variance.samples:
        return pooled(one.variance, other.variance)
    return one.variance or other.variance
