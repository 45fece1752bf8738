"""Checks at import, and the folders of the installed package."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

#: Plugins are compiled against the headers of this version, whose layout they share.
MITSUBA_VERSION = "3.9.1"

#: What CMakeLists.txt lets the compiler use, by the names that Linux gives them.
PROCESSOR_FEATURES = {"avx2", "fma", "f16c", "bmi1", "bmi2", "abm", "movbe"}


def check_mitsuba() -> None:
    """Raise ImportError, in one sentence, unless the Mitsuba we were built for is installed."""
    try:
        found = version("mitsuba")
    except PackageNotFoundError:
        raise ImportError(
            f"mitsuba_bsp needs mitsuba {MITSUBA_VERSION}, which is not installed: "
            f"run pip install mitsuba=={MITSUBA_VERSION}"
        ) from None
    if found != MITSUBA_VERSION:
        raise ImportError(
            f"mitsuba_bsp works with mitsuba {MITSUBA_VERSION} only, but {found} is installed: "
            f"run pip install mitsuba=={MITSUBA_VERSION}"
        )


def check_processor() -> None:
    """Raise ImportError, in one sentence, unless the processor has the instructions we were compiled for."""
    missing = sorted(PROCESSOR_FEATURES - set(cpuinfo().get("flags", "").split()))
    if missing:
        raise ImportError(
            f"mitsuba_bsp needs a processor with AVX2 (Intel Core since 2013, AMD since 2015), but this one has no "
            f"{', '.join(missing)}"
        )


def cpuinfo() -> dict[str, str]:
    """What Linux says of the last of its processors."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    return {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in lines)}


def check_extension() -> None:
    """Raise ImportError, in one sentence, unless the compiled extension loads."""
    try:
        from . import _core  # noqa: F401
    except ImportError as error:
        reason = " ".join(str(error).split())
        raise ImportError(
            f"the compiled part of mitsuba_bsp is missing or does not load ({reason}): "
            "install the package again with pip install ."
        ) from None


def plugin_dir() -> Path:
    """The folder that contains `plugins/`, for the stock command: `mitsuba -a DIR scene.xml`."""
    return Path(__file__).absolute().parent


def scenes_dir() -> Path:
    """The folder of the built-in scenes (XML files and their meshes)."""
    return Path(__file__).absolute().parent / "scenes"


def register_plugins() -> None:
    """Let Mitsuba find our plugins."""
    import mitsuba as mi

    mi.file_resolver().append(str(plugin_dir()))
