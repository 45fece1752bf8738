"""The command line: what it prints, what it leaves behind, and with which status it exits."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import error_line, scene_xml

import mitsuba_bsp
from mitsuba_bsp import cli, scheduling
from mitsuba_bsp.exr import read_exr, read_header
from mitsuba_bsp.jobs import Job, JobError, JobResult, run_job

Command = Callable[..., subprocess.CompletedProcess[str]]

SPECS = ["native", "embree", "kd", "normals:k=4,axes=fast"]


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results folder of one complete comparison of a small scene."""
    from conftest import ROOM

    folder = tmp_path_factory.mktemp("finished")
    (folder / "room.xml").write_text(ROOM)
    words = ["compare", "room.xml", "--specs", *SPECS, "--spp", "8", "--resolution", "24", "--out", "out"]
    result = subprocess.run(
        [sys.executable, "-m", "mitsuba_bsp", *words], cwd=folder, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    (folder / "out" / "stdout.txt").write_text(result.stdout)
    (folder / "out" / "stderr.txt").write_text(result.stderr)
    return folder / "out"


def records(folder: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


class TestCompare:
    """A real comparison, with real worker processes."""

    def test_every_spec_is_timed_three_times(self, finished: Path) -> None:
        runs = [(record["spec"], record["repeat"]) for record in records(finished)]
        assert sorted(runs) == sorted((spec, repeat) for spec in SPECS for repeat in range(3))
        assert all(record["build_s"] > 0 and record["render_s"] > 0 for record in records(finished))
        assert {tuple(record["resolution"]) for record in records(finished)} == {(24, 24)}

    def test_our_trees_make_the_same_image_and_no_biased_one(self, finished: Path) -> None:
        found = {record["spec"]: record["image_difference"] for record in records(finished)}
        assert found["normals:k=4,axes=fast"]["trees"]["verdict"] == "identical"
        verdicts = [found[spec][other]["verdict"] for spec in ("kd", SPECS[3]) for other in ("native", "embree")]
        assert set(verdicts) <= {"identical", "rounding"}
        assert all(record["image_repeats"] for record in records(finished))

    def test_counters_are_those_of_the_traced_rays(self, finished: Path) -> None:
        of = {record["spec"]: record for record in records(finished)}
        rays = {
            spec: {kind: of[spec]["counters"][kind]["rays"] for kind in ("closest", "any")} for spec in ("kd", SPECS[3])
        }
        assert rays["kd"] == rays[SPECS[3]]
        assert rays["kd"]["closest"] >= 24 * 24 * 8
        assert of["kd"]["oblique_steps_share"] == 0.0
        assert of["kd"]["triangle_tests_per_ray"] > 0
        assert of["embree"]["triangle_tests_per_ray"] is None

    def test_images_say_what_made_them(self, finished: Path) -> None:
        for record in records(finished):
            header = read_header(finished / record["image"])
            assert (header["spec"], header["scene_hash"]) == (record["spec"], record["scene_hash"])
            assert header["version_mitsuba"] == "3.9.1"
            assert (finished / record["image"]).with_suffix(".png").stat().st_size > 100
        assert read_exr(finished / records(finished)[0]["image"])["R"].shape == (24, 24)

    def test_the_tables_are_shown_and_written(self, finished: Path) -> None:
        shown, written = (finished / "stdout.txt").read_text(), (finished / "table.md").read_text()
        for text in (shown, written):
            assert all(spec in text for spec in SPECS)
            assert "room: 30 triangles, 24x24, 8 spp" in text
            assert "identical to kd" in text

    def test_nothing_is_said_to_stay_outside(self, finished: Path) -> None:
        assert "stay with Embree" not in (finished / "stderr.txt").read_text()

    def test_a_second_run_says_that_nothing_is_left_to_do(self, finished: Path, command: Command) -> None:
        before = (finished / "records.jsonl").read_bytes()
        words = ["--specs", *SPECS, "--spp", "8", "--resolution", "24", "--out", finished]
        result = command("compare", finished.parent / "room.xml", *words)
        assert result.returncode == 0, result.stderr
        assert "16 of 16 jobs were finished by an earlier run" in result.stderr
        assert (finished / "records.jsonl").read_bytes() == before

    def test_a_changed_scene_does_not_mix(self, finished: Path, command: Command, tmp_path: Path) -> None:
        scene = (finished.parent / "room.xml").read_text()
        (tmp_path / "room.xml").write_text(scene.replace('value="0.7"', 'value="0.8"'))
        words = ["--specs", *SPECS, "--spp", "8", "--resolution", "24", "--out", finished]
        result = command("compare", "room.xml", *words)
        assert result.returncode == 2
        assert "scene_hash" in error_line(result) and "choose another --out" in error_line(result)

    def test_a_dated_folder_is_the_default(self, room: Path, command: Command, tmp_path: Path) -> None:
        result = command("compare", room, "--specs", "embree", "--spp", "1", "--resolution", "8")
        assert result.returncode == 0, result.stderr
        (folder,) = (tmp_path / "results").iterdir()
        assert re.fullmatch(r"compare-\d{8}-\d{6}", folder.name)
        assert len(records(folder)) == 3

    @pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGKILL, -9)])
    def test_an_interrupted_run_keeps_what_is_finished(
        self, room: Path, command: Command, tmp_path: Path, number: signal.Signals, status: int
    ) -> None:
        words = ["compare", str(room), "--specs", "embree", "kd", "--spp", "2", "--repeats", "4", "--out", "out"]
        process = subprocess.Popen(
            [sys.executable, "-m", "mitsuba_bsp", *words],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        file = tmp_path / "out" / "records.jsonl"
        deadline = time.monotonic() + 60
        while not (file.exists() and len(file.read_text().splitlines()) >= 2) and time.monotonic() < deadline:
            time.sleep(0.02)
        os.kill(process.pid, number)
        stdout, stderr = process.communicate(timeout=60)
        assert process.returncode == status, stderr
        kept = records(tmp_path / "out")
        assert 2 <= len(kept) < 8
        if number == signal.SIGINT:
            assert "interrupted: what was finished is kept in out" in stderr
            assert "room: 30 triangles" in stdout
        result = command(*words)
        assert result.returncode == 0, result.stderr
        assert "jobs were finished by an earlier run" in result.stderr
        assert records(tmp_path / "out")[: len(kept)] == kept
        assert len(records(tmp_path / "out")) == 8

    def test_status_1_if_a_job_failed_and_the_others_finished(
        self, room: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        def run(job: Job, *_: object) -> JobResult:
            if job.spec == "kd":
                raise JobError("the worker was killed")
            return run_job(job)

        monkeypatch.setattr(scheduling, "run_job", run)
        words = ["--specs", "embree", "kd", "--spp", "1", "--resolution", "8", "--out", str(room.with_name("out"))]
        with pytest.raises(SystemExit) as caught:
            cli.main(["compare", str(room), *words])
        assert caught.value.code == 1
        assert "failed: room, kd: the worker was killed" in capfd.readouterr().out
        assert len(records(room.with_name("out"))) == 3


class TestBadInput:
    """Each mistake: status 2, one sentence, and nothing left behind."""

    @pytest.mark.parametrize(
        ("words", "sentence"),
        [
            (["compare", "gone.xml"], "there is no scene file"),
            (["compare", "room.xml", "--specs", "kd", "oak"], 'there is no accelerator "oak"'),
            (["compare", "room.xml", "--specs", "normals:k=0"], "k"),
            (["compare", "room.xml", "--specs", "normals:k=1000"], "1000"),
            (["compare", "room.xml", "--specs", "kd:colour=red"], "colour"),
            (["compare", "room.xml", "--repeats", "2"], "at least 3"),
            (["compare", "room.xml", "--out", "room.xml"], "cannot write to the output folder room.xml"),
            (["compare", "room.xml", "--out", "room.xml/out"], "cannot write to the output folder room.xml/out"),
            (["compare", "room.xml", "-D", "colour=red"], "$colour=red"),
            (["compare", "syntax.xml"], "Parsing of XML file"),
            (["compare", "missing.xml"], "gone.ply"),
            (["compare", "property.xml"], '"size"'),
            (["compare", "wild.xml"], "wild.ply"),
            (["render", "gone.xml", "-o", "a.exr"], "there is no scene file gone.xml"),
            (["render", "room.xml", "-o", "a.jpg"], "a.jpg ends neither in .exr nor in .png"),
            (["render", "room.xml", "--spec", "oak", "-o", "a.exr"], 'there is no accelerator "oak"'),
            (["render", "wild.xml", "--spec", "embree", "-o", "a.exr"], "wild.ply"),
            (["render", "room.xml", "--spec", "embree", "-o", "room.xml/a.exr"], "room.xml"),
        ],
    )
    @pytest.mark.usefixtures("room", "wild")
    def test_one_sentence_and_status_2(self, command: Command, tmp_path: Path, words: list[str], sentence: str) -> None:
        (tmp_path / "syntax.xml").write_text('<scene version="3.0.0"><shape></scene>')
        (tmp_path / "missing.xml").write_text(
            scene_xml('<shape type="ply"><string name="filename" value="gone.ply"/></shape>')
        )
        (tmp_path / "property.xml").write_text(scene_xml('<shape type="cube"><float name="size" value="1"/></shape>'))
        before = sorted(path.name for path in tmp_path.iterdir())
        result = command(*words)
        assert result.returncode == 2, result.stderr
        assert sentence in error_line(result)
        assert "Traceback" not in result.stderr
        assert sorted(path.name for path in tmp_path.iterdir()) == before

    @pytest.mark.parametrize(
        "words",
        [
            ["compare", "--spp", "0"],
            ["compare", "--spp", "many"],
            ["compare", "--resolution", "-3"],
            ["compare", "--variant", "llvm_ad_rgb"],
            ["compare", "-D", "spp"],
            ["render", "room.xml", "-o", "a.exr", "--seed", "-1"],
            ["render", "room.xml"],
            ["fly"],
            [],
        ],
    )
    def test_arguments_that_make_no_sense(self, command: Command, words: list[str]) -> None:
        result = command(*words)
        assert result.returncode == 2
        assert "error: " in result.stderr and "Traceback" not in result.stderr


class TestRender:
    """`mitsuba-bsp render`."""

    def test_auto_is_the_default_and_says_why(self, room: Path, command: Command) -> None:
        result = command("render", room, "-o", "a.png", "--spp", "2", "--resolution", "16")
        assert result.returncode == 0, result.stderr
        assert "auto: " in result.stdout and f" to trace {16 * 16 * 2 * 6} rays" in result.stdout

    @pytest.mark.parametrize("spec", ["embree", "native", "kd", "normals"])
    def test_an_image_with_its_history(self, room: Path, command: Command, tmp_path: Path, spec: str) -> None:
        result = command(
            "render", room, "--spec", spec, "-o", "a.exr", "--spp", "2", "--resolution", "20", "-D", "res=40"
        )
        assert result.returncode == 0, result.stderr
        assert re.search(r"a\.exr: built in \d+\.\d+ s, rendered in \d+\.\d+ s", result.stdout)
        header = read_header(tmp_path / "a.exr")
        assert header["spec"] == spec and header["spec_full"].startswith(spec) and len(header["scene_hash"]) == 64
        image = read_exr(tmp_path / "a.exr")
        assert image["R"].shape == (20, 20)
        assert np.mean(image["R"]) > 0

    def test_the_seed_counts_and_the_threads_do_not(self, room: Path, command: Command, tmp_path: Path) -> None:
        runs = {"a": ["--seed", "1", "--threads", "1"], "b": ["--seed", "1", "--threads", "2"], "c": ["--seed", "2"]}
        for name, words in runs.items():
            result = command("render", room, "--spec", "embree", "-o", f"{name}.exr", *words)
            assert result.returncode == 0, result.stderr
        images = {name: read_exr(tmp_path / f"{name}.exr")["G"].tobytes() for name in runs}
        assert images["a"] == images["b"] != images["c"]

    def test_a_picture_to_look_at(self, room: Path, command: Command, tmp_path: Path) -> None:
        result = command("render", room, "--spec", "embree", "-o", "new/a.png", "--spp", "1", "--resolution", "8")
        assert result.returncode == 0, result.stderr
        assert (tmp_path / "new" / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_commands_start_without_what_only_some_need() -> None:
    heavy = "scipy", "matplotlib"
    code = f"import sys, mitsuba_bsp.cli; print([name for name in {heavy} if name in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_specs_lists_every_name_key_and_default(command: Command) -> None:
    result = command("specs")
    assert result.returncode == 0, result.stderr
    for name, settings in mitsuba_bsp.specs().items():
        assert re.search(rf"^{name}\b", result.stdout, re.MULTILINE)
        assert all(setting.name in result.stdout for setting in settings)


def test_plugin_dir_serves_the_stock_command(command: Command) -> None:
    folder = Path(command("plugin-dir").stdout.strip())
    assert folder == mitsuba_bsp.plugin_dir()
    assert (folder / "plugins" / "bsptree.so").is_file()
