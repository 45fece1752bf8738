"""A results folder: append-only JSON lines that survive interruption, and what a second run may add to them."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Record = Mapping[str, Any]

#: Fields that say on what a record was measured: the machine and the versions of the software.
MACHINE = ("mitsuba", "mitsuba_bsp", "compiler", "python", "cpu")

#: Fields that every record of one scene in one folder must share, or its figures could not be compared.
CONTEXT = (
    "scene_hash", "variant", "params", "spp", "resolution", "seed", "threads", "cache", *MACHINE,
)  # fmt: skip


def safe_name(text: str) -> str:
    """A part of a file's name that tells two specs apart."""
    return "".join(c if c.isalnum() or c in "=.-+" else "_" for c in text)


@dataclass(frozen=True)
class ResultsFolder:
    """The files of one comparison.

    `records.jsonl` has one object per timed run, `counters.jsonl` one per untimed run with counters and image,
    `failures.jsonl` one per job that failed. Where a `machine` is given, only its timed runs are seen.
    """

    path: Path
    machine: Mapping[str, str] | None = None

    def check_writable(self) -> None:
        """ValueError if the folder cannot be written to, or not be created; leaves nothing behind."""
        existing = next(folder for folder in (self.path, *self.path.absolute().parents) if folder.exists())
        try:
            with tempfile.TemporaryFile(dir=existing):
                pass
        except OSError as error:
            raise ValueError(f"cannot write to the output folder {self.path}: {error.strerror}") from None

    def prepare(self, subfolder: str = "images") -> None:
        """Create the folder, with a subfolder unless that is "", and cut off a record whose writing was interrupted."""
        (self.path / subfolder).mkdir(parents=True, exist_ok=True)
        for file in (self.records_file, self.counters_file, self.failures_file, self.asked_file):
            _drop_unfinished_line(file)

    @property
    def records_file(self) -> Path:
        """Timed runs."""
        return self.path / "records.jsonl"

    @property
    def counters_file(self) -> Path:
        """Untimed runs with counters and images."""
        return self.path / "counters.jsonl"

    @property
    def failures_file(self) -> Path:
        """Jobs that failed when they were tried last."""
        return self.path / "failures.jsonl"

    @property
    def asked_file(self) -> Path:
        """What the commands that measured into this folder were asked for."""
        return self.path / "asked.jsonl"

    def image(self, scene: str, spec: str) -> Path:
        """Where the EXR image of a scene and spec goes."""
        return self.path / "images" / f"{scene}--{safe_name(spec)}.exr"

    def records(self) -> list[Record]:
        """All timed runs, in the order in which they finished."""
        rows = read_lines(self.records_file)
        return rows if self.machine is None else [row for row in rows if machine_of(row) == self.machine]

    def counted(self) -> dict[tuple[str, str], Record]:
        """The newest untimed run of every (scene, spec) whose image is still there."""
        rows = {(str(row["scene"]), str(row["spec"])): row for row in read_lines(self.counters_file)}
        return {key: row for key, row in rows.items() if (self.path / str(row["image"])).is_file()}


def machine_of(row: Record) -> dict[str, str]:
    """What a record was measured on."""
    return {key: str(row[key]) for key in MACHINE}


def machines(rows: Sequence[Record]) -> list[dict[str, str]]:
    """What records were measured on, each once."""
    return list({tuple(found.values()): found for found in map(machine_of, rows)}.values())


def append(file: Path, *records: Record) -> None:
    """Add a line for each and make sure that they are on disk."""
    with file.open("a", encoding="utf-8") as stream:
        stream.write("".join(json.dumps(record) + "\n" for record in records))
        stream.flush()
        os.fsync(stream.fileno())


def rewrite(file: Path, records: Sequence[Record]) -> None:
    """Make these all the lines of a file, unless they are it already."""
    if records == read_lines(file):
        return
    unfinished = file.with_suffix(".partial")
    unfinished.write_text("".join(json.dumps(record) + "\n" for record in records), encoding="utf-8")
    unfinished.replace(file)


def of(rows: Sequence[Record], **fields: object) -> list[Record]:
    """The records with these values."""
    return [row for row in rows if all(row[key] == value for key, value in fields.items())]


def newest_run(rows: Sequence[Record], mark: str, wanted: Set[tuple[object, ...]], key: Sequence[str]) -> list[Record]:
    """The wanted records of the last measurement that has them all; empty if none has.

    What was measured together has the same value of the field `mark`; `key` are the fields whose values are `wanted`.
    """
    measurements: dict[object, list[Record]] = {}
    for row in rows:
        measurements.setdefault(row[mark], []).append(row)
    for found in reversed(measurements.values()):
        keys = [tuple(row[name] for name in key) for row in found]
        if wanted <= set(keys):
            return [row for row, own in zip(found, keys, strict=True) if own in wanted]
    return []


def check_context(rows: Sequence[Record], scene: str, spec_full: Mapping[str, str], context: Record) -> None:
    """ValueError, naming the first difference, if `rows` of this scene were made with other settings.

    `spec_full` maps each spec of this run to its full text; what `context` does not say may be anything.
    """
    for row in rows:
        if row["scene"] != scene:
            continue
        expected = {**context, "spec_full": spec_full.get(str(row["spec"]), row["spec_full"])}
        found = {"cache": False, **row}  # records older than the cache do not mention it
        for key in (key for key in (*CONTEXT, "spec_full") if key in expected):
            if found[key] != expected[key]:
                raise ValueError(
                    f"the output folder already holds {row['spec']} on {scene} with {key} {found[key]}, but this run "
                    f"has {expected[key]}: choose another --out or the same settings"
                )


def read_lines(file: Path) -> list[Record]:
    """The records in a file; none if there is no file. ValueError, with the line, for what is no record."""
    if not file.exists():
        return []
    lines = file.read_text(encoding="utf-8").split("\n")
    return [_read(line, number, file) for number, line in enumerate(lines[:-1], 1)]  # the rest is an unfinished record


def _read(line: str, number: int, file: Path) -> Record:
    try:
        found = json.loads(line)
    except json.JSONDecodeError:
        found = None
    if not isinstance(found, dict):
        raise ValueError(f"line {number} of {file} is damaged: it is not a JSON object")
    return found


def _drop_unfinished_line(file: Path) -> None:
    """Cut off what follows the last newline: a record whose writing was interrupted."""
    if not file.exists():
        return
    content = file.read_bytes()
    complete = content.rfind(b"\n") + 1
    if complete < len(content):
        with file.open("r+b") as stream:
            stream.truncate(complete)
