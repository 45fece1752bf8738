"""`mitsuba-bsp bench rays` and `calibrate`: what they print and leave behind, resumption, and bad input."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import error_line, scene_xml

from mitsuba_bsp import calibrate_cli, cli, scheduling
from mitsuba_bsp.bench_rays_table import closest_hits
from mitsuba_bsp.jobs import Job, JobError, JobResult, run_job
from mitsuba_bsp.speeds import ratios
from mitsuba_bsp.streams import is_recorded, load

Command = Callable[..., subprocess.CompletedProcess[str]]

SPECS = ["native", "embree", "kd", "normals:k=4"]
WORDS = ["--resolution", "24", "--out", "out", "--specs", *SPECS]


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


class TestBenchRays:
    """A real run on a small scene."""

    @pytest.fixture
    def finished(self, room: Path, command: Command, tmp_path: Path) -> subprocess.CompletedProcess[str]:
        result = command("bench", "rays", room, *WORDS)
        assert result.returncode == 0, result.stderr
        return result

    def test_what_is_shown_and_kept(self, finished: subprocess.CompletedProcess[str], tmp_path: Path) -> None:
        found = rows(tmp_path / "out")
        runs = {(row["spec"], row["stream"], row["repeat"]) for row in found}
        assert len(runs) == len(found) == len(SPECS) * 3 * 7
        assert all(row["ns_per_ray"] > 0 and row["wall_s"] > 0 for row in found)
        assert all(row["ns_per_ray"] * row["mrays_per_s"] == pytest.approx(1000) for row in found)
        assert {bool(row["counters"]) for row in found if row["spec"] == "embree"} == {False}
        order = [row["spec"] for row in found if row["stream"] == "camera"]
        assert len({tuple(order[i : i + len(SPECS)]) for i in range(0, len(order), len(SPECS))}) > 1
        written = (tmp_path / "out" / "table.md").read_text()
        for text in (finished.stdout, written):
            assert all(spec in text for spec in SPECS)
            assert re.search(r"room, 30 triangles: 1,152 camera rays, [0-9a-f]{12}", text)
            assert "1.00 [1.00, 1.00]" in text

    def test_streams_and_trees_are_hashed(self, finished: subprocess.CompletedProcess[str], tmp_path: Path) -> None:
        streams = {stream.kind: stream.sha256() for stream in load(tmp_path / "out" / "streams" / "room.npz")}
        for row in rows(tmp_path / "out"):
            assert row["stream_sha256"] == streams[row["stream"]]
            assert row["tree_sha256"] is None if row["spec"] == "embree" else len(row["tree_sha256"]) == 64
        assert finished.returncode == 0

    def test_a_second_run_repeats_nothing_but_what_is_new(
        self, finished: subprocess.CompletedProcess[str], room: Path, command: Command, tmp_path: Path
    ) -> None:
        before = rows(tmp_path / "out")
        result = command("bench", "rays", room, *WORDS)
        assert result.returncode == 0 and "2 of 2 jobs were finished" in result.stderr
        assert rows(tmp_path / "out") == before
        assert result.stdout == finished.stdout
        result = command("bench", "rays", room, *WORDS, "random")
        assert result.returncode == 0, result.stderr
        after = rows(tmp_path / "out")
        assert after[: len(before)] == before and len(after) == len(before) + (len(SPECS) + 1) * 3 * 7
        assert {row["stream_sha256"] for row in after} == {row["stream_sha256"] for row in before}

    def test_other_settings_do_not_mix(
        self, finished: subprocess.CompletedProcess[str], room: Path, command: Command
    ) -> None:
        result = command("bench", "rays", room, *WORDS, "--resolution", "25")
        assert finished.returncode == 0 and result.returncode == 2
        assert "resolution" in error_line(result) and "choose another --out" in error_line(result)

    def test_fewer_rays_are_a_sample(self, room: Path, command: Command, tmp_path: Path) -> None:
        result = command("bench", "rays", room, *WORDS, "kd", "--max-rays", "100")
        assert result.returncode == 0, result.stderr
        assert "100 (of 1,152) camera rays" in result.stdout
        assert {row["rays"] for row in rows(tmp_path / "out")} == {100}

    def test_a_scene_that_fails_leaves_the_others(
        self, room: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        other = room.with_name("other.xml")
        other.write_text(room.read_text())

        def run(job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
            if job.kind == "replay" and "room" in job.scene:
                raise JobError("the worker was killed")
            return run_job(job, on_stage)

        monkeypatch.setattr(scheduling, "run_job", run)
        folder = room.with_name("out")
        words = ["--resolution", "8", "--specs", "kd", "--out", str(folder)]
        with pytest.raises(SystemExit) as caught:
            cli.main(["bench", "rays", str(room), str(other), *words])
        assert caught.value.code == 1
        assert "failed: room, replay: the worker was killed" in capfd.readouterr().out
        assert {row["scene"] for row in rows(folder)} == {"other"}
        monkeypatch.setattr(scheduling, "run_job", run_job)
        with pytest.raises(SystemExit) as caught:
            cli.main(["bench", "rays", str(room), str(other), *words])
        assert caught.value.code == 0
        assert {row["scene"] for row in rows(folder)} == {"room", "other"}


def test_closest_hit_rays_are_camera_and_bounce_rays_as_the_frame_has_them() -> None:
    runs = [("camera", 10.0, 100), ("shadow", 99.0, 100), ("bounce", 40.0, 300)]
    rows = [
        {"spec": "kd", "repeat": repeat, "stream": stream, "ns_per_ray": ns + repeat, "recorded_rays": rays}
        for repeat in (0, 1)
        for stream, ns, rays in runs
    ]
    found = closest_hits(rows)
    assert [(row["repeat"], row["ns_per_ray"]) for row in found] == [(0, 32.5), (1, 33.5)]


def test_what_is_left_out_is_said(command: Command, tmp_path: Path) -> None:
    """Spheres, what is in shape groups, and the kind of rays that no near plane gives away."""
    group = '<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="instance"><ref id="g"/></shape>'
    film = '<film type="hdrfilm"><integer name="width" value="1"/><integer name="height" value="1"/></film>'
    shapes = f'<shape type="cube"/><shape type="sphere"/>{group}<emitter type="constant"/>'
    (tmp_path / "odd.xml").write_text(
        f'<scene version="3.0.0"><integrator type="path"/><sensor type="distant">{film}</sensor>{shapes}</scene>'
    )
    result = command("bench", "rays", "odd.xml", "--resolution", "1", "--spp", "8", "--specs", "kd", "--out", "out")
    assert result.returncode == 0, result.stderr
    said = " ".join(result.stderr.split())
    assert "odd: these shapes are no triangle meshes, so they are left out here: 1 Sphere" in said
    assert "odd: what is in shape groups is left out here" in said
    assert "camera rays of the sensor DistantSensor" in said and "cannot be told apart" in said
    assert "accelerator of its own" not in said
    assert "odd, 12 triangles:" in result.stdout and "camera rays" not in result.stdout
    whole = command("bench", "render", "odd.xml", "--resolution", "1", "--spp", "8", "--specs", "kd", "--out", "frames")
    assert whole.returncode == 0, whole.stderr
    assert "left out" not in whole.stderr and "accelerator of its own" in " ".join(whole.stderr.split())


def test_a_scene_with_nothing_but_shape_groups_is_refused(room: Path, command: Command, tmp_path: Path) -> None:
    group = '<shape type="shapegroup" id="g"><shape type="cube"/></shape><shape type="instance"><ref id="g"/></shape>'
    odd = tmp_path / "odd.xml"
    odd.write_text(scene_xml(group))
    result = command("bench", "rays", room, odd, "--specs", "kd", "--out", "out")
    assert result.returncode == 2
    reason = f"all triangle meshes of {odd} are in shape groups, so there is nothing to trace rays in"
    assert error_line(result) == reason
    assert not (tmp_path / "out" / "streams").exists()


@pytest.mark.parametrize(
    ("texts", "found"), [(["native:kd_stop_prims=4"], [4.0]), (["native:kd_stop_prims=4", "native"], [2.0])]
)
def test_a_baseline_with_settings_is_one_if_there_is_no_other(texts: list[str], found: list[float]) -> None:
    rows = [{"spec": text, "repeat": 0, "s": 4.0 / (place + 1)} for place, text in enumerate(texts)]
    own = {"spec": "kd", "repeat": 0, "s": 1.0}
    assert ratios([own, {**own, "repeat": 1}], [*rows, own], "native", "s") == found


def test_a_changed_stream_file_is_refused(room: Path, command: Command, tmp_path: Path) -> None:
    command("bench", "rays", room, "--resolution", "8", "--specs", "kd", "--out", "out")
    file = tmp_path / "out" / "streams" / "room.npz"
    with np.load(file) as arrays:
        changed = dict(arrays)
    changed["camera_maxt"][0] = 1
    np.savez(file, **changed)
    with pytest.raises(ValueError, match=r"the rays in .*room\.npz are not those that were recorded"):
        load(file)
    origin = json.loads(str(changed["origin"]))
    assert is_recorded(file, origin) and not is_recorded(file, {**origin, "spp": 99})
    assert not is_recorded(tmp_path / "gone.npz", origin)


def test_calibrate(room: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """With few trees, and without the built-in scenes."""
    monkeypatch.setattr(calibrate_cli, "chosen_scenes", tuple)
    fine = "intersection_cost=4"  # or the room would be one leaf
    specs = (f"kd:{fine}", f"kd:leaf_size=8,{fine}", f"random:alpha=0,{fine}", f"random:axes=none,alpha=0,{fine}")
    monkeypatch.setattr(calibrate_cli, "SPECS", specs)
    folder = room.with_name("out")
    with pytest.raises(SystemExit) as caught:
        cli.main(["calibrate", str(room), "--resolution", "16", "--out", str(folder)])
    shown = capfd.readouterr()
    assert caught.value.code == 0, shown.err
    for text in (shown.out, (folder / "table.md").read_text()):
        assert all(word in text for word in ("axis_cost", "oblique_cost", "intersection_cost", "R²", "room"))
    assert len(rows(folder)) == 4 * 3 * 3


class TestBadInput:
    """Each mistake: status 2, one sentence, and nothing left behind."""

    @pytest.mark.parametrize(
        ("words", "sentence"),
        [
            (["bench", "rays", "gone.xml"], "there is no scene file"),
            (["bench", "rays", "room.xml", "--specs", "kd", "oak"], 'there is no accelerator "oak"'),
            (["bench", "rays", "room.xml", "--repeats", "6"], "--repeats is 6, but it must be at least 7"),
            (["bench", "rays", "room.xml", "--out", "room.xml"], "cannot write to the output folder room.xml"),
            (["bench", "rays", "room.xml", "-D", "colour=red"], "$colour=red"),
            (["bench", "rays", "wild.xml"], "wild.ply"),
            (["bench", "rays", "empty.xml"], "empty.xml has no triangle"),
            (["calibrate", "gone.xml"], "there is no scene file"),
            (["calibrate", "--repeats", "1"], "--repeats is 1, but it must be at least 3"),
        ],
    )
    @pytest.mark.usefixtures("room", "wild")
    def test_one_sentence_and_status_2(self, command: Command, tmp_path: Path, words: list[str], sentence: str) -> None:
        (tmp_path / "empty.xml").write_text(scene_xml('<shape type="sphere"/>'))
        before = sorted(path.name for path in tmp_path.iterdir())
        result = command(*words)
        assert result.returncode == 2, result.stderr
        assert sentence in error_line(result)
        assert "Traceback" not in result.stderr
        assert sorted(path.name for path in tmp_path.iterdir()) == before

    @pytest.mark.parametrize("words", [["bench"], ["bench", "fish"], ["bench", "rays", "--max-rays", "0"]])
    def test_arguments_that_make_no_sense(self, command: Command, words: list[str]) -> None:
        result = command(*words)
        assert result.returncode == 2
        assert "error: " in result.stderr and "Traceback" not in result.stderr
