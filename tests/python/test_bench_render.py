"""`mitsuba-bsp bench render`: whole frames in turns, the frame that traces for free, resumption, and bad input."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from conftest import error_line, scene_xml

from mitsuba_bsp import cli, frame_jobs, scenes_dir, scheduling
from mitsuba_bsp.bench_render_table import legend
from mitsuba_bsp.jobs import FREE, Job, JobError, JobResult, run_job
from mitsuba_bsp.rendering import Frame, construct, load, render

Command = Callable[..., subprocess.CompletedProcess[str]]

SPECS = ["native", "embree", "kd", "normals:k=4"]
REPEATS = 7

#: Seconds of a frame, as the processor counts them; on the clock everything takes a second more.
CPU_S = {"native": 4.0, "embree": 1.0, "kd": 2.0, "normals:k=4": 2.5, FREE: 0.5}


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


def table_row(text: str, spec: str) -> list[str]:
    """The cells of the first row of a table that is about `spec`."""
    return next(line.split() for line in text.splitlines() if line.split()[:1] == [spec])


class Workers:
    """Does what workers do, but frames in no time; `failing` are names of scenes whose frames fail."""

    def __init__(self) -> None:
        self.jobs: list[Job] = []
        self.failing: set[str] = set()

    def run(self, job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
        if job.kind != "frames":
            return run_job(job, on_stage)
        self.jobs.append(job)
        if Path(job.scene).stem in self.failing:
            raise JobError("the worker was killed")
        names = [*job.specs, *[FREE] * (job.threads == 1)]
        runs = [
            {"spec": name, "repeat": repeat, "cpu_s": CPU_S[name], "wall_s": CPU_S[name] + 1}
            for repeat in range(job.repeats)
            for name in names
        ]
        images = {name: {"reference": "kd", "verdict": "bias" if name == "native" else "identical"} for name in names}
        return JobResult({"runs": runs, "images": images}, ())


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> Workers:
    found = Workers()
    monkeypatch.setattr(scheduling, "run_job", found.run)
    return found


@pytest.fixture
def scenes(room: Path) -> list[str]:
    other = room.with_name("other.xml")
    other.write_text(room.read_text())
    return [str(room), str(other)]


def bench(*words: str) -> int:
    """The exit status of `bench render`, run in this process."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["bench", "render", *words])
    return caught.value.code


class TestTables:
    """What becomes of measured frames."""

    def test_one_thread(
        self, workers: Workers, scenes: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        out = tmp_path / "out"
        assert bench(*scenes, "--threads", "1", "--out", str(out), "--specs", *SPECS) == 0
        shown = capfd.readouterr().out
        assert all(row["frame_s"] == row["cpu_s"] == CPU_S[row["spec"]] for row in rows(out))
        assert len(rows(out)) == 2 * REPEATS * len(CPU_S)
        one = ["1.00", "[1.00,", "1.00]"]
        half, twice = ["0.50", "[0.50,", "0.50]"], ["2.00", "[2.00,", "2.00]"]
        three_quarters = ["0.75", "[0.75,", "0.75]"]
        assert table_row(shown, "kd") == ["kd", "2.000", "0.0%", *twice, *half, *three_quarters, "reference"]
        assert table_row(shown, "embree")[6:] == [*one, *half, "identical"]
        assert table_row(shown, "native")[-1] == "BIAS"
        assert table_row(shown, FREE)[3:] == ["8.00", "[8.00,", "8.00]", *twice, "-", "identical"]
        means = shown.partition("geometric means over 2 scenes")[2]
        assert table_row(means, "kd") == ["kd", *twice, *half, "0.75"]
        assert table_row(means, FREE) == [FREE, "8.00", "[8.00,", "8.00]", *twice, "-"]
        assert "room, 30 triangles: 256x256, 4 spp" in shown
        assert legend(1) in (out / "table.md").read_text()
        assert "user-geometry callback" in legend(1)

    def test_more_threads_are_timed_on_the_clock_and_trace_nothing_for_free(
        self, workers: Workers, scenes: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        out = tmp_path / "out"
        assert bench(*scenes, "--threads", "2", "--out", str(out), "--specs", *SPECS) == 0
        shown = capfd.readouterr().out
        assert {row["spec"] for row in rows(out)} == set(SPECS)
        assert all(row["frame_s"] == row["wall_s"] == CPU_S[row["spec"]] + 1 for row in rows(out))
        assert "traversal" not in shown and FREE not in shown and FREE not in legend(2)

    def test_without_the_baselines_there_is_nothing_to_be_compared_with(
        self, workers: Workers, scenes: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        assert bench(*scenes, "--threads", "2", "--out", str(tmp_path / "out"), "--specs", "kd") == 0
        shown = capfd.readouterr().out
        assert table_row(shown, "kd") == ["kd", "3.000", "0.0%", "-", "-", "reference"]
        assert table_row(shown.partition("geometric means")[2], "kd") == ["kd", "-", "-"]

    def test_a_scene_that_fails_leaves_the_others_and_has_another_turn(
        self, workers: Workers, scenes: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        words = [*scenes, "--threads", "2", "--out", str(tmp_path / "out"), "--specs", *SPECS]
        workers.failing = {"room"}
        assert bench(*words) == 1
        assert "failed: room, frames: the worker was killed" in capfd.readouterr().out
        assert {row["scene"] for row in rows(tmp_path / "out")} == {"other"}
        workers.failing = set()
        assert bench(*words) == 0
        assert [Path(job.scene).stem for job in workers.jobs] == ["room", "other", "room"]
        assert "1 of 2 jobs were finished" in capfd.readouterr().err
        assert len(rows(tmp_path / "out")) == 2 * REPEATS * len(SPECS)

    def test_new_specs_measure_all_again_side_by_side(
        self, workers: Workers, scenes: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        words = [scenes[0], "--threads", "1", "--out", str(tmp_path / "out"), "--specs", "native", "kd"]
        assert bench(*words) == bench(*words) == 0
        assert len(workers.jobs) == 1
        assert bench(*words, "embree") == 0
        assert [list(job.specs) for job in workers.jobs] == [["native", "kd"], ["native", "kd", "embree"]]

    def test_other_settings_do_not_mix(
        self, workers: Workers, scenes: list[str], tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        words = [scenes[0], "--out", str(tmp_path / "out"), "--specs", "kd"]
        assert bench(*words, "--threads", "2") == 0
        assert bench(*words, "--threads", "1") == 2
        assert "with threads 2, but this run has 1: choose another --out" in capfd.readouterr().err


class TestFrames:
    """What a worker does, on a real scene."""

    @pytest.fixture(autouse=True)
    def _one_thread(self) -> Iterator[None]:
        before = dr.thread_count()
        dr.set_thread_count(1)
        yield
        dr.set_thread_count(before)

    @pytest.fixture
    def job(self, room: Path, tmp_path: Path) -> Job:
        fields = {"spp": 2, "resolution": 16, "specs": SPECS, "repeats": 2, "streams": str(tmp_path / "room.rays")}
        return Job("frames", str(room), "scalar_rgb", **fields)

    def test_every_repetition_gives_each_a_turn_and_progress_is_told(self, job: Job, tmp_path: Path) -> None:
        stages: list[str] = []
        before = sorted(tmp_path.iterdir())
        found = frame_jobs.time_frames(job, stages.append)
        turns = [[run["spec"] for run in found["runs"] if run["repeat"] == repeat] for repeat in range(2)]
        assert all(set(turn) == {*SPECS, FREE} and len(turn) == 5 for turn in turns) and turns[0] != turns[1]
        assert all(run["cpu_s"] > 0 and run["wall_s"] > 0 for run in found["runs"])
        assert found["images"][FREE]["verdict"] == found["images"]["normals:k=4"]["verdict"] == "identical"
        assert {image["reference"] for image in found["images"].values()} == {"kd"}
        assert f"rendering {job.scene} with {turns[0][0]}, 0%" in stages
        assert f"rendering {job.scene} with {turns[1][4]}, 90%" in stages
        assert sorted(tmp_path.iterdir()) == before

    @pytest.mark.parametrize("spec", ["kd", "native", "embree"])
    def test_scenes_that_share_their_objects_do_not_disturb_one_another(self, job: Job, spec: str) -> None:
        def image(scene: mi.Scene) -> str:
            return render(job, scene, print, 2).sha256

        def made(loaded: object, text: str) -> mi.Scene:
            return construct(Job("frames", job.scene, job.variant, spec=text), loaded, print)[0]

        shared = load(job, print)
        scenes = {text: made(shared, text) for text in ("kd", "native", "embree", "normals")}
        for scene in scenes.values():
            render(job, scene, print, 1)
        assert image(scenes[spec]) == image(scenes[spec]) == image(made(load(job, print), spec))

    def test_another_image_for_free_is_an_error(self, job: Job, monkeypatch: pytest.MonkeyPatch) -> None:
        real = frame_jobs.render

        def off(own: Job, scene: mi.Scene, stage: Callable[[str], None], spp: int) -> Frame:
            frame = real(own, scene, stage, spp)
            return Frame(np.nextafter(frame.pixels, 9), 1, 1) if own.spec == FREE else frame

        monkeypatch.setattr(frame_jobs, "render", off)
        with pytest.raises(ValueError, match=r"room.xml with the recorded answers of kd is another image than with kd"):
            frame_jobs.time_frames(job, print)


def test_a_built_in_scene(command: Command, tmp_path: Path) -> None:
    words = ["bench", "render", scenes_dir() / "knot.xml", "--resolution", "16", "--spp", "1", "--out", "out"]
    result = command(*words, "--threads", "1", "--specs", *SPECS)
    assert result.returncode == 0, result.stderr
    found = rows(tmp_path / "out")
    runs = {(row["spec"], row["repeat"]) for row in found}
    assert len(runs) == len(found) == REPEATS * (len(SPECS) + 1)
    assert {row["image_difference"]["verdict"] for row in found if row["spec"] in (FREE, "normals:k=4")} == {
        "identical"
    }
    for text in (result.stdout, (tmp_path / "out" / "table.md").read_text()):
        assert all(spec in text for spec in (*SPECS, FREE, "traversal"))
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"asked.jsonl", "records.jsonl", "table.md"}
    again = command(*words, "--threads", "1", "--specs", *SPECS)
    assert again.returncode == 0 and "1 of 1 jobs were finished" in again.stderr
    assert again.stdout == result.stdout and rows(tmp_path / "out") == found


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["gone.xml"], "there is no scene file"),
        (["room.xml", "--specs", FREE], 'there is no accelerator "free"'),
        (["room.xml", "--repeats", "6"], "--repeats is 6, but it must be at least 7"),
        (["room.xml", "--out", "room.xml"], "cannot write to the output folder room.xml"),
        (["empty.xml"], "empty.xml has no triangle mesh, so there is nothing to trace rays in"),
    ],
)
@pytest.mark.usefixtures("room")
def test_bad_input(command: Command, tmp_path: Path, words: list[str], sentence: str) -> None:
    (tmp_path / "empty.xml").write_text(scene_xml('<shape type="sphere"/>'))
    before = sorted(path.name for path in tmp_path.iterdir())
    result = command("bench", "render", *words)
    assert result.returncode == 2, result.stderr
    assert sentence in error_line(result)
    assert sorted(path.name for path in tmp_path.iterdir()) == before
