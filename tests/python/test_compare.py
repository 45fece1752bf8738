"""The order of a comparison's jobs, its records, and what an interruption leaves, with jobs that cost nothing."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp import parse_spec, preflight, scheduling
from mitsuba_bsp.compare import compare
from mitsuba_bsp.compare_table import make_tables
from mitsuba_bsp.comparison import Failure, Options, SceneInfo
from mitsuba_bsp.exr import write_exr
from mitsuba_bsp.jobs import Job, JobError, JobResult
from mitsuba_bsp.machine import describe
from mitsuba_bsp.outcomes import write_outcomes
from mitsuba_bsp.records import ResultsFolder

SPECS = ("native", "embree", "kd", "normals")

CONTENT = {"triangles": 1234, "meshes": 2, "others": {}, "shape_groups": 1, "instances": 7}
COUNTERS = {"rays": 10, "axis_steps": 60, "oblique_steps": 20, "leaves_visited": 30, "triangle_tests": 50}


class Workers:
    """Stands in for the worker processes; fails or stops where told to."""

    def __init__(self) -> None:
        self.jobs: list[Job] = []
        self.failing: set[tuple[str, str]] = set()
        self.interrupt_after: int | None = None
        self.brightness = {"native": 1.0001, "embree": 1.0}

    def run(self, job: Job, on_stage: Callable[[str], None] | None = None) -> JobResult:
        if on_stage:
            on_stage(f"building {job.spec} for {job.scene}, 40%")
        if job.kind == "inspect":
            traits = {"scene_hash": "h", "content": CONTENT, "spp": 4, "resolution": [8, 6]}
            return JobResult({**traits, "box_filter": True, "fixed_blocks": True}, ())
        if self.interrupt_after is not None and len(self.jobs) >= self.interrupt_after:
            raise KeyboardInterrupt
        self.jobs.append(job)
        if (job.kind, job.spec) in self.failing:
            raise JobError(f"{job.spec} ran out of luck")
        counters = {"closest": COUNTERS, "any": {**COUNTERS, "rays": 30}} if job.kind == "count" else None
        statistics = {"nodes": 9, "interior_nodes": 4, "oblique_nodes": 1, "references": 77, "bytes": 2_000_000}
        if job.kind == "count":
            pixels = np.full((6, 8, 3), self.brightness.get(job.spec, 1.0), np.float32)
            write_exr(Path(job.image), pixels, [], job.header)
            return JobResult({"statistics": {**statistics, "counters": counters}, "pixels_sha256": "p"}, ())
        seconds = {"native": 2.0}.get(job.spec, 0.5)
        timed = {"build_s": 0.25, "render_s": seconds, "statistics": statistics, "pixels_sha256": "p"}
        return JobResult({**timed, "peak_rss_bytes": 1}, ())


class Listener:
    """Remembers what it is told."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.begun: list[str] = []
        self.total = self.done = 0
        self.failures: list[Failure] = []

    def note(self, text: str) -> None:
        self.notes.append(text)

    def start(self, scenes: Sequence[SceneInfo], jobs: int, done: int) -> None:
        self.total, self.done = jobs, done

    def begin(self, job: str) -> None:
        self.begun.append(job)

    def finish(self) -> None:
        self.done += 1

    def fail(self, failure: Failure) -> None:
        self.failures.append(failure)


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> Workers:
    found = Workers()
    monkeypatch.setattr(scheduling, "run_job", found.run)
    monkeypatch.setattr(preflight, "run_job", found.run)
    return found


@pytest.fixture
def options(tmp_path: Path) -> Options:
    scenes = (tmp_path / "room.xml", tmp_path / "garden.xml")
    for scene in scenes:
        scene.write_text("<scene/>")
    specs = tuple(parse_spec(text) for text in SPECS)
    return Options(scenes, specs, tmp_path / "out", "scalar_rgb", threads=2, params={"spp": "4"})


def lines(options: Options) -> list[dict[str, object]]:
    return [json.loads(line) for line in (options.out / "records.jsonl").read_text().splitlines()]


def test_every_job_is_run_once_counting_first_then_in_shuffled_rounds(workers: Workers, options: Options) -> None:
    compare(options, Listener())
    pairs = {(str(scene), spec) for scene in options.scenes for spec in SPECS}
    kinds = [job.kind for job in workers.jobs]
    assert kinds == ["count"] * 8 + ["time"] * 24
    rounds = [[(job.scene, job.spec) for job in workers.jobs[start : start + 8]] for start in (8, 16, 24)]
    assert all(set(turn) == pairs for turn in rounds)
    assert rounds[0] != rounds[1] != rounds[2]
    assert rounds[0] != sorted(rounds[0])


def test_all_jobs_share_seed_and_settings(workers: Workers, options: Options) -> None:
    compare(options, Listener())
    assert {(job.seed, job.threads, job.variant, tuple(job.params.items())) for job in workers.jobs} == {
        (0, 2, "scalar_rgb", (("spp", "4"),))
    }


def test_a_record_holds_everything(workers: Workers, options: Options) -> None:
    compare(options, Listener())
    records = lines(options)
    assert len(records) == 24
    record = next(r for r in records if r["spec"] == "normals" and r["scene"] == "garden")
    assert record["spec_full"].startswith("normals:") and "triangle_test=woop" in record["spec_full"]
    expected = {
        "scene_hash": "h", "spp": 4, "resolution": [8, 6], "seed": 0, "threads": 2, "variant": "scalar_rgb",
        "shape_groups": 1, "instances": 7,
        "params": {"spp": "4"}, "build_s": 0.25, "render_s": 0.5, "mitsuba": "3.9.1",
        "image": "images/garden--normals.exr", "image_repeats": True, "oblique_nodes_share": 0.25,
        "interior_steps_per_ray": 4.0, "triangle_tests_per_ray": 2.5, "oblique_steps_share": 0.25,
    }  # fmt: skip
    assert expected.items() <= record.items()
    assert record["statistics"]["references"] == 77
    assert record["counters"]["any"]["rays"] == 30
    assert all(record[key] for key in ("compiler", "cpu", "python", "mitsuba_bsp"))
    assert (options.out / record["image"]).is_file()


def test_images_are_held_against_our_trees_native_and_embree(workers: Workers, options: Options) -> None:
    compare(options, Listener())
    found = next(r["image_difference"] for r in lines(options) if r["spec"] == "normals")
    assert {name: difference["reference"] for name, difference in found.items()} == {
        "trees": "kd", "native": "native", "embree": "embree",
    }  # fmt: skip
    assert found["trees"]["verdict"] == found["embree"]["verdict"] == "identical"
    assert found["native"]["verdict"] == "bias"


def test_trees_with_another_triangle_test_are_not_expected_to_agree(workers: Workers, options: Options) -> None:
    texts = ("kd", "kd:triangle_test=mt", "random:triangle_test=mt", "random", "brute", "kd:precision=fast")
    compare(replace(options, specs=tuple(map(parse_spec, texts))), Listener())
    references = {r["spec"]: r["image_difference"].get("trees", {}).get("reference") for r in lines(options)}
    assert references == {
        "kd": None, "kd:triangle_test=mt": None, "random": "kd", "random:triangle_test=mt": "kd:triangle_test=mt",
        "brute": "kd", "kd:precision=fast": None,
    }  # fmt: skip


@pytest.mark.parametrize("jobs", [0, 3, 8, 9, 20])
def test_an_interrupted_run_goes_on_where_it_stopped(workers: Workers, options: Options, jobs: int) -> None:
    workers.interrupt_after = jobs
    with pytest.raises(KeyboardInterrupt):
        compare(options, Listener())
    workers.interrupt_after = None
    listener = Listener()
    compare(options, listener)
    assert (listener.total, listener.done) == (32, 32)
    assert len(workers.jobs) == 32
    done = Counter((job.kind, job.scene, job.spec) for job in workers.jobs)
    assert set(done.values()) == {1, 3}
    assert len({(r["scene"], r["spec"], r["repeat"]) for r in lines(options)}) == len(lines(options)) == 24


def test_a_finished_run_has_nothing_left_to_do(workers: Workers, options: Options) -> None:
    compare(options, Listener())
    before = lines(options)
    listener = Listener()
    compare(options, listener)
    assert listener.done == listener.total == 32
    assert lines(options) == before


def test_specs_and_repeats_can_be_added_later(workers: Workers, options: Options) -> None:
    compare(replace(options, specs=options.specs[:2]), Listener())
    compare(replace(options, repeats=4), Listener())
    done = Counter((r["scene"], r["spec"]) for r in lines(options))
    assert len(done) == 8 and set(done.values()) == {4}


@pytest.mark.parametrize(
    "change",
    [{"threads": 3}, {"params": {"spp": "5"}}, {"variant": "scalar_spectral"}, {"cache": Path("trees")}],
)
def test_runs_with_other_settings_do_not_mix(workers: Workers, options: Options, change: dict[str, object]) -> None:
    compare(options, Listener())
    before = lines(options)
    with pytest.raises(ValueError, match=f"{next(iter(change))}.*choose another --out"):
        compare(replace(options, **change), Listener())
    assert lines(options) == before


def test_saved_trees_are_used_only_if_asked_for_and_the_record_says_so(workers: Workers, options: Options) -> None:
    compare(options, Listener())
    assert {job.cache for job in workers.jobs} == {""} and not any(row["cache"] for row in lines(options))
    workers.jobs.clear()
    kept = replace(options, out=options.out / "kept", cache=Path("trees"))
    compare(kept, Listener())
    assert {job.cache for job in workers.jobs} == {"trees"} and all(row["cache"] for row in lines(kept))


def test_folders_from_before_there_were_saved_trees_go_on(workers: Workers, options: Options) -> None:
    compare(replace(options, repeats=3), Listener())
    for name in ("records.jsonl", "counters.jsonl"):
        rows = [json.loads(line) for line in (options.out / name).read_text().splitlines()]
        texts = [json.dumps({key: value for key, value in row.items() if key != "cache"}) for row in rows]
        (options.out / name).write_text("".join(text + "\n" for text in texts))
    compare(replace(options, repeats=4), Listener())
    assert len(lines(options)) == 32


def test_a_failed_job_is_recorded_and_the_others_finish(workers: Workers, options: Options) -> None:
    workers.failing = {("count", "kd"), ("time", "normals")}
    listener = Listener()
    _, failures = compare(options, listener)
    assert {(f.spec, f.message) for f in failures} == {
        ("kd", "kd ran out of luck"), ("normals", "normals ran out of luck"),
    }  # fmt: skip
    assert listener.failures == failures
    assert listener.done == listener.total
    assert {r["spec"] for r in lines(options)} == {"native", "embree"}
    assert not any(job.kind == "time" and job.spec == "kd" for job in workers.jobs)
    assert len((options.out / "failures.jsonl").read_text().splitlines()) == len(failures) == 2 + 6
    workers.failing = set()
    assert compare(options, Listener())[1] == []
    assert len(lines(options)) == 24


def test_brute_refuses_large_scenes_before_the_first_job(workers: Workers, options: Options) -> None:
    specs = (*options.specs, parse_spec("brute"))
    compare(replace(options, specs=specs), Listener())
    workers.jobs.clear()

    def large(job: Job, *_: object) -> JobResult:
        return JobResult({**workers.run(job).values, "content": {**CONTENT, "triangles": 20_001}}, ())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(preflight, "run_job", large)
        with pytest.raises(ValueError, match=r"brute takes at most 20,000 triangles, but .*room.xml has 20,001"):
            compare(replace(options, specs=specs, out=options.out.with_name("other")), Listener())
    assert workers.jobs == []
    assert not options.out.with_name("other").exists()


def test_progress_says_what_the_job_is_doing(workers: Workers, options: Options) -> None:
    listener = Listener()
    compare(options, listener)
    assert "room: kd, timed run 1 of 3 (building 40%)" in listener.begun


def test_scenes_of_the_same_name_are_refused(workers: Workers, options: Options, tmp_path: Path) -> None:
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "room.xml").write_text("<scene/>")
    with pytest.raises(ValueError, match="two scenes are called room"):
        compare(replace(options, scenes=(*options.scenes, tmp_path / "more" / "room.xml")), Listener())


def test_the_tables_show_what_was_measured(workers: Workers, options: Options) -> None:
    workers.failing = {("time", "embree")}
    scenes, _ = compare(options, Listener())
    tables = make_tables(scenes, options, ResultsFolder(options.out))
    assert [table.title for table in tables] == [
        title
        for n in ("room", "garden")
        for title in (f"{n}: 1,234 triangles, 8x6, 4 spp", f"{n}: trees", f"{n}: images")
    ]
    times = {row[0]: row[1:] for row in tables[0].rows}
    assert times["kd"] == ("0.250", "0.500", "0.0%", "4.00 [4.00, 4.00]", "-")
    assert times["embree"] == ("-",) * 5
    trees = {row[0]: row[1:] for row in tables[1].rows}
    assert trees["kd"] == ("4.0", "2.5", "0.0k", "0.1k", "2.0") and trees["embree"] == ("-",) * 5
    images = {row[0]: row[1:] for row in tables[2].rows}
    assert images["kd"][0] == "(the reference)"
    assert images["normals"] == ("identical to kd", "as kd", "as kd")
    assert "BIAS" in images["kd"][1]
    write_outcomes(ResultsFolder(options.out))
    text = (options.out / "table.md").read_text()
    assert "| normals" in text and f"cpu {describe()['cpu']}" in text
    assert "Failed: room, embree: embree ran out of luck" in text


def test_an_image_that_does_not_repeat_is_pointed_out(workers: Workers, options: Options) -> None:
    real = workers.run

    def unstable(job: Job, *_: object) -> JobResult:
        found = real(job)
        return (
            JobResult({**found.values, "pixels_sha256": "q"}, ()) if (job.kind, job.spec) == ("time", "kd") else found
        )

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scheduling, "run_job", unstable)
        scenes, _ = compare(options, Listener())
    images = {row[0]: row[1] for row in make_tables(scenes, options, ResultsFolder(options.out))[2].rows}
    assert "NOT REPEATABLE" in images["kd"]
    assert "NOT REPEATABLE" not in images["normals"]
