"""Existing tests run under any tree: Mitsuba's loaders return swapped scenes, and everything else stays as it was."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import pytest
from conftest import scene_xml

import mitsuba_bsp
from mitsuba_bsp.testing import swapped

SCENE = {"type": "scene", "cube": {"type": "cube"}}
SKY = {"type": "constant"}
CUBE = '<shape type="cube" id="cube"/>'


def spec_of(scene: mi.Scene) -> str | None:
    return mitsuba_bsp.statistics(scene).get("spec", "").partition(":")[0] or None


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
def test_all_three_loaders_return_swapped_scenes(tmp_path: Path, spec: str) -> None:
    file = tmp_path / "scene.xml"
    file.write_text(scene_xml(CUBE).replace("cube", "$kind"))
    with swapped(spec):
        scenes = [
            mi.load_dict(SCENE),
            mi.load_dict(SCENE, parallel=False, optimize=False),
            mi.load_string(scene_xml(CUBE)),
            mi.load_file(str(file), kind="cube"),
        ]
    assert [spec_of(scene) for scene in scenes] == [spec] * 4
    assert spec_of(mi.load_dict(SCENE)) is None


def test_what_is_no_scene_is_made_by_mitsuba() -> None:
    with swapped("kd"):
        assert mi.load_dict({"type": "cube"}).class_name() == "Cube"
        assert mi.load_string('<bsdf version="3.0.0" type="diffuse"/>').class_name() == "SmoothDiffuse"
        assert len(mi.load_dict({"type": "merge", "a": {"type": "cube"}, "b": {"type": "rectangle"}})) == 2


def test_errors_are_mitsubas_own() -> None:
    with swapped("kd"):
        for wrong in ({"a": {"type": "nothing"}}, {"a": {"type": "ply"}}, {"a": SKY, "b": SKY}, {"a": {"kind": 1}}):
            with pytest.raises(RuntimeError) as ours:
                mi.load_dict({"type": "scene", **wrong})
            with pytest.raises(RuntimeError) as theirs:
                mi.load_dict.theirs({"type": "scene", **wrong})
            assert str(ours.value) == str(theirs.value)


def test_it_lasts_through_changes_of_the_variant() -> None:
    original = mi.load_dict
    with swapped("kd"):
        for variant in ("scalar_spectral", "scalar_rgb", "scalar_rgb", "scalar_spectral_polarized"):
            mi.set_variant(variant)
            assert spec_of(mi.load_dict(SCENE)) == "kd"
    assert spec_of(mi.load_dict(SCENE)) is None
    mi.set_variant("scalar_rgb")
    assert mi.load_dict == original


def test_a_failing_test_undoes_it() -> None:
    with pytest.raises(ZeroDivisionError), swapped("kd"):
        raise ZeroDivisionError
    assert spec_of(mi.load_dict(SCENE)) is None


def test_a_wrong_spec() -> None:
    with pytest.raises(ValueError, match='there is no accelerator "oak"'), swapped("oak"):
        pass


TESTS = """
import mitsuba as mi
import mitsuba_bsp
import pytest

@pytest.mark.parametrize("variant", ["scalar_rgb", "scalar_spectral"])
def test_under(variant):
    mi.set_variant(variant)
    scene = mi.load_dict({"type": "scene", "cube": {"type": "cube"}})
    assert mitsuba_bsp.statistics(scene).get("spec", "").startswith("normals:k=4,")
"""


class TestPytest:
    def run(self, folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
        (folder / "test_scenes.py").write_text(TESTS)
        command = [sys.executable, "-m", "pytest", "-p", "mitsuba_bsp.testing", *options, "test_scenes.py"]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)

    def test_any_test_file_runs_under_any_tree(self, tmp_path: Path) -> None:
        result = self.run(tmp_path, "--under", "normals:k=4")
        assert result.returncode == 0, result.stdout
        assert "mitsuba-bsp: scenes under normals:k=4" in result.stdout and "2 passed" in result.stdout

    def test_without_the_option_nothing_changes(self, tmp_path: Path) -> None:
        result = self.run(tmp_path)
        assert result.returncode == 1 and "2 failed" in result.stdout

    def test_a_wrong_spec(self, tmp_path: Path) -> None:
        result = self.run(tmp_path, "--under", "oak")
        assert result.returncode == 4
        assert 'ERROR: --under: spec "oak": there is no accelerator "oak"' in result.stderr
