"""The notebook runs, and the documentation of the package can be made from its docstrings."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import mitsuba_bsp

DOCS = Path(__file__).parents[2] / "docs"


def test_the_notebook_runs(tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient").NotebookClient
    notebook = nbformat.read(DOCS / "swap-trees.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are not stored"
    source = "\n".join(cell.source for cell in notebook.cells)
    assert not re.search(r"mitsuba_bsp\.\w+ import|import mitsuba_bsp\.", source), "what is not documented may change"
    names = set(re.findall(r"mitsuba_bsp\.(\w+)", source))
    assert "load_file" in names and names <= set(mitsuba_bsp.__all__)
    client(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    shown = [str(output) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("of the area lies along the axes" in text for text in shown)
    assert any("image/png" in text for text in shown)


#: Takes long to build.
SLOW = 'mitsuba_bsp.load_file(mitsuba_bsp.scenes_dir() / "foliage.xml", "random:k=32,axes=none,exact_below=1000000")'


def test_in_a_notebook_builds_show_their_progress_and_can_be_stopped() -> None:
    manager = pytest.importorskip("jupyter_client.manager")
    env = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}  # it shows less to that
    kernel, client = manager.start_new_kernel(startup_timeout=120, env=env)
    shown: list[str] = []

    def run(code: str) -> dict[str, Any]:
        def hook(message: dict[str, Any]) -> None:
            shown.append(message["content"].get("text", ""))
            if "Building the tree" in shown[-1]:
                kernel.interrupt_kernel()

        return client.execute_interactive(code, timeout=120, output_hook=hook)["content"]

    try:
        assert run('import mitsuba as mi, mitsuba_bsp; mi.set_variant("scalar_rgb")')["status"] == "ok"
        stopped = run(SLOW)
        assert any("Building the tree" in text for text in shown)
        assert (stopped["status"], stopped["ename"]) == ("error", "KeyboardInterrupt")
        assert run(SLOW.partition(', "random')[0] + ', "kd")')["status"] == "ok"
    finally:
        client.stop_channels()
        kernel.shutdown_kernel(now=True)


def test_the_api_is_documented(tmp_path: Path) -> None:
    pytest.importorskip("pdoc")
    command = [sys.executable, "-W", "error::UserWarning", str(DOCS / "api.py"), str(tmp_path)]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    page = (tmp_path / "mitsuba_bsp.html").read_text()
    for name in ("load_file", "statistics", "Accelerator", "shapes"):
        assert f'id="{name}"' in page, name


def test_the_page_on_split_sources_names_what_exists() -> None:
    text = (DOCS / "add-a-split-source.md").read_text()
    root = DOCS.parent
    for file, names in {
        "plugin/core/split_source.cpp": ("make_split_source", "add_distinct", "normal_of", "sample("),
        "plugin/core/settings.cpp": ("tree_words", "traits_of", "applies"),
        "plugin/core/settings.h": ("enum class TreeKind",),
        "python/mitsuba_bsp/figures.py": ("COLOURS",),
    }.items():
        assert file.rpartition("/")[2] in text
        for name in names:
            assert name.rstrip("(") in text and name in (root / file).read_text(), name
    assert re.findall(r"```cpp\n", text)
