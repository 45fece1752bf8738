"""What a measurement ran on: versions, compiler and processor."""

from __future__ import annotations

import os
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from . import _core


@cache
def describe() -> dict[str, str]:
    """The part of every record that says which software and machine made it."""
    return {
        "mitsuba": version("mitsuba"),
        "mitsuba_bsp": version("mitsuba-bsp"),
        "compiler": _core.compiler,
        "python": platform.python_version(),
        "cpu": f"{_processor()}, {os.cpu_count()} logical cores",
    }


def c_library() -> str:
    """The C library, whose sines and the like decide the last bits of an image."""
    return " ".join(platform.libc_ver())


def available_threads() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0))


def _processor() -> str:
    """The processor's name, as Linux knows it."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())
