"""`mitsuba-bsp bench build`: what it prints and leaves behind, resumption, growth, and bad input."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import error_line, scene_xml

from mitsuba_bsp import build_jobs, cli, scheduling
from mitsuba_bsp.build_table import ratios
from mitsuba_bsp.jobs import Job, JobError, JobResult, run_job

Command = Callable[..., subprocess.CompletedProcess[str]]

SPECS = ["native", "kd", "normals:k=4"]


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


def run_here(*words: str | Path) -> int:
    """The command in this process, so that parts of it can be replaced; its exit status."""
    with pytest.raises(SystemExit) as caught:
        cli.main([str(word) for word in words])
    return caught.value.code


class FakeBuilds:
    """Stands in for worker processes: 1 s for native, 2 s for all others, and a failure where told."""

    def __init__(self) -> None:
        self.jobs: list[Job] = []
        self.failing = ""
        self.peak: int | None = 3000

    def __call__(self, job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
        self.jobs.append(job)
        if job.spec == self.failing:
            raise JobError("the worker was killed")
        phases = {name: 0.25 for name in ("directions", "estimates", "sweeps", "partition", "pack")}
        ours = {} if job.spec == "native" else {"capped_leaves": 7, "phases_s": phases}
        values = {
            "build_s": 1 if job.spec == "native" else 2,
            "peak_build_bytes": self.peak,
            "triangles": job.triangles or 30,
            "statistics": {"bytes": 600, "references": 45, **ours},
        }
        return JobResult(values, ())


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch) -> FakeBuilds:
    found = FakeBuilds()
    monkeypatch.setattr(scheduling, "run_job", found)
    return found


def test_a_real_job_measures_time_and_memory(room: Path) -> None:
    for spec in ("native", "kd"):
        found = run_job(Job("build", str(room), "scalar_rgb", spec=spec)).values
        assert found["build_s"] > 0 and found["triangles"] == found["statistics"]["triangles"] == 30
        assert found["peak_build_bytes"] is None or 0 <= found["peak_build_bytes"] < 2**30
    found = run_job(Job("grow", str(room), "scalar_rgb", spec="kd", triangles=999)).values
    assert found["triangles"] == 999 and found["statistics"]["build_s"] <= found["build_s"]


def test_memory_that_building_takes_and_gives_back_is_seen() -> None:
    _, values = build_jobs._measured(lambda: len(bytearray(64 << 20)))
    assert values["peak_build_bytes"] is None or 60 << 20 < values["peak_build_bytes"] < 80 << 20


def test_what_is_shown_and_kept(
    room: Path, fake: FakeBuilds, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = room.with_name("out")
    words = ["bench", "build", room, "--out", folder, "--specs", *SPECS]
    assert run_here(*words) == 0
    shown = capfd.readouterr().out
    assert len(fake.jobs) == 1 + 5 * len(SPECS), "one to warm up, and five of each"
    found = rows(folder)
    assert {(row["spec"], row["repeat"]) for row in found} == {(spec, i) for spec in SPECS for i in range(5)}
    order = [row["spec"] for row in found]
    assert len({tuple(order[i : i + len(SPECS)]) for i in range(0, len(order), len(SPECS))}) > 1
    for text in (shown, (folder / "table.md").read_text()):
        assert "room, 30 triangles" in text and "phases" in text
        line = next(line for line in text.splitlines() if "normals:k=4" in line)
        cells = line.replace("|", " ").split()
        assert cells[1:] == ["2.000", "0.0%", "2.00", "[2.00,", "2.00]", "100", "20", "1.50", "7"]
    assert run_here(*words) == 0
    assert len(fake.jobs) == 1 + 5 * len(SPECS) and rows(folder) == found
    assert "15 of 15 jobs were finished" in capfd.readouterr().err


def test_a_build_that_fails_leaves_the_others(room: Path, fake: FakeBuilds, capfd: pytest.CaptureFixture[str]) -> None:
    fake.failing, fake.peak = "native", None
    words = ["bench", "build", room, "--out", room.with_name("out"), "--specs", *SPECS]
    assert run_here(*words) == 1
    shown = capfd.readouterr()
    assert "failed: room, native: the worker was killed" in shown.out
    assert "peak memory is not measured" in shown.err
    assert {row["spec"] for row in rows(room.with_name("out"))} == set(SPECS[1:])
    fake.failing = ""
    assert run_here(*words) == 0
    assert {row["spec"] for row in rows(room.with_name("out"))} == set(SPECS)


def test_an_interrupted_run_goes_on(
    room: Path, fake: FakeBuilds, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def interrupted(job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
        if len(fake.jobs) == 5:
            raise KeyboardInterrupt
        return fake(job)

    words = ["bench", "build", room, "--out", room.with_name("out"), "--specs", *SPECS]
    monkeypatch.setattr(scheduling, "run_job", interrupted)
    assert run_here(*words) == 130
    assert "goes on from there" in capfd.readouterr().err
    assert len(rows(room.with_name("out"))) == 4
    monkeypatch.setattr(scheduling, "run_job", fake)
    assert run_here(*words) == 0
    assert len(rows(room.with_name("out"))) == 15


def test_ratios_are_taken_round_by_round() -> None:
    runs = [{"repeat": i, "build_s": 2.0 + i} for i in range(3)]
    baseline = [{"repeat": i, "build_s": 1.0 + i} for i in range(2)]
    assert ratios(runs, baseline) == [2, 1.5]


def test_growth(room: Path, command: Command, tmp_path: Path) -> None:
    result = command("bench", "build", room, "--growth", "--sizes", "30", "200", "900", "--specs", "kd", "--out", "out")
    assert result.returncode == 0, result.stderr
    assert [sorted(row["triangles"] for row in rows(tmp_path / "out"))] == [[30] * 3 + [201] * 3 + [900] * 3]
    for text in (result.stdout, (tmp_path / "out" / "table.md").read_text()):
        assert "exponent" in text and "n log n" in text and "900" in text
    assert (tmp_path / "out" / "growth.png").is_file() and (tmp_path / "out" / "growth.svg").is_file()


class TestBadInput:
    """Each mistake: status 2, one sentence, and nothing left behind."""

    @pytest.mark.parametrize(
        ("words", "sentence"),
        [
            (["gone.xml"], "there is no scene file"),
            (["room.xml", "--specs", "kd", "oak"], 'there is no accelerator "oak"'),
            (["room.xml", "--repeats", "4"], "--repeats is 4, but it must be at least 5"),
            (["room.xml", "--out", "room.xml"], "cannot write to the output folder room.xml"),
            (["empty.xml"], "empty.xml has no triangle"),
            (["room.xml", "--sizes", "9"], "--sizes goes with --growth only"),
            (["--growth", "room.xml", "empty.xml"], "--growth takes one scene, but there are 2: room.xml empty.xml"),
            (["--growth", "room.xml", "--repeats", "2"], "--repeats is 2, but it must be at least 3"),
            (["--growth", "room.xml", "--specs", "native"], 'there is no "native"'),
            (["--growth", "room.xml", "--sizes", "9", "10", "40"], "a fit needs 3 sizes"),
        ],
    )
    @pytest.mark.usefixtures("room")
    def test_one_sentence_and_status_2(self, command: Command, tmp_path: Path, words: list[str], sentence: str) -> None:
        (tmp_path / "empty.xml").write_text(scene_xml('<shape type="sphere"/>'))
        before = sorted(path.name for path in tmp_path.iterdir())
        result = command("bench", "build", *words)
        assert result.returncode == 2, result.stderr
        assert sentence in error_line(result)
        assert "Traceback" not in result.stderr
        assert sorted(path.name for path in tmp_path.iterdir()) == before
