"""Jobs in child processes: what they find, and one sentence for every way in which they can end badly."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from conftest import scene_xml

from mitsuba_bsp import jobs
from mitsuba_bsp.exr import read_exr, read_header, write_exr
from mitsuba_bsp.jobs import Job, JobError, run_job


def test_inspection_finds_what_a_comparison_needs(room: Path) -> None:
    found = run_job(Job("inspect", str(room), "scalar_rgb", params={"spp": "5"}, resolution=16)).values
    assert found["content"] == {
        "triangles": 30, "meshes": 5, "others": {}, "shape_groups": 0, "instances": 0, "grouped": 0,
        "bounded": {"Sphere": 1}, "several": {},
    }  # fmt: skip
    assert (found["spp"], found["resolution"]) == (5, [16, 16])
    assert found["box_filter"] and found["fixed_blocks"]


def test_two_jobs_make_the_same_image_and_write_it(room: Path, tmp_path: Path) -> None:
    header = {"spec": "embree"}
    job = Job("count", str(room), "scalar_rgb", spp=2, threads=2, image=str(tmp_path / "a.exr"), header=header)
    found = [run_job(job).values["pixels_sha256"] for _ in range(2)]
    assert found[0] == found[1]
    assert read_header(tmp_path / "a.exr")["spec"] == "embree"
    assert read_exr(tmp_path / "a.exr")["R"].shape == (32, 32)
    assert np.array(mi.Bitmap(str(tmp_path / "a.png"))).shape == (32, 32, 3)


def test_a_timed_run_renders_the_same_image_and_says_how_long_it_took(room: Path, tmp_path: Path) -> None:
    counted = run_job(Job("count", str(room), "scalar_rgb", spp=3, image=str(tmp_path / "a.exr"))).values
    timed = run_job(Job("time", str(room), "scalar_rgb", spp=3)).values
    assert timed["pixels_sha256"] == counted["pixels_sha256"]
    assert timed["build_s"] > 0 and timed["render_s"] > 0
    assert timed["peak_rss_bytes"] > 1e7


def test_another_seed_is_another_image(room: Path) -> None:
    found = {run_job(Job("time", str(room), "scalar_rgb", spp=1, seed=seed)).values["pixels_sha256"] for seed in (0, 1)}
    assert len(found) == 2


def test_a_crash_of_the_loader_names_the_mesh(wild: Path) -> None:
    with pytest.raises(JobError) as caught:
        run_job(Job("inspect", str(wild), "scalar_rgb"))
    message = str(caught.value)
    assert "Mitsuba's own loader died (SIGSEGV)" in message
    assert str(wild.with_name("wild.ply")) in message
    assert str(wild) in message
    assert "\n" not in message


def test_one_thread_reads_exr_files(tmp_path: Path) -> None:
    write_exr(tmp_path / "sky.exr", np.ones((9, 9, 3), np.float32), ["R", "G", "B"], {})
    path = tmp_path / "scene.xml"
    sky = '<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>'
    path.write_text(scene_xml('<shape type="cube"/>', sky))
    started = time.monotonic()

    def give_up(_: str) -> None:
        assert time.monotonic() - started < 60, "it hangs"

    assert run_job(Job("inspect", str(path), "scalar_rgb", threads=1), give_up).values["content"]["triangles"] == 12


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("<scene", ["Parsing of XML file", "failed"]),
        (scene_xml('<shape type="ply"><string name="filename" value="gone.ply"/></shape>'), ["gone.ply", "not found"]),
        (scene_xml('<shape type="cube"><float name="size" value="1"/></shape>'), ['"size"', "unreferenced"]),
        ('<scene version="3.0.0"><sensor type="perspective"/></scene>', ["has no integrator"]),
        ('<scene version="3.0.0"><integrator type="path"/></scene>', ["has no sensor"]),
    ],
)
def test_what_mitsuba_rejects_is_one_sentence(tmp_path: Path, content: str, words: list[str]) -> None:
    path = tmp_path / "bad.xml"
    path.write_text(content)
    with pytest.raises(JobError) as caught:
        run_job(Job("inspect", str(path), "scalar_rgb"))
    message = str(caught.value)
    assert all(word in message for word in words), message
    assert str(path) in message
    assert "\n" not in message and "cpp:" not in message


def test_every_warning_reaches_the_parent_once(tmp_path: Path) -> None:
    path = tmp_path / "scene.xml"
    path.write_text(
        scene_xml('<shape type="merge"/>', '<shape type="bsptree"/>', '<ref id="m"/>', '<shape type="merge" id="m"/>')
    )
    warnings = run_job(Job("inspect", str(path), "scalar_rgb")).warnings
    said = [warning.rpartition(": ")[2] for warning in warnings]
    empty = "this {} is empty and adds nothing to the scene"
    assert said == [empty.format("merge"), empty.format("bsptree"), empty.format("merge")]


@pytest.mark.parametrize(
    ("number", "sentence"),
    [
        (signal.SIGKILL, "the worker was killed while rendering the room, probably because memory ran out"),
        (signal.SIGABRT, "Mitsuba died (SIGABRT) while rendering the room"),
    ],
)
def test_a_worker_that_is_killed(monkeypatch: pytest.MonkeyPatch, number: signal.Signals, sentence: str) -> None:
    stage = """open(sys.argv[1], "w").write('{"stage": "rendering the room"}')"""
    die = f"import os, sys; {stage}; os.kill(os.getpid(), {number})"
    real = jobs.subprocess.Popen
    monkeypatch.setattr(
        jobs.subprocess, "Popen", lambda command, **kw: real([sys.executable, "-c", die, command[-1]], **kw)
    )
    with pytest.raises(JobError, match="^" + sentence.replace("(", r"\(").replace(")", r"\)") + "$"):
        run_job(Job("time", "room.xml", "scalar_rgb"))


def test_a_worker_is_ended_when_its_parent_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    started = []

    class Interrupted(jobs.subprocess.Popen):
        def communicate(self, *_: object, **__: object) -> None:
            started.append(self.pid)
            raise KeyboardInterrupt

    monkeypatch.setattr(jobs.subprocess, "Popen", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_job(Job("time", "room.xml", "scalar_rgb"))
    with pytest.raises(ProcessLookupError):
        os.kill(started[0], 0)
