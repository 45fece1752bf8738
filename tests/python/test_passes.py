"""Images in passes: how samples are shared out, and how passes become an image."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp.exr import read_exr, read_header
from mitsuba_bsp.jobs import Job, run_job
from mitsuba_bsp.passes import merge, render_pass, shares


@pytest.mark.parametrize(("spp", "passes", "expected"), [(8, 4, [2] * 4), (10, 4, [3, 3, 2, 2]), (3, 3, [1] * 3)])
def test_shares(spp: int, passes: int, expected: list[int]) -> None:
    assert shares(spp, passes) == expected


def test_the_image_is_the_mean_by_samples_in_double_precision(tmp_path: Path) -> None:
    generator = np.random.default_rng(1)
    parts = [generator.random((3, 4, 3), np.float32) * 10.0**exponent for exponent in (0, 4, -4)]
    spp, files = (3, 2, 1), [str(tmp_path / f"{number}.npz") for number in range(3)]
    for file, part, samples in zip(files, parts, spp, strict=True):
        np.savez(file, pixels=part.astype(np.float32), spp=samples, names=np.array([], np.str_))
    image = tmp_path / "a.exr"
    merge(Job("merge", "s.xml", "scalar_rgb", seed=5, image=str(image), choices={"passes": files}), lambda _: None)
    expected = sum(n * part.astype(np.float32).astype(np.float64) for n, part in zip(spp, parts, strict=True)) / 6
    found = read_exr(image)
    for channel, name in enumerate("RGB"):
        assert (found[name] == expected[..., channel].astype(np.float32)).all()
    png = Job("merge", "s.xml", "scalar_rgb", image=str(tmp_path / "a.png"), choices={"passes": files})
    merge(png, lambda _: None)
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    header = read_header(image)
    assert (header["spp"], header["passes"], header["seed"]) == ("6", "3", "5 to 7")


def test_one_pass_is_the_image_itself_and_seeds_differ(room: Path, tmp_path: Path) -> None:
    found = []
    for number, seed in enumerate((0, 0, 1)):
        job = Job("pass", str(room), "scalar_rgb", spec="kd", spp=2, seed=seed, arrays=str(tmp_path / f"{number}.npz"))
        render_pass(job, lambda _: None)
        with np.load(job.arrays) as arrays:
            found.append(arrays["pixels"].tobytes())
    assert found[0] == found[1] != found[2]
    whole = run_job(Job("count", str(room), "scalar_rgb", spec="kd", spp=2)).values["pixels_sha256"]
    with np.load(tmp_path / "0.npz") as arrays:
        assert hashlib.sha256(arrays["pixels"]).hexdigest() == whole
