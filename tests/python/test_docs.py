"""The notebook runs, and the documentation of the package can be made from its docstrings."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


def test_the_notebook_runs(tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat")
    client = pytest.importorskip("nbclient").NotebookClient
    notebook = nbformat.read(DOCS / "swap-trees.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are not stored"
    client(notebook, timeout=300, resources={"metadata": {"path": tmp_path}}).execute()
    shown = [str(output) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert any("of the area lies along the axes" in text for text in shown)
    assert any("image/png" in text for text in shown)


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
