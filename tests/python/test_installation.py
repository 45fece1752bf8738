"""What importing the package checks and does."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import PackageNotFoundError

import mitsuba as mi
import pytest

import mitsuba_bsp
from mitsuba_bsp import installation


def test_another_mitsuba_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(installation, "version", lambda _: "3.8.0")
    with pytest.raises(ImportError, match=r"^mitsuba_bsp works with mitsuba 3\.9\.1 only, but 3\.8\.0 is installed"):
        installation.check_mitsuba()


def test_no_mitsuba_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(installation, "version", missing)
    with pytest.raises(ImportError, match=r"needs mitsuba 3\.9\.1, which is not installed"):
        installation.check_mitsuba()


def test_a_processor_without_avx2_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    installation.check_processor()
    flags = " ".join(installation.PROCESSOR_FEATURES - {"avx2", "fma"})
    monkeypatch.setattr(installation, "cpuinfo", lambda: {"flags": flags})
    with pytest.raises(ImportError, match=r"needs a processor with AVX2 .*, but this one has no avx2, fma$"):
        installation.check_processor()


def test_a_missing_extension_is_one_sentence() -> None:
    code = "import sys; sys.modules['mitsuba_bsp._core'] = None; import mitsuba_bsp"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.returncode == 1
    last = result.stderr.splitlines()[-1]
    assert last.startswith("ImportError: the compiled part of mitsuba_bsp is missing or does not load")
    assert "pip install" in last


def test_importing_registers_the_plugins_and_sets_no_variant() -> None:
    code = (
        "import mitsuba as mi; before = len(mi.file_resolver()); import mitsuba_bsp; "
        "print(mi.variant(), len(mi.file_resolver()) - before, list(mi.file_resolver())[-1])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.split() == ["None", "1", str(mitsuba_bsp.plugin_dir())]


def test_without_a_variant_loading_says_which_ones_work() -> None:
    code = "import mitsuba_bsp; mitsuba_bsp.load_dict({'type': 'scene'}, 'embree')"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    last = result.stderr.splitlines()[-1]
    assert last.startswith("RuntimeError: no variant is set, but mitsuba_bsp works in scalar_rgb, scalar_spectral,")


def test_the_folders_are_those_of_the_package() -> None:
    assert (mitsuba_bsp.plugin_dir() / "plugins").is_dir()
    assert list(mitsuba_bsp.scenes_dir().glob("*.xml"))
    assert str(mitsuba_bsp.plugin_dir()) in [str(folder) for folder in mi.file_resolver()]
