"""`mitsuba-bsp verify`: what it prints and leaves behind, resumption, interruption, replay, and bad input."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp import cli, verify_cli
from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification import checks_wrapper, report
from mitsuba_bsp.verification import replay as verification_replay
from mitsuba_bsp.verification.cases import FOLDER, Case, case_from, permanent_cases, read_case
from mitsuba_bsp.verification.check import Check, Failure, Outcome, Plan, Subject, Unit, all_checks, rate_bound
from mitsuba_bsp.verification.meshes import boxes
from mitsuba_bsp.verification.rays import Rays
from mitsuba_bsp.verification.replay import replay
from mitsuba_bsp.verification.report import cells, own_tables
from mitsuba_bsp.verification.runner import Listener, run
from mitsuba_bsp.verification.subjects import default_subjects, trees

Command = Callable[..., subprocess.CompletedProcess[str]]

QUICK = ["--only", "C01", "cases", "--specs", "kd", "normals:k=4", "--scale", "0.01", "--seed", "7"]


def rows(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]


def test_a_run_and_the_same_again(command: Command, tmp_path: Path) -> None:
    result = command("verify", *QUICK, "--out", "out")
    assert result.returncode == 0, result.stderr
    lines = [line for line in result.stdout.splitlines() if " passed " in line]
    assert [line.split()[0] for line in lines] == ["C01", "cases"]
    assert "21,600 rays, 0 wrong (worst: -; rate < 1.4e-04), 2 specs" in lines[0]
    found = rows(tmp_path / "out")
    assert sorted((row["check"], row["spec"]) for row in found) == [
        (check, spec) for check in ("C01", "cases") for spec in ("kd", "normals:k=4")
    ]
    assert all(row["seed"] == 7 and row["mitsuba_bsp"] and row["seconds"] >= 0 for row in found)
    assert all(("k=4" in row["spec_full"]) == ("k=4" in row["spec"]) for row in found)
    assert "| C01" in (tmp_path / "out" / "table.md").read_text()

    again = command("verify", *QUICK, "--out", "out")
    assert again.returncode == 0 and "21,600 rays" in again.stdout
    assert rows(tmp_path / "out") == found
    text = (tmp_path / "out" / "table.md").read_text()
    assert text.startswith("# Verification\n\nSeed 7, all counts times 0.01. ")
    (tmp_path / "out" / "table.md").unlink()
    assert command("tables", "out").returncode == 0
    assert (tmp_path / "out" / "table.md").read_text() == text
    other = command("verify", *QUICK[:-1], "8", "--out", "out")
    assert other.returncode == 0 and len(rows(tmp_path / "out")) == 2 * len(found)
    assert "Seed 8, all counts" in (tmp_path / "out" / "table.md").read_text()


def test_what_failed_is_in_the_tables(command: Command, tmp_path: Path) -> None:
    assert command("verify", *QUICK, "--out", "out").returncode == 0
    found = rows(tmp_path / "out")
    found[0] |= {"wrong": {"edge": 1}, "failures": ["a ray is lost"]}
    (tmp_path / "out" / "records.jsonl").write_text("".join(json.dumps(row) + "\n" for row in found))
    checks, failures = report.tables(found)[0], report.tables(found)[-1]
    assert {row[0]: row[-1] for row in checks.rows} == {"C01": "FAILED", "cases": "passed"}
    assert failures.rows == (("C01", "a ray is lost"),)
    assert command("report", "out").returncode == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "a ray is lost" in page and "Seed 7, all counts times 0.01" in page


def test_ctrl_c_keeps_what_is_finished(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "mitsuba_bsp", "verify", "--only", "C01", "--scale", "0.1", "--out", "out"]
    with subprocess.Popen(words, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        deadline = time.monotonic() + 60
        while not (tmp_path / "out" / "records.jsonl").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "what was finished is kept in out, --out out goes on from there" in errors
    assert 1 <= len(rows(tmp_path / "out")) < len(default_subjects())


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--only", "C1"], 'there is no check "C1", did you mean "C'),
        (["--specs", "oak"], 'spec "oak": there is no accelerator "oak"'),
        (["--specs", "embree"], 'spec "embree": only trees can be verified (valid names: auto, kd, '),
        (["--replay", "none.json"], "there is no case file none.json"),
        (["--replay", "broken.json"], "broken.json is not a case: "),
        (["--replay", "other.json"], "other.json is not a case: it has no 'vertices'"),
        (["--out", "file/below"], "file/below"),
    ],
)
def test_bad_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, words: list[str], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("broken.json").write_text("{")
    Path("other.json").write_text('{"why": "", "mesh": "none"}')
    Path("file").write_text("")
    with pytest.raises(SystemExit) as stopped:
        cli.main(["verify", *words])
    assert stopped.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("mitsuba-bsp: error: ") and sentence in line


@pytest.mark.parametrize("words", [["--scale", "0"], ["--scale", "many"], ["--seed", "-1"]])
def test_bad_numbers(capsys: pytest.CaptureFixture[str], words: list[str]) -> None:
    with pytest.raises(SystemExit) as stopped:
        cli.main(["verify", *words])
    assert stopped.value.code == 2
    assert f"argument {words[0]}: {words[1]} is not a " in capsys.readouterr().err


def test_a_case_is_replayed(command: Command) -> None:
    result = command("verify", "--replay", FOLDER / "shared-edge.json", "--specs", "kd")
    assert result.returncode == 0, result.stderr
    for text in ("exactly: triangle", "expected with triangle_test=mt: nothing", "  kd: triangle", "embree:robust"):
        assert text in result.stdout
    assert "0 answers are wrong" in result.stdout


class Silent(Listener):
    """It only remembers."""

    def __init__(self) -> None:
        self.done = 0
        self.kept = 0

    def begin(self, check: Check, units: int, kept: int) -> None:
        self.kept = kept

    def unit_done(self) -> None:
        self.done += 1


def plan(folder: Path | None) -> Plan:
    return Plan((Subject(parse_spec("kd"), 1.0), Subject(parse_spec("ize"), 0.1)), folder=folder, scale=0.5)


def checked(*units: Unit) -> Check:
    return Check("T01", "a test", lambda _: iter(units))


def test_a_failure_leaves_a_case_that_can_be_replayed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Here the case claims that a ray hits which does not."""
    mesh = boxes("cube", [((-1, -1, -1), (1, 1, 1))])
    ray = (np.float32([[0.1, 0.2, 5]]), np.float32([[0, 0, 1]]), np.float32([np.inf]))
    case = Case("it should hit", mesh, *ray, hits=(True,), spec="kd", seed=1)

    def fail() -> Outcome:
        outcome = Outcome()
        outcome.add("vertex", 100, 2, lambda: Failure("a ray is lost", case.to_json()))
        outcome.add("edge", 100)
        return outcome

    (result,) = run([checked(Unit("one", "kd", fail))], plan(tmp_path), Silent())
    assert not result.passed and result.wrong == {"vertex": 2} and result.tried == {"rays": 200}
    (text,) = result.failures
    file = Path(text.partition("--replay ")[2])
    again = read_case(file)
    assert np.array_equal(again.mesh.vertices, mesh.vertices) and np.array_equal(again.maxt, ray[2])
    assert case_from(again.to_json()) is not None and again.to_json() == case.to_json()
    assert replay(file, [parse_spec("ize")], verify_cli.out) == 2
    assert "ize: nothing WRONG" in capsys.readouterr().out


def test_exceptions_are_failures_and_are_tried_again(tmp_path: Path) -> None:
    calls = []

    def work() -> Outcome:
        calls.append(0)
        if len(calls) == 1:
            raise MemoryError
        return Outcome(tried=5)

    check = checked(Unit("one", "kd", work), Unit("two", "", lambda: Outcome(tried=1)))
    (first,) = run([check], plan(tmp_path), Silent())
    again = "again: mitsuba-bsp verify --only T01 --specs kd --seed 1 --scale 0.5"
    assert first.failures == [f"one: MemoryError: out of memory; {again}"] and first.wrong == {"exception": 1}
    listener = Silent()
    (second,) = run([check], plan(tmp_path), listener)
    assert second.passed and (listener.kept, listener.done) == (1, 1)


def test_what_promises_nothing_is_told_and_not_judged() -> None:
    outcome = Outcome(judged=False)
    outcome.add("edge", 10, 3)
    promising = checked(
        Unit("one", "kd:precision=fast", lambda: outcome),
        Unit("two", "kd", lambda: Outcome(tried=5)),
        Unit("of no spec", "", lambda: outcome),
        Unit("an incumbent", "native", lambda: outcome),
    )
    (result,) = run([checked(Unit("one", "kd:precision=fast", lambda: outcome))], plan(None), Silent())
    assert result.passed and result.wrong == {"edge": 3} and cells(result)[-1] == "reported"
    (mixed,) = run([promising], plan(None), Silent())
    assert mixed.passed and mixed.wrong == {} and cells(mixed)[-1] == "passed"
    (table,) = own_tables([mixed])
    assert table.rows == (("precision=fast", "10", "3", "300,000", "kd, T01", "edge", "3 of 10"),)


def test_a_ray_lost_in_a_mitsuba_scene_is_asked_there_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    lost = checks_wrapper.answers

    def losing(scene: object, rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        t, triangle, any_hit = lost(scene, rays)
        return np.where(np.arange(len(t)) == np.isfinite(t).argmax(), np.float32(np.inf), t), triangle, any_hit

    def mistaking(scene: object, rays: Rays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        t, triangle, any_hit = lost(scene, rays)
        return t, np.where(triangle >= 0, triangle ^ 1, triangle), any_hit

    monkeypatch.setattr(checks_wrapper, "answers", losing)
    (unit, *_) = all_checks()["C16"].units(plan(tmp_path))
    (result,) = run([checked(unit)], plan(tmp_path), Silent())
    file = Path(result.failures[0].partition("--replay ")[2])
    assert read_case(file).through == "fast" and replay(file, [], verify_cli.out) == 0
    shown = capsys.readouterr().out
    assert "normals in a Mitsuba scene: triangle " in shown and " of its part, t=" in shown
    for wrong in (losing, mistaking):
        monkeypatch.setattr(verification_replay, "answers", wrong)
        assert replay(file, [], verify_cli.out) == 1


def test_permanent_cases_are_replayed_as_they_are_judged() -> None:
    specs = [parse_spec(text) for text in ("kd", "kd:triangle_test=mt")]
    assert [replay(file, specs, verify_cli.out) for file in sorted(FOLDER.glob("*.json"))] == [0] * len(
        permanent_cases()
    )


def test_counts_and_random_numbers() -> None:
    small = plan(None)
    assert small.count(1000) == 500 and small.count(1000, small.subjects[1]) == 50 and small.count(1) == 1
    assert small.rng("a", 1).random() == small.rng("a", 1).random() != small.rng("a", 2).random()


def test_the_rate_that_is_excluded() -> None:
    """95 %: 3/n if nothing was wrong; by Poisson's law 4.74/n after one failure."""
    assert rate_bound(0, 1000) == pytest.approx(3e-3, rel=2e-3)
    assert rate_bound(1, 1000) == pytest.approx(4.744e-3, rel=1e-3)
    assert rate_bound(0, 0) == 1


def test_every_tree_and_every_named_value_is_a_subject() -> None:
    subjects = default_subjects()
    texts = [subject.spec.text for subject in subjects]
    assert len(set(texts)) == len(texts)
    assert [subject.spec.text for subject in subjects if subject.share == 1] == trees()
    assert {"normals:axes=none", "kd:layout=binary", "ize:triangle_test=mt", "rbsp:directions=spiral"} <= set(texts)
    assert all(subject.share == 1 for subject in default_subjects(everything_in_full=True))


def test_the_results_of_another_command_are_left_alone(command: Command, tmp_path: Path) -> None:
    records = tmp_path / "out" / "records.jsonl"
    records.parent.mkdir()
    records.write_text('{"scene": "room", "spec": "kd"}\n')
    result = command("verify", *QUICK, "--out", "out")
    assert result.returncode == 2 and "out has the results of another command" in result.stderr
    assert records.read_text() == '{"scene": "room", "spec": "kd"}\n'
