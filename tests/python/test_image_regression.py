"""The pytest fixture `image_regression`, as another project uses it: test files of its own, run by pytest."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp import image_regression as regression
from mitsuba_bsp.exr import read_exr, read_header, write_channels
from mitsuba_bsp.gates import Gate
from mitsuba_bsp.image_regression import Regression, Setup, against_reference, render
from mitsuba_bsp.judging import Judgement

TESTS = """
import pytest

@pytest.mark.parametrize("spec", ["kd", "normals", "embree"])
def test_room(image_regression, spec):
    image_regression("room.xml", spec, name="room", spp={spp}, seed={seed})
"""


@pytest.fixture
def project(room: Path) -> Path:
    """A folder with the room and a test of it under three accelerators."""
    write_tests(room.parent)
    return room.parent


def write_tests(folder: Path, spp: int = 8, seed: int = 0, extra: str = "") -> None:
    (folder / "test_images.py").write_text(TESTS.format(spp=spp, seed=seed).replace(", seed=0)", f"{extra})"))


def run(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *options, "test_images.py"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120, check=False)


def reference(folder: Path) -> Path:
    return folder / "references" / "room.exr"


class TestInAnotherProject:
    def test_references_are_stored_and_met_again(self, project: Path) -> None:
        written = run(project, "--update-references")
        assert written.returncode == 0 and "references written" in written.stdout, written.stdout
        header = read_header(reference(project))
        assert header["spec"] == "kd" and header["spp"] == header["variance_samples"] == "8" and header["seed"] == "0"
        assert {"version_mitsuba", "version_mitsuba_bsp", "spec_full", "filter", "variant"} <= set(header)
        assert {"R", "G", "B", "variance.X", "variance.Y", "variance.Z"} == set(read_exr(reference(project)))
        again = run(project)
        assert again.returncode == 0 and "3 passed" in again.stdout, again.stdout
        assert run(project, "--update-references").stdout.count("references/room.exr") == 1

    def test_a_reference_may_have_more_samples_and_another_accelerator(self, project: Path) -> None:
        write_tests(project, extra=", reference_spec='embree', reference_spp=64")
        assert run(project, "--update-references").returncode == 0
        header = read_header(reference(project))
        assert header["spec"] == "embree" and header["spp"] == "64"
        assert "3 passed" in run(project).stdout

    def test_a_change_of_the_scene_is_seen_and_shown(self, project: Path) -> None:
        run(project, "--update-references")
        scene = project / "room.xml"
        scene.write_text(scene.read_text().replace('value="8, 1, 1"', 'value="12, 1, 1"'))
        result = run(project, "--image-results", "failures")
        assert result.returncode == 1 and "3 failed" in result.stdout
        assert "room under normals is not what it was" in result.stdout
        assert re.search(
            r"identical +FAILED +\d+ of 1024 pixels differ \(.*\), most at pixel \(\d+, \d+\)", result.stdout
        )
        assert "pictures of differences" in result.stdout
        failures = [f"room--{spec}.{kind}" for spec in ("embree", "kd", "normals") for kind in ("exr", "png")]
        assert sorted(path.name for path in (project / "failures").iterdir()) == failures

    def test_one_changed_pixel_is_seen(self, project: Path) -> None:
        run(project, "--update-references")
        planes, header = read_exr(reference(project)), read_header(reference(project))
        planes["G"][7, 9] = np.nextafter(planes["G"][7, 9], np.float32(1))
        write_channels(reference(project), planes, header)
        result = run(project)
        assert "1 passed" in result.stdout and "2 failed" in result.stdout, result.stdout  # Embree rounds differently
        assert "1 of 1024 pixels differ" in result.stdout and "pixel (9, 7)" in result.stdout

    def test_another_seed_differs_by_noise_only(self, project: Path) -> None:
        run(project, "--update-references")
        write_tests(project, seed=3)
        assert "3 passed" in run(project).stdout

    def test_another_folder_of_references(self, project: Path) -> None:
        (project / "pytest.ini").write_text("[pytest]\nimage_references = kept/images\n")
        run(project, "--update-references")
        assert (project / "kept" / "images" / "room.exr").is_file()
        run(project, "--update-references", "--image-references", "others")
        assert (project / "others" / "room.exr").is_file()


def test_an_integrator_that_adds_vectors_has_one_noise() -> None:
    integrator = {"type": "aov", "aovs": "nn:sh_normal", "path": {"type": "path"}}
    ball = {"type": "sphere", "center": [0, 0, 4]}
    scene = {"type": "scene", "integrator": integrator, "camera": {"type": "perspective"}, "ball": ball}
    found = render({**scene, "sky": {"type": "constant"}}, "kd", "ball", Setup(spp=16, resolution=8))
    assert found.variance is not None and {"R", "inner.nn.X"} <= set(found.image)


class TestMistakes:
    def line(self, project: Path, extra: str, *options: str) -> str:
        write_tests(project, extra=extra)
        result = run(project, *options)
        assert result.returncode == 1 and "Traceback" not in result.stdout
        assert "During handling" not in result.stdout
        return next(line for line in result.stdout.splitlines() if line.startswith("image regression: "))

    def test_no_reference(self, project: Path) -> None:
        assert self.line(project, "").endswith("references/room.exr: make it with pytest --update-references")

    def test_wrong_arguments(self, project: Path) -> None:
        run(project, "--update-references")
        assert 'there is no gate "strict"' in self.line(project, ", gate='strict'")
        assert 'there is no variant "llvm_ad_rgb" here' in self.line(project, ", variant='llvm_ad_rgb'")
        assert "16x16" in self.line(project, ", resolution=16")

    @pytest.mark.parametrize(
        ("changed", "sentence"),
        [
            ({"spp": -3}, "spp is -3, but it must be an integer of at least 1"),
            ({"resolution": "large"}, "resolution is 'large', but it must be an integer of at least 1"),
            ({"seed": None}, "seed is None, but it must be an integer of at least 0"),
        ],
    )
    def test_wrong_numbers(self, changed: dict, sentence: str) -> None:
        with pytest.raises(ValueError, match=re.escape(sentence)):
            Setup(**changed)

    def test_scenes_that_cannot_be_rendered(self) -> None:
        mesh = {"type": "scene", "ball": {"type": "sphere"}}
        with pytest.raises(ValueError, match="the scene has no sensor"):
            render(mesh, "kd", "ball", Setup())
        with pytest.raises(ValueError, match="the spec is None, but it must be text"):
            render(mesh, None, "ball", Setup())

    def test_a_broken_reference(self, project: Path) -> None:
        reference(project).parent.mkdir()
        reference(project).write_bytes(b"no image")
        assert "is no readable OpenEXR file" in self.line(project, "")


def found_by(monkeypatch: pytest.MonkeyPatch, *gates: tuple[str, bool]) -> tuple[Regression, list[int]]:
    """What comes of a test whose renderings, one after the other, fail or pass these gates; and the seeds rendered."""
    seeds: list[int] = []

    def compare(rendering: int, *_: object) -> Regression:
        seeds.append(rendering)
        name, passed = gates[len(seeds) - 1]
        return Regression(Judgement((Gate(name, passed, ""),), ""), Path(), Path(), Path())

    monkeypatch.setattr(regression, "render", lambda scene, spec, name, setup: setup.seed)
    monkeypatch.setattr(regression, "compare", compare)
    return against_reference({}, "kd", Setup(), Path("a.exr"), Path(), "auto"), seeds


class TestTheSecondTry:
    def test_is_for_noise_only(self, monkeypatch: pytest.MonkeyPatch) -> None:
        found, seeds = found_by(monkeypatch, ("z", False), ("z", True))
        assert found.judgement.same and len(set(seeds)) == 2
        found, seeds = found_by(monkeypatch, ("identical", False), ("identical", True))
        assert not found.judgement.same and len(seeds) == 1

    def test_is_the_last(self, monkeypatch: pytest.MonkeyPatch) -> None:
        found, seeds = found_by(monkeypatch, ("z", False), ("z", False))
        assert not found.judgement.same and len(seeds) == 2
