"""Nightly: damaged PLY and OBJ files through Mitsuba, in other processes; what loads is held against brute force."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from .check import Failure, Outcome, Plan, Unit, check
from .damaged_files import KINDS, damaged, intact

FILES, PER_UNIT = 5_000, 100
RAYS = 500  #: in each file that loads

#: Seconds for one file.
LIMIT_S = 10.0


@check("N08f", "damaged mesh files: no crash of ours, no hang, and the hits of brute force")
def damaged_files(plan: Plan) -> Iterator[Unit]:
    files = plan.count(FILES)
    for start in range(0, files, PER_UNIT):
        numbers = range(start, min(start + PER_UNIT, files))
        yield Unit(f"files {numbers.start} to {numbers.stop - 1}", "", lambda n=numbers: _fuzz(plan, n))


def _fuzz(plan: Plan, numbers: range) -> Outcome:
    outcome = Outcome(what="files")
    figures = {"loaded": 0, "refused": 0, "crashes of Mitsuba's loader": 0, "hangs of Mitsuba's loader": 0, "rays": 0}
    with tempfile.TemporaryDirectory(prefix="mitsuba_bsp-") as name:
        folder, left = Path(name), []
        for number in numbers:
            kind = KINDS[number % len(KINDS)]
            file = folder / f"{number}.{kind.partition('-')[0]}"
            file.write_bytes(damaged(intact(kind), plan.rng("files", number)))
            left.append(file)
        while left:
            done, death = _look_at(left, plan.seed)
            for found in done:
                figures["loaded" if found["loaded"] else "refused"] += 1
                figures["rays"] += found.get("rays", 0)
                text = f"{found['file']}, seed {plan.seed}: {found['wrong']} answers are not those of brute force"
                outcome.expect("answers", found["wrong"] == 0, text)
            left = left[len(done) :]
            if left and death:
                _bury(outcome, figures, left.pop(0).name, *death, plan.seed)
    outcome.figures |= figures
    return outcome


def _bury(outcome: Outcome, figures: dict[str, int], file: str, stage: str, how: str, seed: int) -> None:
    """A file on which the process died or hung: Mitsuba's doing while it loads, ours from then on."""
    if stage == "loading":
        figures["hangs of Mitsuba's loader" if how == "hung" else "crashes of Mitsuba's loader"] += 1
        outcome.add("answers", 1)
        return
    outcome.add("survival", 1, 1, lambda: Failure(f"{file}, seed {seed}: the process {how} while {stage}"))


def _look_at(files: list[Path], seed: int) -> tuple[list[dict], tuple[str, str] | None]:
    """What a child process found in the first of the files; if it did not get to the end, in which stage it was and
    whether it `died` or `hung`."""
    command = [sys.executable, "-P", "-m", "mitsuba_bsp.verification.damaged_files", str(seed), str(RAYS)]
    return _watch([*command, *map(str, files)], len(files), LIMIT_S)


def _watch(command: list[str], count: int, limit_s: float) -> tuple[list[dict], tuple[str, str] | None]:
    """The same of a command that reports on `count` files, and hangs if it reports nothing for so many seconds."""
    done: list[dict] = []
    stage, how = "loading", "died"
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, bufsize=0)
    with process, selectors.DefaultSelector() as selector:
        selector.register(process.stdout, selectors.EVENT_READ)
        rest, end = b"", time.monotonic() + limit_s
        while True:
            if time.monotonic() >= end or not selector.select(end - time.monotonic()):
                process.kill()
                how = "hung"
                break
            part = os.read(process.stdout.fileno(), 1 << 16)
            if not part:
                break
            *lines, rest = (rest + part).split(b"\n")
            for line in lines:
                if not line.startswith(b"{"):
                    continue  # it is not ours
                found = json.loads(line)
                stage = found.get("stage", "loading")
                if "stage" not in found:
                    done.append(found)
                end = time.monotonic() + limit_s
    return done, (stage, how) if len(done) < count else None
