"""What a measurement ran on: versions, compiler and processor."""

from __future__ import annotations

import hashlib
import os
import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from . import _core
from .installation import cpuinfo

#: Instructions that Embree, the C library or our trees use where a processor has them.
_DECISIVE = {"avx2", "fma", "avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl"}


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


@cache
def software() -> dict[str, str]:
    """What must be the same on two machines for a job to be the same on both."""
    package = Path(__file__).parent
    digest = hashlib.sha256()
    for file in sorted(package.rglob("*")):
        if file.is_file() and "__pycache__" not in file.parts:
            digest.update(f"{file.relative_to(package)}\0{file.stat().st_size}\0".encode())
            digest.update(file.read_bytes())
    versions = {key: value for key, value in describe().items() if key != "cpu"}
    return {**versions, "installed package mitsuba_bsp": f"SHA-256 {digest.hexdigest()}"}


@cache
def arithmetic() -> dict[str, str]:
    """What besides decides the last bits of an image: the C library, and what processors compute in their own ways.

    These are approximate reciprocals, which differ between vendors, and the instructions among which Embree chooses.
    """
    about = cpuinfo()
    instructions = sorted(set(about.get("flags", "").split()) & _DECISIVE)
    vendor = about.get("vendor_id", "unknown")
    return {"C library": c_library(), "processor": f"{vendor} with {' '.join(instructions) or 'none of AVX2'}"}


def c_library() -> str:
    """The C library, whose sines and the like decide the last bits of an image."""
    return " ".join(platform.libc_ver())


def available_threads() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0))


def _processor() -> str:
    """The processor's name as Linux knows it; the name alone may be that of several generations."""
    about = cpuinfo()
    if "model name" not in about:
        return platform.machine()
    return f"{about['model name']} (family {about.get('cpu family')}, model {about.get('model')})"
