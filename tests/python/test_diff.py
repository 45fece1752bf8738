"""`mitsuba-bsp diff`: which gates it applies to which files, what it says, and with which status it exits."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from conftest import ROOM, error_line

from mitsuba_bsp import cli
from mitsuba_bsp.exr import read_exr, read_header, write_channels
from mitsuba_bsp.flip import flip
from mitsuba_bsp.loading import threads_for_exr
from mitsuba_bsp.noise import colours_in, own_variance, rendered_channels, variance_image
from mitsuba_bsp.spec import parse_spec

Run = Callable[..., tuple[int, str, str]]

SPP = 64


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """`mitsuba-bsp diff` with these arguments: exit status, output, errors."""
    monkeypatch.chdir(tmp_path)

    def diff(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as end:
            cli.main(["diff", *map(str, arguments)])
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out, said.err

    return diff


def image(seed: int = 0, size: tuple[int, int] = (32, 40), noise: float = 0.5) -> dict[str, np.ndarray]:
    """Noisy grey, of SPP samples with the variance noise^2 each."""
    rng = np.random.default_rng(seed)
    return {name: rng.normal(1, noise / SPP**0.5, size).astype(np.float32) for name in "RGB"}


def made(seed: int = 0, spec: str = "kd", **changes: str) -> dict[str, str]:
    """The header of a rendering."""
    header = {"scene": "room", "variant": "scalar_rgb", "spp": str(SPP), "seed": str(seed), "filter": "box"}
    return {**header, "spec": spec, "spec_full": parse_spec(spec).full, "version_mitsuba": "3.9.1", **changes}


def write(name: str, channels: Mapping[str, np.ndarray], header: Mapping[str, str] | None = None) -> str:
    write_channels(Path(name), channels, header or {})
    return name


def write_variance(name: str = "V.exr", value: float = 0.25, size: tuple[int, int] = (32, 40)) -> str:
    return write(name, {c: np.full(size, value, np.float32) for c in "RGB"})


def nudged(channels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: np.nextafter(plane, np.float32(9)) for name, plane in channels.items()}


def cracked(channels: Mapping[str, np.ndarray], by: float = 0.8) -> dict[str, np.ndarray]:
    found = {name: plane.copy() for name, plane in channels.items()}
    found["G"][11, 21] += np.float32(by)
    return found


def gates(output: str) -> str:
    """The names of the gates that were applied."""
    return output.splitlines()[0].removeprefix("gates: ").partition(" (")[0]


class TestRule:
    """Which gates judge."""

    def test_same_bits_are_the_same_image(self, run: Run) -> None:
        status, output, _ = run(write("a.exr", image(), made(1)), write("b.exr", image(), made(2)))
        assert (status, gates(output), output.splitlines()[-1]) == (0, "identical", "same")

    def test_our_trees_must_agree_in_every_bit(self, run: Run) -> None:
        one, other = write("a.exr", image(), made()), write("b.exr", nudged(image()), made(spec="normals"))
        status, output, _ = run(one, other)
        assert (status, gates(output)) == (1, "identical")
        assert "1280 of 1280 pixels differ" in output

    @pytest.mark.parametrize(
        "header",
        [
            made(spec="embree"),
            made(spec="native"),
            made(spec="kd:triangle_test=mt"),
            made(filter="gaussian"),
            made(version_mitsuba="3.9.0"),
            made(version_libc="musl"),
        ],
    )
    def test_elsewhere_rounding_is_allowed(self, run: Run, header: dict[str, str]) -> None:
        status, output, _ = run(write("a.exr", image(), made()), write("b.exr", nudged(image()), header))
        assert (status, gates(output)) == (0, "finite, paired")

    def test_a_bias_is_none_of_it(self, run: Run) -> None:
        bright = {name: plane * np.float32(1.01) for name, plane in image().items()}
        status, output, _ = run(write("a.exr", image(), made()), write("b.exr", bright, made(spec="embree")))
        assert (status, output.splitlines()[-1]) == (1, "different: failed paired")

    def test_a_crack_needs_the_noise_to_be_seen(self, run: Run) -> None:
        files = write("a.exr", cracked(image()), made()), write("b.exr", image(), made(spec="embree"))
        status, output, _ = run(*files)
        assert (status, gates(output)) == (0, "finite, paired")
        assert "hint: the mean difference says nothing about a few wrong pixels" in output
        status, output, _ = run(*files, "--variance", write_variance())
        assert (status, gates(output)) == (1, "finite, paired, z")
        assert "the worst is pixel (21, 11)" in output

    def test_other_seeds_are_judged_by_the_noise(self, run: Run) -> None:
        files = write("a.exr", image(1), made(1)), write("b.exr", image(2), made(2))
        status, output, _ = run(*files, "--variance", write_variance())
        assert (status, gates(output)) == (0, "finite, z")
        wrong = write("a.exr", cracked(image(1)), made(1))
        assert run(wrong, files[1], "--variance", "V.exr")[0] == 1

    def test_without_it_they_cannot_be(self, run: Run) -> None:
        status, output, errors = run(write("a.exr", image(1), made(1)), write("b.exr", image(2), made(2)))
        assert (status, output) == (2, "")
        assert "a.exr has seed 1 and b.exr seed 2" in errors and "--variance V.exr" in errors
        assert run("a.exr", "b.exr", "--gate", "paired")[0] == 0

    def test_of_files_that_say_nothing_every_bit_is_demanded(self, run: Run) -> None:
        files = write("a.exr", image()), write("b.exr", nudged(image()))
        status, output, _ = run(*files)
        assert (status, gates(output)) == (1, "identical")
        assert "hint: to allow for noise, give --variance" in output
        assert run(*files, "--same-seed")[0] == 0
        assert run(*files, "--variance", write_variance(), "--spp", SPP)[0] == 0

    def test_the_gate_can_be_chosen(self, run: Run) -> None:
        files = write("a.exr", image(), made()), write("b.exr", nudged(image()), made(spec="embree"))
        write_variance()
        for gate, applied, status in (("identical", "identical", 1), ("paired", "finite, paired", 0)):
            found, output, _ = run(*files, "--gate", gate)
            assert (found, gates(output)) == (status, applied)
        found, output, _ = run(*files, "--gate", "z", "--variance", "V.exr")
        assert (found, gates(output)) == (0, "finite, z")

    def test_pixels_that_became_nan_are_different(self, run: Run) -> None:
        broken = image()
        broken["R"][3, 4] = np.nan
        one, other = write("a.exr", broken, made()), write("b.exr", image(), made(spec="embree"))
        status, output, _ = run(one, other, "-o", "p.png")
        assert (status, output.splitlines()[-1]) == (1, "different: failed finite")
        assert "one is pixel (4, 3)" in output
        status, output, _ = run(one, write("c.exr", nudged(broken), made(spec="embree")))
        assert (status, gates(output)) == (0, "finite, paired")
        assert "1 pixels are NaN or infinite in both images" in output
        status, output, _ = run(one, one)
        assert (status, gates(output)) == (0, "identical, finite")


class TestNotComparable:
    """Status 2 and one sentence, and nothing on standard output."""

    @pytest.mark.parametrize(
        ("channels", "header", "sentence"),
        [
            (image(size=(32, 41)), {}, "a.exr has 40x32 pixels, but b.exr has 41x32"),
            ({"Y": image()["R"]}, {}, "a.exr has the channels B, G, R, but b.exr has Y"),
            (image(), {"scene": "sponza"}, "a.exr has scene room, but b.exr has sponza"),
            (image(), {"variant": "scalar_spectral"}, "a.exr has variant scalar_rgb, but b.exr has scalar_spectral"),
        ],
    )
    def test_other_images(self, run: Run, channels: dict, header: dict, sentence: str) -> None:
        status, output, errors = run(write("a.exr", image(), made()), write("b.exr", channels, {**made(), **header}))
        assert (status, output) == (2, "")
        assert sentence in errors and errors.count("mitsuba-bsp: error: ") == 1

    def test_headers_can_be_ignored(self, run: Run) -> None:
        files = write("a.exr", image(), made()), write("b.exr", image(), made(scene="sponza"))
        assert run(*files)[0] == 2
        assert run(*files, "--ignore-header")[0] == 0

    @pytest.mark.parametrize("content", [b"", b"garbage", None])
    def test_unreadable_files(self, run: Run, content: bytes | None) -> None:
        write("a.exr", image())
        if content is not None:
            Path("b.exr").write_bytes(content)
        status, _, errors = run("a.exr", "b.exr")
        assert status == 2
        assert "b.exr is no readable OpenEXR file" in errors or "there is no file b.exr" in errors

    def test_a_cut_off_file(self, run: Run) -> None:
        write("a.exr", image())
        Path("b.exr").write_bytes(Path("a.exr").read_bytes()[:2000])
        status, _, errors = run("a.exr", "b.exr")
        assert status == 2 and "b.exr is no readable OpenEXR file" in errors

    @pytest.mark.parametrize(
        ("arguments", "sentence"),
        [
            (["--spp", SPP], "--spp alone tells no noise"),
            (["--gate", "z"], "the z gate has to know the noise of both images: give --variance V.exr"),
            (["--variance", "V.exr"], "unknown is that of a.exr, b.exr"),
            (["--variance", "small.exr", "--spp", 4], "the variance has 5x4 pixels, but the images 40x32"),
            (["--variance", "negative.exr", "--spp", 4], "negative.exr is no variance image: it has negative values"),
            (["--variance", "alpha.exr", "--spp", 4], "it has the channels A, but a variance needs NAME.X"),
            (["--variance", "none.exr", "--spp", 4], "there is no file none.exr"),
            (["--spp", 1, "--spp", 2, "--spp", 3], "--spp is given 3 times, but there are only two images"),
            (["-o", "picture.jpg"], "picture.jpg does not end in .png"),
        ],
    )
    def test_options(self, run: Run, arguments: list, sentence: str) -> None:
        write_variance()
        write_variance("small.exr", size=(4, 5))
        write_variance("negative.exr", -1.0)
        write("alpha.exr", {"A": image()["R"]})
        gate = [] if "--gate" in arguments or "--variance" not in arguments else ["--gate", "z"]
        files = write("a.exr", image(1)), write("b.exr", image(2))
        status, output, errors = run(*files, *arguments, *gate)
        assert (status, output) == (2, "")
        assert sentence in errors

    def test_a_variance_that_is_not_finite(self, run: Run) -> None:
        files = write("a.exr", cracked(image(1), 50.0)), write("b.exr", image(2))
        for value in (np.nan, np.inf):
            _, output, errors = run(*files, "--variance", write_variance(value=value), "--spp", SPP)
            assert output == "" and "it is NaN or infinite in 1280 pixels where both images are finite" in errors

    @pytest.mark.parametrize("samples", [1, 15, 16])
    def test_noise_of_few_samples(self, run: Run, samples: int) -> None:
        variance = {f"variance.{name}": np.full((32, 40), 0.25, np.float32) for name in "RGB"}
        made_of = {"variance_samples": str(samples)}
        files = write("a.exr", {**image(1), **variance}, made(1, **made_of)), write("b.exr", image(2), made(2))
        status, _, errors = run(*files)
        assert status == (0 if samples == 16 else 2)
        assert samples == 16 or f"it comes from {samples} samples of each pixel, and 16 are the least" in errors

    def test_several_parts(self, run: Run) -> None:
        plane = image()["R"]
        parts = [OpenEXR.Part({"type": OpenEXR.scanlineimage}, {"R": plane + i}, f"part {i}") for i in range(2)]
        with OpenEXR.File(parts) as file:
            file.write("a.exr")
        status, _, errors = run("a.exr", "a.exr")
        assert status == 2 and "it has 2 parts, and only a file of one part is one image" in errors

    def test_another_place_in_the_image(self, run: Run) -> None:
        window = np.array([4, 6], np.int32), np.array([4 + 39, 6 + 31], np.int32)
        with OpenEXR.File({"type": OpenEXR.scanlineimage, "dataWindow": window}, image()) as file:
            file.write("b.exr")
        status, _, errors = run(write("a.exr", image()), "b.exr")
        assert status == 2 and "a.exr has corner (0, 0), but b.exr has (4, 6)" in errors


def test_integers_are_compared_as_integers(run: Run) -> None:
    for name, value in (("a.exr", 2**25), ("b.exr", 2**25 + 1)):
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"id": np.full((8, 8), value, np.uint32)}) as file:
            file.write(name)
    assert run("a.exr", "a.exr")[0] == 0
    status, output, _ = run("a.exr", "b.exr")
    assert status == 1 and "id 33554432 and 33554433" in output


class TestPicture:
    def test_every_layout_is_drawn(self, run: Run) -> None:
        files = write("a.exr", cracked(image()), made()), write("b.exr", image(), made(spec="embree"))
        _, output, _ = run(*files, "-o", "deep/plain.png")
        assert "picture: deep/plain.png" in output
        run(*files, "-o", "noise.png", "--variance", write_variance())
        sizes = [mi.Bitmap(name).size() for name in ("deep/plain.png", "noise.png")]
        assert sizes[0][0] < sizes[1][0]

    @pytest.mark.parametrize("level", [0.0, 1e-30, 1.0])
    def test_flip_of_dark_images_does_not_end_the_process(self, level: float) -> None:
        dark = {name: np.full((9, 9), level, np.float32) for name in "RGB"}
        assert flip(dark, dark).max() == 0
        bright = {name: plane + 1 for name, plane in dark.items()}
        assert 0.01 < flip(bright, dark).mean() <= 1


@pytest.fixture(scope="module")
def moments(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two seeds of a scene rendered by `moment`, as Mitsuba itself writes it."""
    mi.set_variant("scalar_rgb")
    scene = mi.load_string(ROOM)
    integrator = mi.load_dict({"type": "moment", "inner": scene.integrator()})
    files = [tmp_path_factory.mktemp("moments") / f"{seed}.exr" for seed in (1, 2)]
    for seed, file in enumerate(files):
        mi.render(scene, integrator=integrator, spp=SPP, seed=seed)
        with threads_for_exr():
            scene.sensors()[0].film().bitmap().write(str(file))
    return files


class TestMoment:
    """The variance as Mitsuba provides it."""

    def test_its_channels_tell_the_variance(self, moments: list[Path]) -> None:
        channels = read_exr(moments[0])
        assert set(rendered_channels(channels)) == {"R", "G", "B"}
        found = own_variance(channels, SPP)
        expected = (channels["m2_inner.Y"].astype(float) - channels["inner.Y"].astype(float) ** 2) * SPP / (SPP - 1)
        assert found.space == ("X", "Y", "Z")
        assert np.allclose(found.values[..., 1], np.maximum(expected, 0))
        assert np.allclose(colours_in(channels, found.space)[..., 0], channels["inner.X"], rtol=1e-4, atol=1e-5)

    def test_it_is_the_variance_between_seeds(self) -> None:
        mi.set_variant("scalar_rgb")
        scene = mi.load_string(ROOM)
        integrator = mi.load_dict({"type": "moment", "inner": scene.integrator()})
        renders = [np.array(mi.render(scene, integrator=integrator, spp=16, seed=seed)) for seed in range(24)]
        between = np.var([render[..., 4] for render in renders], axis=0, ddof=1).mean() * 16
        within = np.mean([render[..., 7] - render[..., 4] ** 2 for render in renders]) * 16 / 15
        assert within == pytest.approx(between, rel=0.1)

    def test_images_that_tell_it_need_no_other(self, run: Run, moments: list[Path]) -> None:
        status, output, _ = run(*moments, "--spp", SPP)
        assert (status, gates(output)) == (0, "finite, z")

    def test_it_may_be_given_as_the_variance_of_others(self, run: Run, moments: list[Path]) -> None:
        plain = [write(f"{file.stem}.exr", rendered_channels(read_exr(file))) for file in moments]
        _, output, _ = run(*plain, "--variance", moments[0], "--spp", SPP, "--spp", SPP)
        assert gates(output) == "finite, z"
        wrong = cracked(read_exr(Path(plain[0])), 50.0)
        assert run(write("w.exr", wrong), plain[1], "--variance", moments[0], "--spp", SPP)[0] == 1

    def test_two_integrators_in_one_are_refused(self) -> None:
        plane = np.zeros((2, 2), np.float32)
        twice = {f"{part}{name}.{c}": plane for part in ("", "m2_") for name in ("a", "b") for c in "XYZ"}
        with pytest.raises(ValueError, match=r"the moments of several integrators \(a, b\)"):
            own_variance(twice, SPP)

    def test_a_grey_image_has_the_variance_of_its_luminance(self, run: Run, moments: list[Path]) -> None:
        channels = read_exr(moments[0])
        grey = write("grey.exr", {"Y": channels["inner.Y"]})
        other = write("other.exr", {"Y": nudged(channels)["inner.Y"]})
        status, output, _ = run(grey, other, "--variance", moments[0], "--spp", SPP)
        assert (status, gates(output)) == (0, "finite, z")

    def test_plain_channels_are_a_variance_too(self) -> None:
        assert variance_image({"Y": np.ones((2, 3), np.float32)}, None).values.shape == (2, 3, 1)


def test_files_written_by_render_are_judged_by_their_headers(
    command: Callable[..., subprocess.CompletedProcess[str]], room: Path, run: Run, tmp_path: Path
) -> None:
    """From end to end: our trees and Embree, and another resolution of the same seed."""
    for name, options in {
        "kd": ["--spec", "kd"],
        "normals": ["--spec", "normals"],
        "embree": ["--spec", "embree"],
    }.items():
        assert command("render", room, "-o", f"{name}.exr", *options).returncode == 0
    header = read_header(tmp_path / "kd.exr")
    assert {"spp": "4", "seed": "0", "filter": "box", "variant": "scalar_rgb"}.items() <= header.items()
    assert run("kd.exr", "normals.exr")[0] == 0
    status, output, _ = run("kd.exr", "embree.exr")
    assert (status, gates(output)) == (0, "finite, paired")
    result = command(
        "diff", "kd.exr", write("small.exr", {name: plane[1:] for name, plane in read_exr(Path("kd.exr")).items()})
    )
    assert result.returncode == 2
    assert error_line(result) == "kd.exr has 32x32 pixels, but small.exr has 32x31"
