"""Jobs on the workers of a Dask cluster: each takes one at a time, and what one loses another one does again.

Dask carries jobs and results and says which workers there are. A job goes to one worker, which must offer the resource
`bsp` and have the same software; should it vanish, the job goes to another. Scenes are sent along, and what a job
writes comes back with its result.
"""

from __future__ import annotations

import asyncio
import hashlib
import tempfile
import time
import warnings
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import Empty, SimpleQueue

from distributed import Client, Future, KilledWorker
from distributed.core import rpc
from distributed.security import Security

from .jobs import Job, JobError, JobResult, run_job
from .machine import arithmetic, describe, software
from .messages import one_sentence
from .remote import Cargo, Delivery, Introduction, Order, introduce, serve
from .scheduling import Say

#: What a worker offers that takes our jobs, one of it.
RESOURCE = "bsp"

#: A job that fails or is lost is tried so often in all.
TRIES = 3

#: How long a scheduler may take to answer, how long we wait for workers where there are none, how often we look.
CONNECT_S, PATIENCE_S, LOOK_S = 10.0, 60.0, 1.0


@dataclass
class _Task:
    """A job on its way, and how often it was tried in vain."""

    place: int
    label: str
    job: Job
    failed: int = 0


@dataclass
class _Worker:
    """A worker that takes our jobs: on what machine it is, and the scenes that it has."""

    address: str
    machine: Mapping[str, str]
    archives: set[str] = field(default_factory=set)


class Cluster:
    """The Dask cluster whose scheduler is at `address`; ValueError, in one sentence, if it is of no use.

    `same_bits`: all jobs are parts of one image, so that workers whose processors compute otherwise are left out too.
    Without it, the jobs of a scene stay with machines of one kind, as times of different machines are not compared.
    """

    def __init__(self, address: str, same_bits: bool = False) -> None:
        self._address, self._same_bits = address, same_bits
        self._workers: dict[str, _Worker] = {}
        self._refused: dict[str, str] = {}
        self._unsaid: list[str] = []
        self._archives: dict[tuple[str, tuple[tuple[str, str], ...]], tuple[Order, bytes]] = {}
        self._kinds: dict[str, Mapping[str, str]] = {}
        self._answers, self._last_seen = True, time.monotonic()
        self._client = _connected(address)
        try:
            self._look_around()
            if not self._workers:
                raise ValueError(self._nobody())
        except BaseException:
            self.__exit__()
            raise

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # we are leaving, whatever is wrong with it
            self._client.close(timeout=CONNECT_S)

    @property
    def machine(self) -> Mapping[str, str]:
        """The versions, which all workers share; their processors are their own."""
        return {key: value for key, value in describe().items() if key != "cpu"}

    def run(self, jobs: Iterable[tuple[str, Job]], say: Say, note: Say) -> Iterator[tuple[int, JobResult | JobError]]:
        """See `Scheduler`; as many jobs run at once as there are workers.

        ValueError if there are no workers any more, and none come.
        """
        waiting = deque(_Task(place, label, job) for place, (label, job) in enumerate(jobs))
        flights: dict[Future, tuple[_Task, _Worker]] = {}
        landed: SimpleQueue[Future] = SimpleQueue()
        try:
            while waiting or flights:
                self._look_around()
                while self._unsaid:
                    note(self._unsaid.pop(0))
                self._cancel([f for f, (_, worker) in flights.items() if worker.address not in self._workers])
                for task, worker in self._assigned(waiting, {worker.address for _, worker in flights.values()}):
                    future = self._send(task.job, worker)
                    flights[future] = task, worker
                    future.add_done_callback(landed.put)
                    say(task.label if len(flights) == 1 else f"{len(flights)} at once, last {task.label}")
                with suppress(Empty):
                    future = landed.get(timeout=LOOK_S)
                    task, worker = flights.pop(future)
                    outcome = self._outcome(task, worker, future)
                    if outcome is None:
                        waiting.append(task)
                    else:
                        yield task.place, outcome
        finally:
            self._cancel(list(flights))

    def _cancel(self, flights: list[Future]) -> None:
        """Give up jobs, so that they land."""
        if flights:
            with suppress(Exception):  # there is nobody to be told
                self._client.cancel(flights)

    def _look_around(self) -> None:
        """Meet workers that have come, and forget those that have gone; ValueError if there was none for long."""
        found = self._offering()
        self._workers = {address: worker for address, worker in self._workers.items() if address in found}
        self._refused = {address: reason for address, reason in self._refused.items() if address in found}
        for address in found - {*self._workers, *self._refused}:
            self._meet(address)
        if self._workers:
            self._last_seen = time.monotonic()
        elif time.monotonic() > self._last_seen + PATIENCE_S:
            raise ValueError(self._nobody())

    def _offering(self) -> set[str]:
        """The addresses of all workers that offer the resource."""
        with suppress(OSError, RuntimeError):
            found = self._client.scheduler_info(n_workers=-1).get("workers")
            self._answers = found is not None
            return {address for address, about in (found or {}).items() if about["resources"].get(RESOURCE, 0) >= 1}
        self._answers = False
        return set()

    def _meet(self, address: str) -> None:
        """Take a worker on, or refuse it."""
        with suppress(OSError):  # it has gone already
            met = self._client.run(introduce, workers=[address], on_error="return")[address]
            if isinstance(met, OSError):
                raise met
            reason = unfit(met, self._same_bits)
            if reason is None:
                self._workers[address] = _Worker(address, met.machine)
            else:
                self._refused[address] = f"the worker {address} is left out: {reason}"
                self._unsaid.append(self._refused[address])

    def _nobody(self) -> str:
        """Why nobody takes our jobs."""
        if not self._answers:
            return f"the Dask scheduler at {self._address} does not answer any more"
        if self._refused:
            return f"the Dask cluster at {self._address} has no worker for this: {next(iter(self._refused.values()))}"
        return (
            f"no worker of the Dask cluster at {self._address} offers the resource {RESOURCE}: start workers with "
            f'dask worker {self._address} --nthreads 1 --resources "{RESOURCE}=1"'
        )

    def _assigned(self, waiting: deque[_Task], busy: set[str]) -> Iterator[tuple[_Task, _Worker]]:
        """The next job of each worker that has none."""
        for worker in [worker for worker in self._workers.values() if worker.address not in busy]:
            task = next((task for task in waiting if self._suits(task, worker)), None)
            if task:
                waiting.remove(task)
                self._kinds[task.job.scene] = worker.machine
                yield task, worker

    def _suits(self, task: _Task, worker: _Worker) -> bool:
        kind = self._kinds.get(task.job.scene, worker.machine)
        extinct = kind not in [other.machine for other in self._workers.values()]
        return self._same_bits or extinct or kind == worker.machine

    def _send(self, job: Job, worker: _Worker) -> Future:
        """Start a job on a worker; with its scene, if that is not there yet."""
        order, archive = self._packed(job)
        cargo = Cargo(
            None if order.archive in worker.archives else archive, {path: Path(path).read_bytes() for path in job.reads}
        )
        worker.archives.add(order.archive)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph")  # a scene, once to each worker
            only = {"workers": [worker.address], "resources": {RESOURCE: 1}, "pure": False}
            return self._client.submit(serve, order, cargo, **only)

    def _packed(self, job: Job) -> tuple[Order, bytes]:
        """The order of a job, and its scene, which is packed once; ValueError if that fails."""
        key = job.scene, tuple(job.params.items())
        if key not in self._archives:
            with tempfile.NamedTemporaryFile(prefix="mitsuba_bsp-", suffix=".tar") as file:
                try:
                    found = run_job(replace(job, kind="pack", arrays=file.name)).values
                except JobError as error:
                    raise ValueError(str(error)) from None
                content = Path(file.name).read_bytes()
            order = Order(job, hashlib.sha256(content).hexdigest(), **found)
            self._archives[key] = order, content
        order, content = self._archives[key]
        return replace(order, job=job), content

    def _outcome(self, task: _Task, worker: _Worker, future: Future) -> JobResult | JobError | None:
        """What became of a job, whose files are written; None if it is to be tried again."""
        try:
            delivery = self._gathered(worker, future)
        except JobError as error:
            failure = error
            worker.archives.clear()  # it keeps no scene that it could not check
        except (CancelledError, KilledWorker):
            failure = JobError(
                f"it was tried {TRIES} times, the last time the worker {worker.address} vanished with it"
            )
        except Exception as error:  # noqa: BLE001  # whatever else it is, it is not our doing
            failure = JobError(f"on the worker {worker.address}: {one_sentence(error)}")
            worker.archives.clear()  # perhaps they are not there any more
        else:
            for path, content in delivery.files.items():
                _write(Path(path), content)
            return delivery.result
        task.failed += 1
        return failure if task.failed == TRIES else None

    def _gathered(self, worker: _Worker, future: Future) -> Delivery:
        """A finished job's result; CancelledError if it vanished together with its worker."""
        while True:
            try:
                return future.result(timeout=PATIENCE_S)
            except TimeoutError:
                if future.status != "finished":
                    raise
                self._look_around()
                if worker.address not in self._workers:
                    raise CancelledError from None


def unfit(met: Introduction | BaseException, same_bits: bool) -> str | None:
    """Why a worker cannot take jobs that are to be the same as here, or that are to have the same bits; None if it can.

    `met` is what became of asking it.
    """
    if isinstance(met, BaseException):
        return f"it does not know these jobs ({one_sentence(met)})"
    theirs = {**met.software, **(met.arithmetic if same_bits else {})}
    ours = {**software(), **(arithmetic() if same_bits else {})}
    different = [
        f"its {key} is {theirs.get(key)}, here it is {value}" for key, value in ours.items() if theirs.get(key) != value
    ]
    return different[0] if different else None


def _connected(address: str) -> Client:
    """A client of the scheduler at `address`; ValueError if there is none."""

    async def hello() -> str:
        async with rpc(address, connection_args=Security().get_connection_args("client")) as scheduler:
            return (await scheduler.identity())["type"]

    try:
        kind = asyncio.run(asyncio.wait_for(hello(), CONNECT_S))
    except Exception as error:  # noqa: BLE001  # what is not Dask answers in any way
        reason = f" within {CONNECT_S:g} s" if isinstance(error, TimeoutError) else f" ({one_sentence(error)})"
        raise ValueError(f"no Dask scheduler answers at {address}{reason}") from None
    if kind != "Scheduler":
        raise ValueError(f"at {address} is no Dask scheduler, but a {kind.lower()}")
    return Client(address, timeout=CONNECT_S, set_as_default=False)


def _write(path: Path, content: bytes) -> None:
    """A file, all or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".unfinished-{path.name}")
    unfinished.write_bytes(content)
    unfinished.replace(path)
