"""The verdict on two images: identical, rounded differently, or biased."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_bsp.images import compare_images

Image = dict[str, np.ndarray]


@pytest.fixture
def image() -> Image:
    generator = np.random.default_rng(1)
    return {name: generator.uniform(0.1, 1.0, (48, 64)).astype(np.float32) for name in "RGB"}


def changed(image: Image, factor: np.ndarray) -> Image:
    return {name: (plane * factor).astype(np.float32) for name, plane in image.items()}


def test_equal_images_are_identical(image: Image) -> None:
    found = compare_images(image, {name: plane.copy() for name, plane in image.items()})
    assert found.verdict == "identical"
    assert (found.differing_pixels, found.share, found.largest, found.mean) == (0, 0.0, 0.0, 0.0)
    assert found.p_value == 1.0


def test_one_bit_in_one_pixel_is_seen(image: Image) -> None:
    other = {name: plane.copy() for name, plane in image.items()}
    other["G"][3, 4] = np.nextafter(other["G"][3, 4], np.float32(2))
    found = compare_images(other, image)
    assert found.differing_pixels == 1
    assert found.share == 0.0
    assert found.verdict == "rounding"


def test_zeros_of_different_sign_differ(image: Image) -> None:
    image["R"][0, 0] = 0.0
    other = {name: plane.copy() for name, plane in image.items()}
    other["R"][0, 0] = -0.0
    assert compare_images(other, image).differing_pixels == 1


def test_rounding_noise_is_not_bias(image: Image) -> None:
    noise = 1 + np.random.default_rng(2).normal(0, 3e-7, (48, 64))
    found = compare_images(changed(image, noise), image)
    assert found.verdict == "rounding"
    assert found.share == 0.0
    assert 0 < found.largest < 1e-5


def test_a_few_diverging_paths_are_not_bias(image: Image) -> None:
    generator = np.random.default_rng(3)
    factor = np.where(generator.random((48, 64)) < 0.01, generator.uniform(0.5, 1.5, (48, 64)), 1.0)
    found = compare_images(changed(image, factor), image)
    assert found.verdict == "rounding"
    assert 0.005 < found.share < 0.02


def test_a_light_leak_far_below_the_noise_is_bias(image: Image) -> None:
    noise = np.random.default_rng(4).normal(0, 0.02, (48, 64))
    found = compare_images(changed(image, 1.002 + noise), image)
    assert found.verdict == "bias"
    assert found.mean > 0
    assert found.p_value < 1e-3


def test_a_constant_offset_is_bias(image: Image) -> None:
    one = {"Y": np.full((8, 8), 1.0, np.float32)}
    other = {"Y": np.full((8, 8), 1.25, np.float32)}
    found = compare_images(other, one)
    assert (found.verdict, found.p_value, found.mean, found.share) == ("bias", 0.0, 0.25, 1.0)


def test_a_systematic_last_bit_is_rounding(image: Image) -> None:
    one = {"Y": np.full((8, 8), 1.0, np.float32)}
    other = {"Y": np.nextafter(one["Y"], np.float32(2))}
    assert compare_images(other, one).verdict == "rounding"


def test_dark_pixels_are_judged_by_the_brightness_of_the_image() -> None:
    one = {"Y": np.ones((8, 8), np.float32)}
    one["Y"][0, 0] = 0.0
    other = {"Y": one["Y"].copy()}
    other["Y"][0, 0] = 1e-7
    assert compare_images(other, one).share == 0.0


def test_pixels_that_are_not_finite_are_counted_and_left_out(image: Image) -> None:
    other = {name: plane.copy() for name, plane in image.items()}
    other["R"][0, 0] = math.nan
    found = compare_images(other, image)
    assert (found.non_finite_pixels, found.differing_pixels, found.largest) == (1, 1, 0.0)
    assert not math.isnan(found.p_value)


def test_images_of_different_shape_cannot_be_compared(image: Image) -> None:
    assert compare_images({"R": image["R"]}, image).verdict == "not comparable"
    assert compare_images({name: plane[1:] for name, plane in image.items()}, image).verdict == "not comparable"


def test_only_colours_are_tested_for_bias(image: Image) -> None:
    image["depth.T"] = np.full((48, 64), 5.0, np.float32)
    other = {name: plane.copy() for name, plane in image.items()}
    other["depth.T"] += 1
    found = compare_images(other, image)
    assert (found.verdict, found.mean, found.share) == ("rounding", 0.0, 1.0)
