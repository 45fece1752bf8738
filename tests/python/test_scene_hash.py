"""A scene's hash follows its content, and nothing else."""

from __future__ import annotations

import shutil
from pathlib import Path

import mitsuba as mi
import pytest

from mitsuba_bsp.scene_hash import scene_hash

SCENE = """<scene version="3.0.0">
    <default name="size" value="1"/>
    <include filename="part.xml"/>
    <shape type="ply"><string name="filename" value="mesh.ply"/></shape>
    <shape type="sphere"><float name="radius" value="$size"/>
        <bsdf type="diffuse"><spectrum name="reflectance" filename="grey.spd"/></bsdf>
    </shape>
</scene>"""


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    folder = tmp_path / "first"
    folder.mkdir()
    (folder / "scene.xml").write_text(SCENE)
    (folder / "part.xml").write_text('<scene version="3.0.0"><integrator type="path"/></scene>')
    (folder / "grey.spd").write_text("400 0.5\n700 0.5\n")
    mi.load_dict({"type": "cube"}).write_ply(str(folder / "mesh.ply"))
    return folder / "scene.xml"


def test_the_same_content_elsewhere_has_the_same_hash(scene: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(scene.parent, tmp_path / "second") / "scene.xml"
    assert scene_hash(scene, {}) == scene_hash(copy.rename(copy.with_name("renamed.xml")), {})


@pytest.mark.parametrize("name", ["scene.xml", "part.xml", "mesh.ply"])
def test_every_file_counts(scene: Path, name: str) -> None:
    before = scene_hash(scene, {})
    with (scene.parent / name).open("ab") as stream:
        stream.write(b"\n")
    assert scene_hash(scene, {}) != before


def test_spectra_count(scene: Path) -> None:
    before = scene_hash(scene, {})
    (scene.parent / "grey.spd").write_text("400 0.5\n700 0.6\n")
    assert scene_hash(scene, {}) != before


def test_parameters_count(scene: Path) -> None:
    assert len({scene_hash(scene, params) for params in ({}, {"size": "1"}, {"size": "2"})}) == 3


def test_the_search_path_is_left_alone(scene: Path) -> None:
    before = [str(folder) for folder in mi.file_resolver()]
    scene_hash(scene, {})
    assert [str(folder) for folder in mi.file_resolver()] == before
