"""Jobs on a real Dask cluster of processes on this machine, one of which is killed in the middle."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil
import pytest
from conftest import ROOM
from distributed import Client
from test_shipping import make_abroad

from mitsuba_bsp import cli, parse_spec
from mitsuba_bsp import cluster as module
from mitsuba_bsp.cluster import TRIES, Cluster, unfit
from mitsuba_bsp.comparison import Failure, Options, SceneInfo
from mitsuba_bsp.exr import read_exr, read_header
from mitsuba_bsp.jobs import Job, JobError, JobResult, run_job
from mitsuba_bsp.machine import describe
from mitsuba_bsp.records import ResultsFolder
from mitsuba_bsp.remote import Introduction
from mitsuba_bsp.scheduling import scheduler_at
from mitsuba_bsp.thesis import count_frames

#: What the workers' processors are called, as if they were other machines.
CPU = "the processor of another machine"

#: Run by a worker before it starts.
ELSEWHERE = f"import mitsuba_bsp.machine as m\nm._processor = lambda: '{CPU}'\nm.describe.cache_clear()\n"
OUTDATED = "import mitsuba_bsp.machine as m\nm.software = lambda own=m.software(): {**own, 'mitsuba': '3.5.0'}\n"


class Dask:
    """A scheduler and its workers, each a process; `folder` is theirs."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.workers: list[subprocess.Popen] = []
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        self.address = self._wait_for("Scheduler at:", folder / "scheduler-0.log")

    def start_worker(self, preload: str = ELSEWHERE) -> str:
        """The address of a new worker, which runs the code of `preload` first."""
        number = len(self.workers)
        file = self.folder / f"preload-{number}.py"
        file.write_text(preload)
        words = ["--nthreads", "1", "--no-nanny", "--resources", "bsp=1", "--local-directory", self.folder / "work"]
        self.workers.append(self._start("worker", self.address, *words, "--preload", file))
        return self._wait_for("Start worker at:", self.folder / f"worker-{number}.log")

    def kill(self, address: str) -> None:
        """Kill a worker, as when its machine loses its power."""
        with Client(self.address, set_as_default=False) as client:
            os.kill(client.run(os.getpid, workers=[address])[address], signal.SIGKILL)

    def kill_busy(self) -> bool:
        """Kill a worker that has a job; False if there is none."""
        with Client(self.address, set_as_default=False) as client:
            for address, process in client.run(os.getpid).items():
                os.kill(process, signal.SIGSTOP)  # now it finishes nothing
                if client.processing().get(address):
                    os.kill(process, signal.SIGKILL)
                    return True
                os.kill(process, signal.SIGCONT)
        return False

    def stop(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _start(self, what: str, *words: str | Path) -> subprocess.Popen:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", *map(str, words), "--no-dashboard"]
        with (self.folder / f"{what}-{len(self.workers)}.log").open("w") as log:
            return subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT)

    @staticmethod
    def _wait_for(text: str, log: Path) -> str:
        """The address behind a text in a log."""
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline:
            for line in log.read_text().splitlines():
                if text in line:
                    return line.split()[-1]
            time.sleep(0.05)
        raise AssertionError(log.read_text())


@pytest.fixture(scope="module")
def dask(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    found = Dask(tmp_path_factory.mktemp("dask"))
    try:
        for _ in range(3):
            found.start_worker()
        yield found
    finally:
        found.stop()


class Listener:
    """Remembers what it is told, and does something when a job is over until that has succeeded."""

    def __init__(self, act: Callable[[], bool] = lambda: True) -> None:
        self.notes: list[str] = []
        self.begun: list[str] = []
        self.finished = 0
        self.failures: list[Failure] = []
        self.acted, self._act = False, act

    def note(self, text: str) -> None:
        self.notes.append(text)

    def start(self, scenes: Sequence[SceneInfo], jobs: int, done: int) -> None:
        """Nothing to count."""

    def begin(self, job: str) -> None:
        self.begun.append(job)

    def finish(self) -> None:
        self.finished += 1
        self.acted = self.acted or self._act()

    def fail(self, failure: Failure) -> None:
        self.failures.append(failure)


def outcomes(scheduler: Cluster, *jobs: Job) -> list[JobResult | JobError]:
    """What became of jobs, in their order."""
    labelled = [(job.kind, job) for job in jobs]
    found = dict(scheduler.run(labelled, lambda _: None, lambda _: None))
    return [found[place] for place in range(len(jobs))]


def test_a_killed_worker_loses_its_job_only_and_another_one_does_it(dask: Dask, room: Path, tmp_path: Path) -> None:
    other = room.with_name("other.xml")
    other.write_text(ROOM.replace('value="0.7"', 'value="0.8"'))
    specs = tuple(parse_spec(text) for text in ("kd", "normals", "random"))
    options = Options((room, other), specs, tmp_path / "out", "scalar_rgb", 1, {}, spp=100, resolution=64)
    listener = Listener(dask.kill_busy)
    with Cluster(dask.address) as scheduler:
        _, failures = count_frames(options, listener, scheduler)
    rows = ResultsFolder(options.out).records()
    assert listener.acted and failures == listener.failures == []
    assert Counter((row["scene"], row["spec"]) for row in rows) == {
        (scene.stem, spec.text): 1 for scene in (room, other) for spec in specs
    }
    assert listener.finished == 6 < len(listener.begun) and listener.begun[2].startswith("3 at once, last ")
    assert {row["cpu"].partition(",")[0] for row in rows} == {CPU}, "records say where a job ran"
    assert {row["python"] for row in rows} == {describe()["python"]}
    options = replace(options, scenes=(room,))
    with Cluster(dask.address) as scheduler:
        count_frames(options, Listener(), scheduler)
    assert len(ResultsFolder(options.out).records()) == 6, "what is finished is kept"
    with pytest.raises(ValueError, match=f"with cpu {CPU}, .*, but this run has .*: choose another --out"):
        count_frames(options, Listener())
    dask.start_worker()


def run(*words: object) -> int:
    """The exit status of the command line in this process."""
    with pytest.raises(SystemExit) as caught:
        cli.main([str(word) for word in words])
    return caught.value.code


def test_an_image_has_the_same_pixels_here_and_there(
    dask: Dask, room: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ["render", room, "--spp", 7, "--resolution", 40, "--passes", 3, "--seed", 7]
    assert run(*words, "--spec", "kd", "-o", tmp_path / "here.exr", "--threads", 3) == 0
    assert run(*words, "--spec", "normals", "-o", tmp_path / "there.exr", "--scheduler", dask.address) == 0
    assert "there.exr: 3 passes, built in" in capfd.readouterr().out
    here, there = read_exr(tmp_path / "here.exr"), read_exr(tmp_path / "there.exr")
    assert {name: plane.tobytes() for name, plane in here.items()} == {
        name: plane.tobytes() for name, plane in there.items()
    }
    headers = [read_header(tmp_path / name) for name in ("here.exr", "there.exr")]
    assert [(header["passes"], header["seed"], header["spp"]) for header in headers] == [("3", "7 to 9", "7")] * 2
    assert headers[0]["scene_hash"] == headers[1]["scene_hash"]
    assert np.isfinite(here["R"]).all() and here["R"].mean() > 0.01


def test_scenes_and_files_come_and_go_with_their_jobs(dask: Dask, tmp_path: Path) -> None:
    scene, params = make_abroad(tmp_path / "abroad")
    job = Job("count", str(scene), "scalar_rgb", spec="kd", params=params, spp=2, resolution=16)
    streams = str(tmp_path / "out" / "streams" / "rays.npz")
    record = Job("record", str(scene), "scalar_rgb", params=params, spp=1, resolution=8, max_rays=50, streams=streams)
    replay = Job("replay", str(scene), "scalar_rgb", params=params, specs=["kd"], repeats=1, streams=streams)
    with Cluster(dask.address) as scheduler:
        there = Job(**{**vars(job), "image": str(tmp_path / "out" / "images" / "a.exr")})
        found, recorded = outcomes(scheduler, there, record)
        (replayed,) = outcomes(scheduler, replay)
    assert found.values["pixels_sha256"] == run_job(job).values["pixels_sha256"]
    assert read_exr(tmp_path / "out" / "images" / "a.exr")["R"].shape == (12, 16)
    assert (tmp_path / "out" / "images" / "a.png").is_file()
    assert recorded.values["counters"]["closest"]["rays"] > 0
    assert {run["stream"] for run in replayed.values["runs"]} >= {"camera"}
    assert not list(tmp_path.rglob(".unfinished*"))


def test_what_fails_is_tried_again_and_then_said_with_the_paths_of_here(
    dask: Dask, room: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []
    with Cluster(dask.address) as scheduler:
        send = scheduler._send

        def remembered(job: Job, worker: module._Worker) -> object:
            sent.append(job.kind)
            return send(job, worker)

        monkeypatch.setattr(scheduler, "_send", remembered)
        (outcome,) = outcomes(scheduler, Job("work", str(room), "scalar_rgb", spec="oak"))
    assert isinstance(outcome, JobError) and 'there is no accelerator "oak"' in str(outcome)
    assert sent == ["work"] * TRIES


def test_jobs_that_nobody_waits_for_are_ended(dask: Dask, room: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def running() -> list[psutil.Process]:
        return [
            child for worker in dask.workers if worker.poll() is None for child in psutil.Process(worker.pid).children()
        ]

    with Cluster(dask.address) as scheduler:
        look = scheduler._look_around

        def look_or_interrupt() -> None:
            if running():
                raise KeyboardInterrupt
            look()

        monkeypatch.setattr(scheduler, "_look_around", look_or_interrupt)
        job = Job("render", str(room), "scalar_rgb", spp=100_000, resolution=500, image="a.exr")
        with pytest.raises(KeyboardInterrupt):
            next(scheduler.run([("long", job)], lambda _: None, lambda _: None))
        deadline = time.monotonic() + 20
        while running() and time.monotonic() < deadline:
            time.sleep(0.1)
        assert not running()


def test_a_worker_with_other_versions_is_left_out(dask: Dask, room: Path) -> None:
    address = dask.start_worker(OUTDATED)
    notes: list[str] = []
    with Cluster(dask.address) as scheduler:
        list(scheduler.run([], lambda _: None, notes.append))
        job = Job("count", str(room), "scalar_rgb", spp=1, resolution=4)
        assert all(
            isinstance(found, JobResult) for _, found in scheduler.run([("a", job)], lambda _: None, notes.append)
        )
        assert address not in scheduler._workers
    assert notes == [f"the worker {address} is left out: its mitsuba is 3.5.0, here it is {describe()['mitsuba']}"]
    dask.kill(address)


def test_only_what_makes_a_difference_is_a_reason() -> None:
    assert unfit(Introduction(), same_bits=True) is None
    other = Introduction(machine={**describe(), "cpu": "another"}, arithmetic={"processor": "GenuineIntel with avx2"})
    assert unfit(other, same_bits=False) is None
    assert "its C library is None" in str(unfit(other, same_bits=True))
    older = Introduction(software={**Introduction().software, "python": "3.11.0"})
    assert str(unfit(older, same_bits=False)).startswith("its python is 3.11.0, here it is ")
    assert "it does not know these jobs (No module" in str(unfit(ModuleNotFoundError("No module named x"), False))


def test_a_scene_stays_with_machines_of_one_kind(dask: Dask) -> None:
    tasks = [module._Task(0, "", Job("time", scene, "scalar_rgb")) for scene in ("a", "a", "a", "b", "b")]
    with Cluster(dask.address) as scheduler:
        kinds = {"w1": "old", "w2": "old", "w3": "new"}
        scheduler._workers = {name: module._Worker(name, {"cpu": cpu}) for name, cpu in kinds.items()}
        waiting = deque(tasks)
        assigned = [(worker.address, task.job.scene) for task, worker in scheduler._assigned(waiting, set())]
        assert assigned == [("w1", "a"), ("w2", "a"), ("w3", "b")] and len(waiting) == 2
        assert list(scheduler._assigned(deque([tasks[0]]), {"w1", "w2"})) == []
        del scheduler._workers["w1"], scheduler._workers["w2"]
        assert [task for task, _ in scheduler._assigned(deque([tasks[0]]), set())] == [tasks[0]], (
            "no such machine is left"
        )


def test_a_cluster_without_our_workers_is_one_sentence(dask: Dask, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "RESOURCE", "gpu")
    with pytest.raises(ValueError, match=r'no worker .* offers the resource gpu: .*--nthreads 1 --resources "gpu=1"'):
        Cluster(dask.address)


def test_an_address_where_no_scheduler_is(dask: Dask, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CONNECT_S", 1.0)
    with pytest.raises(ValueError, match="^no Dask scheduler answers at tcp://127.0.0.1:1 within 1 s$"):
        Cluster("tcp://127.0.0.1:1")
    with pytest.raises(ValueError, match="^no Dask scheduler answers at here .missing port number"):
        Cluster("here")
    with Client(dask.address, set_as_default=False) as client:
        worker = next(iter(client.scheduler_info()["workers"]))
    with pytest.raises(ValueError, match=f"^at {worker} is no Dask scheduler, but a worker$"):
        Cluster(worker)


def test_dask_is_needed_only_for_this(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "mitsuba_bsp.cluster")
    with (
        pytest.raises(ValueError, match=r"^--scheduler needs dask: pip install 'mitsuba-bsp\[cluster\]'$"),
        scheduler_at("tcp://127.0.0.1:1"),
    ):
        pass


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--passes", "5"], "--passes is 5, but there are 4 samples per pixel"),
        (["--passes", "2", "--seed", str(2**32 - 1)], "--seed is 4294967295, but 2 passes take as many seeds"),
        (["--scheduler", "nowhere"], "no Dask scheduler answers at nowhere"),
    ],
)
def test_bad_input(room: Path, words: list[str], sentence: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run("render", room, "--spec", "kd", "-o", room.with_name("a.exr"), *words) == 2
    assert f"error: {sentence}" in capfd.readouterr().err
    assert not room.with_name("a.exr").exists()
