"""A scene that is sent away is the same scene elsewhere, wherever its files are."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import mitsuba as mi
import pytest

from mitsuba_bsp.jobs import Job
from mitsuba_bsp.scene_hash import scene_hash
from mitsuba_bsp.shipping import hash_scene, moved, pack, unpack

#: Files in the scene's folder and outside, named relatively, absolutely, with parameters, and by a search path.
ABROAD = """<scene version="3.0.0">
    <default name="spectra" value="{root}/elsewhere"/>
    <path value="../searched"/>
    <include filename="parts/view.xml"/>
    <shape type="ply"><string name="filename" value="../meshes/a.ply"/></shape>
    <shape type="ply"><string name="filename" value="{root}/elsewhere/b.ply"/></shape>
    <shape type="ply"><string name="filename" value="$meshes/c.ply"/></shape>
    <shape type="ply"><string name="filename" value="parts/../d.ply"/></shape>
    <shape type="ply"><string name="filename" value="e.ply"/></shape>
    <shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" filename="$spectra/grey.spd"/></bsdf></shape>
    <emitter type="constant"/>
</scene>"""

VIEW = """<scene version="3.0.0"><integrator type="path"/>
    <sensor type="perspective"><film type="hdrfilm"><rfilter type="box"/></film>
        <transform name="to_world"><lookat origin="0, -9, 1" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
</scene>"""


def make_abroad(root: Path) -> tuple[Path, dict[str, str]]:
    """The scene, and the parameters that it needs."""
    files = ("meshes/a", "elsewhere/b", "more meshes/c", "scene/d", "searched/e")
    for place, name in enumerate(files):
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        turned = mi.ScalarTransform4f().translate([place - 2, 0, 0]).rotate([0, 0, 1], 10 * place).scale(0.4)
        mi.load_dict({"type": "cube", "to_world": turned}).write_ply(str(root / f"{name}.ply"))
    (root / "elsewhere" / "grey.spd").write_text("400 0.5\n700 0.6\n")
    (root / "scene" / "parts").mkdir()
    (root / "scene" / "parts" / "view.xml").write_text(VIEW)
    (root / "scene" / "abroad.xml").write_text(ABROAD.format(root=root))
    return root / "scene" / "abroad.xml", {"meshes": str(root / "more meshes")}


@pytest.fixture
def abroad(tmp_path: Path) -> tuple[Path, dict[str, str]]:
    return make_abroad(tmp_path / "there")


def packed(tmp_path: Path, scene: Path, params: dict[str, str]) -> tuple[Job, dict]:
    job = Job("pack", str(scene), "scalar_rgb", params=params, arrays=str(tmp_path / "scene.tar"))
    return job, pack(job, lambda _: None)


def test_it_is_the_same_scene_without_the_files_that_it_was_made_of(
    abroad: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    job, found = packed(tmp_path, *abroad)
    expected = scene_hash(*abroad)
    assert found["scene_hash"] == expected
    archive = (tmp_path / "scene.tar").read_bytes()
    shutil.rmtree(tmp_path / "there")
    root = tmp_path / "here" / "x"
    unpack(archive, root)
    there, _ = moved(job, root, found["scene"], found["params"])
    assert hash_scene(replace(there, choices=abroad[1]), lambda _: None) == {"scene_hash": expected}
    scene = mi.load_file(there.scene, **there.params)
    assert len(scene.shapes()) == 6


def test_the_archive_depends_on_the_scene_alone(abroad: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    packed(tmp_path, *abroad)
    before = (tmp_path / "scene.tar").read_bytes()
    abroad[0].touch()
    packed(tmp_path, *abroad)
    assert (tmp_path / "scene.tar").read_bytes() == before


def test_a_file_that_is_another_one_there_is_noticed(abroad: tuple[Path, dict[str, str]], tmp_path: Path) -> None:
    job, found = packed(tmp_path, *abroad)
    root = tmp_path / "here"
    unpack((tmp_path / "scene.tar").read_bytes(), root)
    there, _ = moved(job, root, found["scene"], found["params"])
    check = replace(there, choices=abroad[1])
    assert hash_scene(check, lambda _: None)["scene_hash"] == found["scene_hash"]
    (spectrum,) = root.rglob("grey.spd")
    spectrum.write_text("400 0.5\n700 0.7\n")
    assert hash_scene(check, lambda _: None)["scene_hash"] != found["scene_hash"]


def test_what_a_job_writes_is_beside_what_others_have_written(tmp_path: Path) -> None:
    job = Job("converge", "/s/room.xml", "scalar_rgb", arrays="/out/converge/kd.npz", cache="/trees")
    there, files = moved(job, tmp_path / "x", "s/room.xml", {"a": "1"})
    assert there.arrays == str(tmp_path / "x" / "made" / "converge" / "kd.npz") == str(files[job.arrays])
    assert (there.scene, there.params) == (str(tmp_path / "x" / "s" / "room.xml"), {"a": "1"})
    assert there.cache == str(tmp_path / "trees")


def test_files_that_jobs_read_and_write() -> None:
    counted = Job("count", "s.xml", "scalar_rgb", image="a.exr")
    assert (counted.reads, counted.writes) == ((), ("a.exr", "a.png"))
    streams = {kind: Job(kind, "s.xml", "scalar_rgb", streams="r.npz") for kind in ("record", "replay")}
    assert (streams["record"].reads, streams["record"].writes) == ((), ("r.npz",))
    assert (streams["replay"].reads, streams["replay"].writes) == (("r.npz",), ())
