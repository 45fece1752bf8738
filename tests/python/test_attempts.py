"""Jobs of a measurement: what the listener hears, and what a failure leaves."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mitsuba_bsp import scheduling
from mitsuba_bsp.attempts import Attempt, Attempts
from mitsuba_bsp.comparison import Failure, SceneInfo
from mitsuba_bsp.jobs import Job, JobError, JobResult
from mitsuba_bsp.records import ResultsFolder
from mitsuba_bsp.scene_content import Content

SCENE = SceneInfo("room", Path("room.xml"), "h", Content(30, 2, {}), 4, (8, 6), box_filter=True, fixed_blocks=True)
JOB = Job("time", "room.xml", "scalar_rgb", spec="kd")


class Listener:
    """Writes down what it is told, in order."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, object]] = []

    def note(self, text: str) -> None:
        self.heard.append(("note", text))

    def start(self, scenes: Sequence[SceneInfo], jobs: int, done: int) -> None:
        raise AssertionError("not for a single job to say")

    def begin(self, job: str) -> None:
        self.heard.append(("begin", job))

    def finish(self) -> None:
        self.heard.append(("finish", ""))

    def fail(self, failure: Failure) -> None:
        self.heard.append(("fail", failure))


@pytest.fixture
def listener() -> Listener:
    return Listener()


@pytest.fixture
def attempts(tmp_path: Path, listener: Listener) -> Attempts:
    return Attempts(ResultsFolder(tmp_path), listener)


def run(attempts: Attempts, what: str) -> list[JobResult]:
    """The result of one job, if it has any."""
    return [result for _, result in attempts.run([what], lambda _: Attempt(SCENE, what, JOB, f"room: {what}"))]


def test_stages_are_shown_in_a_word(
    attempts: Attempts, listener: Listener, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def work(job: Job, on_stage: Callable[[str], None]) -> JobResult:
        for stage in ("starting", "loading room.xml", "building kd for room.xml, 42%"):
            on_stage(stage)
        return JobResult({"build_s": 1}, ())

    monkeypatch.setattr(scheduling, "run_job", work)
    assert run(attempts, "kd") == [JobResult({"build_s": 1}, ())]
    begun = ["room: kd", "room: kd (starting)", "room: kd (loading)", "room: kd (building 42%)"]
    assert listener.heard == [*(("begin", text) for text in begun), ("finish", "")]
    assert attempts.failures == [] and list(tmp_path.iterdir()) == []


def test_warnings_and_notes_are_passed_on_once(
    attempts: Attempts, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scheduling, "run_job", lambda *_: JobResult({}, ("it is hot", "it is late")))
    attempts.note("room: it is hot")
    for _ in range(2):
        run(attempts, "kd")
    assert [text for kind, text in listener.heard if kind == "note"] == ["room: it is hot", "room: it is late"]


def test_a_failure_is_told_kept_and_written_down(
    attempts: Attempts, listener: Listener, monkeypatch: pytest.MonkeyPatch
) -> None:
    def work(*_: object) -> JobResult:
        raise JobError("the worker was killed")

    monkeypatch.setattr(scheduling, "run_job", work)
    assert run(attempts, "replay") == []
    failure = Failure("room", "replay", "the worker was killed")
    assert attempts.failures == [failure]
    assert listener.heard == [("begin", "room: replay"), ("fail", failure), ("finish", "")]
    written = attempts.folder.failures_file.read_text()
    assert json.loads(written) == {"scene": "room", "spec": "replay", "message": "the worker was killed"}
