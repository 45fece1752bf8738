"""The gates on images whose answers are known: each of them passes what it must and fails what it is there for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mitsuba_bsp.gates import NoisyPair, Place, finite, identical, paired, z_scores, z_test

Image = dict[str, np.ndarray]
SPP, REFERENCE_SPP = 64, 1024


def noise_pair(seed: int, size: int = 48, sigma: float = 0.5, skewed: bool = False) -> NoisyPair:
    """Means of samples around a smooth image, with the variance they really have."""
    rng = np.random.default_rng(seed)
    truth = 1 + 0.5 * np.sin(np.arange(size) / 9)[:, None, None] * np.ones((size, size, 3))
    variance = np.full(truth.shape, sigma**2)

    def mean(samples: int) -> np.ndarray:
        if skewed:
            shape = truth**2 / variance
            return rng.gamma(samples * shape, truth / (samples * shape))
        return rng.normal(truth, np.sqrt(variance / samples))

    return NoisyPair(mean(SPP), mean(REFERENCE_SPP), variance, (SPP, REFERENCE_SPP))


@pytest.fixture
def image() -> Image:
    generator = np.random.default_rng(1)
    return {name: generator.uniform(0.1, 1.0, (20, 30)).astype(np.float32) for name in "RGB"}


def copied(image: Image) -> Image:
    return {name: plane.copy() for name, plane in image.items()}


class TestIdentical:
    def test_equal_bits_pass_whatever_they_are(self, image: Image) -> None:
        image["R"][3, 4] = math.nan
        assert identical(image, copied(image)).passed

    def test_the_last_bit_of_one_channel_fails_and_is_located(self, image: Image) -> None:
        other = copied(image)
        other["G"][7, 11] = np.nextafter(other["G"][7, 11], np.float32(2))
        found = identical(other, image)
        assert (found.passed, found.place) == (False, Place(11, 7))
        assert "1 of 600 pixels differ" in found.found
        assert f"{other['G'][7, 11]:.9g} and {image['G'][7, 11]:.9g}" in found.found

    def test_the_largest_difference_is_the_place(self, image: Image) -> None:
        other = copied(image)
        other["R"][2, 3] += 0.1
        other["B"][5, 6] += 0.3
        assert identical(other, image).place == Place(6, 5)

    def test_a_pixel_that_became_nan_is_the_worst(self, image: Image) -> None:
        other = copied(image)
        other["R"] += np.float32(1)
        other["R"][9, 9] = math.nan
        assert identical(other, image).place == Place(9, 9)


class TestFinite:
    def test_pixels_lost_in_one_image_fail(self, image: Image) -> None:
        other = copied(image)
        other["B"][4, 5] = math.inf
        found = finite(image, other)
        assert (found.passed, found.place) == (False, Place(5, 4))
        assert "0 pixels are NaN or infinite in the first image only, 1 in the second" in found.found

    def test_pixels_lost_in_both_are_reported(self, image: Image) -> None:
        image["B"][4, 5] = math.nan
        found = finite(image, copied(image))
        assert found.passed
        assert "1 pixels are NaN or infinite in both" in found.found

    def test_ordinary_images_pass(self, image: Image) -> None:
        assert finite(image, copied(image)).found == "all pixels are finite"


class TestPaired:
    def test_rounding_passes(self, image: Image) -> None:
        noise = 1 + np.random.default_rng(2).normal(0, 3e-7, (20, 30))
        other = {name: (plane * noise).astype(np.float32) for name, plane in image.items()}
        assert paired(other, image).passed

    def test_a_faint_bias_fails(self, image: Image) -> None:
        noise = 1.002 + np.random.default_rng(2).normal(0, 0.01, (20, 30))
        other = {name: (plane * noise).astype(np.float32) for name, plane in image.items()}
        assert not paired(other, image).passed

    def test_a_crack_is_located_but_not_seen(self, image: Image) -> None:
        other = copied(image)
        other["R"][8, 9] += 5
        found = paired(other, image)
        assert (found.passed, found.place) == (True, Place(9, 8))


class TestZ:
    @pytest.mark.parametrize("skewed", [False, True])
    def test_noise_fails_at_the_stated_rate(self, skewed: bool) -> None:
        """One in a hundred of the images, so of 300 more than 10 are unlikely (0.1 %)."""
        failures = sum(not z_test(noise_pair(seed, 24, skewed=skewed)).passed for seed in range(300))
        assert failures <= 10
        lenient = sum(not z_test(noise_pair(seed, 24, skewed=skewed), alpha=0.5).passed for seed in range(100))
        assert 20 <= lenient <= 70, "the limit is not that of the noise"

    def test_strong_skew_is_not_taken_for_a_difference(self) -> None:
        """Light that few samples bring, variance estimated as in practice: normal tails would fail half of them."""
        failures, normal = 0, 0
        for seed in range(30):
            rng = np.random.default_rng(seed)
            counts = rng.binomial(SPP, 0.005, (24, 24, 1)), rng.binomial(REFERENCE_SPP, 0.005, (24, 24, 1))
            share = (counts[0] + counts[1]) / (SPP + REFERENCE_SPP)
            pair = NoisyPair(counts[0] / SPP, counts[1] / REFERENCE_SPP, share * (1 - share), (SPP, REFERENCE_SPP))
            failures += not z_test(pair).passed
            deviation = np.sqrt(pair.variance * (1 / SPP + 1 / REFERENCE_SPP))
            normal += bool((np.abs(pair.image - pair.reference) > 4.4 * deviation).any())
        assert failures <= 5
        assert normal >= 15

    @pytest.mark.parametrize(("side", "standard_errors"), [(1, 8.0), (4, 2.0), (16, 0.6)])
    def test_a_block_is_seen_at_its_own_size(self, side: int, standard_errors: float) -> None:
        """An error too faint for a pixel is not too faint for a block of them."""
        pair = noise_pair(3)
        assert z_test(pair).passed
        deviation = math.sqrt(pair.variance[0, 0, 0] * (1 / SPP + 1 / REFERENCE_SPP))
        pair.image[16 : 16 + side, 32 : 32 + side] += standard_errors * deviation
        found = z_test(pair)
        assert (found.passed, found.place) == (False, Place(32, 16, side))
        assert f"z = {np.abs(z_scores(pair, side)).max():.1f}" in found.found

    def test_a_crack_in_one_channel_of_one_pixel(self) -> None:
        pair = noise_pair(4)
        pair.image[5, 6, 1] += 10 * math.sqrt(pair.variance[0, 0, 0] / SPP)
        found = z_test(pair)
        assert (found.passed, found.place) == (False, Place(6, 5))
        assert "1 of 2304 pixels" in found.found

    def test_both_images_noise_counts(self) -> None:
        """A difference of 6.5 standard errors of the image alone is 4.6 of both, if both have as many samples."""
        pair = noise_pair(5)
        values = np.ones((48, 48, 1))
        variance = np.full(values.shape, 0.25)
        shifted = values.copy()
        shifted[3, 3] += 6.5 * math.sqrt(0.25 / SPP)
        assert not z_test(NoisyPair(shifted, values, variance, (SPP, 10**9))).passed
        assert z_test(NoisyPair(shifted, values, variance, (SPP, SPP))).passed
        assert pair.samples == (SPP, REFERENCE_SPP)

    def test_a_single_bright_sample_is_no_proof_but_several_are(self) -> None:
        """A pixel that was black in all samples of the reference and had one bright sample, or six of them."""
        for bright, passes in ((1, True), (6, False)):
            pair = noise_pair(6)
            share = bright / (SPP + REFERENCE_SPP)
            pair.image[9, 9], pair.reference[9, 9], pair.variance[9, 9] = bright / SPP, 0, share * (1 - share)
            assert z_test(pair).passed == passes

    def test_pixels_without_noise_may_differ_by_rounding_only(self) -> None:
        values = np.ones((8, 8, 3))
        for factor, passes in ((1 + 1e-6, True), (1 + 1e-2, False)):
            assert z_test(NoisyPair(values * factor, values, 0 * values, (SPP, SPP))).passed == passes

    def test_black_stays_black(self) -> None:
        values = np.ones((8, 8, 3))
        values[2, 3] = 0
        lit = values.copy()
        for light, passes in ((0.0, True), (1e-20, True), (0.1, False)):
            lit[2, 3] = light
            assert z_test(NoisyPair(lit, values, 0 * values, (SPP, SPP))).passed == passes

    def test_lost_pixels_are_in_no_block(self) -> None:
        pair = noise_pair(7)
        pair.image[3, 3] = math.nan
        pair.reference[40, 2] = math.inf
        assert z_test(pair).passed
        assert np.isfinite(z_scores(pair, 16)).all()

    def test_blocks_at_the_edge_have_what_is_left(self) -> None:
        pair = noise_pair(8, size=18)
        assert z_scores(pair, 16).shape == (2, 2, 3)
        pair.image[16:, 16:] += 0.3
        assert z_test(pair).place == Place(16, 16, 4)
