"""The compiled core once more, built to be watched by a sanitizer or by valgrind, and what they report about it.

Only `_core` and `_allocations` are watched: Python, Mitsuba and the thread pool are as they were installed.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from xml.etree import ElementTree

#: The compiled modules that are watched.
WATCHED = ("_core", "_allocations")

#: Their names in a report, with or without a path.
_OURS = re.compile(rf"[(/]({'|'.join(WATCHED)})\.")

#: As CMake finds it; it brings the sanitizers along.
COMPILER = "c++"

#: Where a checkout keeps them, in a folder for each tool.
BUILDS = Path("build", "watched")

#: What a watched process wrote to its standard error.
ERRORS = "stderr"

#: A process in which a sanitizer found something ends with this, and not with what `mitsuba-bsp` returns.
REPORTED = 66


def _sanitizer_reports(folder: Path) -> list[str]:
    """What the compiler's sanitizers say of calls that go through what is watched: the end of a report, and the place.

    That of undefined behaviour, which only the watched code looks out for, says it at once, and not into a file.
    """
    found = []
    for file in (folder / ERRORS, *sorted(folder.glob("report*"))):
        ours: list[str] = []
        for line in file.read_text(errors="replace").splitlines():
            if ": runtime error: " in line:
                found.append(line)
            elif line.startswith("SUMMARY: "):  # it may name what is watched itself
                if ours:
                    found.append(f"{line.partition(': ')[2].strip()}, from {ours[0]}")
                ours = []
            elif _OURS.search(line):
                ours.append(line.partition("#")[2].partition(" ")[2])
    return found


def _memcheck_reports(folder: Path) -> list[str]:
    """What valgrind says of calls that go through what is watched."""
    found = []
    for file in sorted(folder.glob("report*")):
        for error in ElementTree.parse(file).iter("error"):
            frames = error.findall("stack/frame")
            ours = [frame for frame in frames if Path(frame.findtext("obj", "")).name.startswith(WATCHED)]
            if ours:
                what = error.findtext("what") or error.findtext("xwhat/text")
                place = f"{ours[0].findtext('file')}:{ours[0].findtext('line')} in {ours[0].findtext('fn')}"
                found.append(f"{what} {place}")
    return found


def sources() -> str:
    """What tells apart the sources that are compiled and watched, a few digits; "" where there are none."""
    digest = hashlib.sha256()
    files = [file for file in Path("plugin").rglob("*") if file.is_file()]
    for file in (*sorted(files), Path(__file__).with_name("thread.supp")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:6] if files else ""


@dataclass(frozen=True, eq=False)
class Tool:
    """Something that watches a program and reports its mistakes into files called `report...` in a folder."""

    name: str
    mistakes: tuple[str, ...]  #: functions of `_core.mistakes` that it must report
    build: Mapping[str, str]  #: CMake's variables
    program: str = COMPILER  #: what it needs besides
    libraries: tuple[str, ...] = ()  #: of the compiler, to be loaded before all others
    environment: Callable[[Path], Mapping[str, str]] = lambda _: {}
    command: Callable[[Path], Sequence[str]] = lambda _: ()  #: put before that of Python
    reports: Callable[[Path], list[str]] = _sanitizer_reports

    def missing(self) -> str:
        """What would have to be done before it can watch, as a sentence; "" if nothing."""
        absent = [name for name in ("cmake", "ninja", "nanobind") if find_spec(name) is None]
        if not Path("plugin", "core").is_dir():
            return "it compiles the sources: start it in the folder of a checkout"
        if absent:
            return f"it needs {', '.join(absent)}: pip install '.[test]' in the folder of the checkout"
        programs = [name for name in (COMPILER, self.program) if shutil.which(name) is None]
        return f"it needs {programs[0]}: install it" if programs else ""

    def watch(self, arguments: Sequence[str], folder: Path) -> tuple[subprocess.CompletedProcess[str], list[str]]:
        """Run Python with these arguments, and what was reported meanwhile, a line each."""
        preload = ":".join(map(_library, self.libraries))
        environment = {"PYTHONPATH": str(_package(self)), "LD_PRELOAD": preload, **self.environment(folder)}
        process = subprocess.run(
            [*self.command(folder), sys.executable, "-P", *arguments],
            env=os.environ | environment,
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
        )
        (folder / ERRORS).write_text(process.stderr)
        return process, self.reports(folder)


@lru_cache
def _library(name: str) -> str:
    """Where the compiler has a library."""
    asked = [COMPILER, f"-print-file-name={name}"]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


@lru_cache
def _package(tool: Tool) -> Path:
    """A folder with this package in it, its watched parts compiled from the sources in the current folder."""
    import ninja

    folder = (BUILDS / tool.name).absolute()
    settings = {
        "CMAKE_MAKE_PROGRAM": Path(ninja.BIN_DIR, "ninja"),
        "Python_EXECUTABLE": sys.executable,
        "BSP_MISTAKES": "ON",
        **tool.build,
    }
    configure = ["-G", "Ninja", "-S", ".", "-B", folder, *(f"-D{key}={value}" for key, value in settings.items())]
    for arguments in (configure, ["--build", folder, "--target", *WATCHED]):
        done = subprocess.run(
            [sys.executable, "-P", "-m", "cmake", *arguments], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise RuntimeError(f"the sources do not compile for {tool.name}:\n{done.stdout}{done.stderr}")
    package = folder / "package" / "mitsuba_bsp"
    shutil.rmtree(package, ignore_errors=True)
    package.mkdir(parents=True)
    for file in Path(__file__).parents[1].iterdir():
        if file.name != "__pycache__":
            (package / file.name).symlink_to(folder / file.name if file.name.startswith(WATCHED) else file)
    return package.parent


ADDRESS = Tool(
    "address",
    ("read_too_far", "overflow"),
    {"BSP_SANITIZE": "address,undefined"},
    libraries=("libasan.so", "libubsan.so", "libstdc++.so"),
    environment=lambda folder: {
        "ASAN_OPTIONS": f"log_path={folder}/report:exitcode={REPORTED}:detect_leaks=0",
        "UBSAN_OPTIONS": f"log_path={folder}/report:exitcode={REPORTED}",
    },
)

THREAD = Tool(
    "thread",
    ("race",),
    {"BSP_SANITIZE": "thread"},
    program="setarch",
    libraries=("libtsan.so",),
    environment=lambda folder: {
        "TSAN_OPTIONS": f"log_path={folder}/report:exitcode=0:suppressions={Path(__file__).with_name('thread.supp')}"
    },
    command=lambda _: ("setarch", "--addr-no-randomize"),  # or its memory may be taken
)

MEMCHECK = Tool(
    "memcheck",
    ("read_too_far", "decide_by_nothing"),
    {"CMAKE_BUILD_TYPE": "RelWithDebInfo", "CMAKE_CXX_FLAGS_RELWITHDEBINFO": "-O1 -g1"},
    program="valgrind",
    environment=lambda _: {"PYTHONMALLOC": "malloc"},
    command=lambda folder: (
        "valgrind",
        "--quiet",
        "--show-leak-kinds=none",
        "--xml=yes",
        f"--xml-file={folder}/report.%p",
    ),
    reports=_memcheck_reports,
)
