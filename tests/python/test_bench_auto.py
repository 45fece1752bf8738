"""`mitsuba-bsp bench auto`: building and rendering together, what is said of it, resumption, and the choice's hint."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import pytest
from conftest import error_line

import mitsuba_bsp
from mitsuba_bsp import cli, parse_spec, scheduling
from mitsuba_bsp.expected_rays import RAYS_PER_SAMPLE, with_expected_rays
from mitsuba_bsp.jobs import Job, JobResult, run_job
from mitsuba_bsp.loading import open_file
from mitsuba_bsp.spec import shortest
from mitsuba_bsp.total_jobs import turns

Command = Callable[..., subprocess.CompletedProcess[str]]

SPECS = ["auto", "native", "embree", "kd", "normals"]
REPEATS = 3

#: Seconds to build, and of a sample.
TIMES = {"native": (4.0, 4.0), "embree": (0.5, 1.0), "kd": (1.0, 2.0), "normals": (2.0, 1.5)}


def totals(job: Job) -> JobResult:
    """Of an `auto` that takes kd for a preview and normals for all else."""
    runs = []
    samples, seed = job.choices["samples"], job.choices["turned"]
    for repeat in range(job.repeats):
        for turn in turns(list(job.specs), list(samples), seed is not None):
            same = {"auto": "kd" if turn.spp == 1 else "normals"}.get(turn.spec, turn.spec)
            build_s, sample_s = TIMES[same]
            measured = {min(job.spp, spp) for spp in ([turn.spp] if turn.spp else samples)}
            factor = 1.5 if turn.turned and same == "kd" else 1
            runs.append(
                {
                    "repeat": repeat,
                    "spec": turn.spec,
                    "for_spp": turn.spp,
                    "turned": turn.turned,
                    "build_s": build_s,
                    "tree_s": build_s,
                    "frames_s": {str(spp): factor * spp * sample_s for spp in measured},
                    "chosen": parse_spec(same).full,
                    "choice": "",
                    "choose_s": build_s / 20,
                    "predicted_build_s": 3.0,
                    "predicted_trace_s": 7.0,
                }
            )
    return JobResult({"runs": runs}, ())


@pytest.fixture
def jobs(monkeypatch: pytest.MonkeyPatch) -> list[Job]:
    found: list[Job] = []

    def run(job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
        if job.kind != "totals":
            return run_job(job, on_stage)
        found.append(job)
        return totals(job)

    monkeypatch.setattr(scheduling, "run_job", run)
    return found


def bench(*words: object) -> int:
    """The exit status of `bench auto`, run in this process."""
    with pytest.raises(SystemExit) as caught:
        cli.main(["bench", "auto", *map(str, words)])
    return caught.value.code


def cells(text: str, title: str, first: str) -> list[str]:
    """The cells of the first row behind `title` that begins with `first`."""
    return next(line.split() for line in text.partition(title)[2].splitlines() if line.strip().startswith(first))


def test_tables(jobs: list[Job], room: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    other = room.with_name("other.xml")
    other.write_text(room.read_text())
    words = [room, other, "--out", tmp_path / "out", "--specs", *SPECS, "--turned", 5]
    assert bench(*words) == 0
    shown = capfd.readouterr().out
    # kd: 1 + 2 n, normals: 2 + 1.5 n, native: 4 + 4 n, embree: 0.5 + n seconds
    assert cells(shown, "room, 30 triangles", "kd") == ["kd", "1.000", "3.00", "33.00", "513.00"]
    assert cells(shown, "room, 30 triangles", "auto") == ["auto", "2.000", "3.00", "26.00", "386.00"]
    assert cells(shown, "auto at 1 samples", "room") == ["room", "kd", "kd", "1.00", "1.00", "0.38", "2.00"]
    assert cells(shown, "auto at 16 samples", "room") == ["room", "normals", "normals", "1.00", "0.79", "0.38", "1.58"]
    assert cells(shown, "auto at 16 samples", "geometric") == ["geometric", "mean", "1.00", "0.79", "0.38", "1.58"]
    assert cells(shown, "what auto foresees", "room") == [
        *["room", "1", "kd", "50.0", "5.0%", "1.00", "3.00", "2.00", "7.00"]
    ]  # fmt: skip
    assert cells(shown, "frames of the turned scenes", "room") == ["room", "1.00", "1.00", "1.00", "1.50", "1.00"]
    assert (tmp_path / "out" / "table.md").read_text().startswith("# Building and rendering together")
    assert [list(job.choices["samples"]) for job in jobs] == [[1, 16, 256]] * 2
    assert bench(*words) == 0 and len(jobs) == 2, "what is finished is kept"
    assert bench(*words, "--repeats", 4) == 0 and len(jobs) == 4


def test_a_real_run(command: Command, room: Path, tmp_path: Path) -> None:
    words = [room, "--resolution", "16", "--spp", "2", "--samples", "1", "8", "--out", "out", "--turned", "1"]
    result = command("bench", "auto", *words, "--specs", "auto", "kd", "native", "embree")
    assert result.returncode == 0, result.stderr
    rows = [json.loads(line) for line in (tmp_path / "out" / "records.jsonl").read_text().splitlines()]
    assert len(rows) == REPEATS * 2 * (2 + 3)
    assert all(row["build_s"] > 0 and min(row["frames_s"].values()) > 0 for row in rows)
    assert {tuple(row["frames_s"]) for row in rows} == {("1",), ("2",), ("1", "2")}
    for row in rows:
        assert (row["for_spp"] > 0) == (row["spec"] == "auto") == bool(row["chosen"])
    rays = 16 * 16 * RAYS_PER_SAMPLE
    assert {row["choice"].rpartition("to trace ")[2] for row in rows if row["for_spp"] == 8} == {f"{8 * rays} rays"}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["gone.xml"], "there is no scene file"),
        (["room.xml", "--repeats", "2"], "--repeats is 2, but it must be at least 3"),
        (["room.xml", "--samples", "0"], "0 is not a positive integer"),
        (["room.xml", "--specs", "oak"], 'there is no accelerator "oak"'),
    ],
)
@pytest.mark.usefixtures("room")
def test_bad_input(command: Command, words: list[str], sentence: str) -> None:
    result = command("bench", "auto", *words)
    assert result.returncode == 2, result.stderr
    assert sentence in result.stderr if "--samples" in words else sentence in error_line(result)


class TestExpectedRays:
    """The hint that the harness gives."""

    def test_it_is_pixels_samples_and_a_constant(self, room: Path) -> None:
        sensor = open_file(room, params={"res": "20"}).sensor
        for spp, samples in ((None, 4), (7, 7)):
            found = with_expected_rays(parse_spec("auto:seed=3"), sensor, spp)
            assert found.settings["expected_rays"] == 20 * 20 * samples * RAYS_PER_SAMPLE
            assert found.settings["seed"] == 3 and found.text == "auto:seed=3"

    @pytest.mark.parametrize("text", ["kd", "native", "auto:expected_rays=5"])
    def test_others_and_who_names_a_number_get_none(self, room: Path, text: str) -> None:
        assert with_expected_rays(parse_spec(text), open_file(room).sensor, 9) == parse_spec(text)

    def test_a_scene_without_a_sensor_has_the_default(self) -> None:
        assert with_expected_rays(parse_spec("auto"), None, 9) == parse_spec("auto")

    def test_auto_is_the_default_of_loading(self, room: Path) -> None:
        found = mitsuba_bsp.statistics(mitsuba_bsp.load_file(room, spp=2))
        assert found["spec"].startswith("auto:") and f" {32 * 32 * 2 * RAYS_PER_SAMPLE} rays" in found["choice"]
        scene = mi.load_dict({"type": "scene", "group": {"type": "bsptree", "cube": {"type": "cube"}}})
        assert mitsuba_bsp.statistics(scene)["spec"].startswith("auto:")


def test_the_shortest_spec() -> None:
    for text in ("kd", "normals:k=9", "auto", "native", "kd:layout=binary", "normals:k=9,seed=4"):
        assert shortest(parse_spec(text).full) == text
