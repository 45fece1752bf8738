"""Saved trees of arrays, and on the command line."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp import Accelerator
from mitsuba_bsp.records import ResultsFolder
from mitsuba_bsp.verification.meshes import sphere

MESH = sphere("ball", 12)

BUILD = """
import sys, warnings
from mitsuba_bsp import Accelerator
from mitsuba_bsp.verification.meshes import sphere
warnings.simplefilter("error")
mesh = sphere("ball", 60)
print("ready", flush=True)
sys.stdin.readline()
print(Accelerator(mesh.vertices, mesh.faces, "normals", cache=sys.argv[1]).statistics()["loaded"])
"""


def rays(count: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(1)
    origins = rng.uniform(-3, 3, (count, 3)).astype(np.float32)
    return origins, rng.uniform(-1, 1, (count, 3)).astype(np.float32) - origins


@pytest.mark.parametrize("spec", ["kd", "random", "normals", "clustered"])
def test_a_loaded_tree_answers_bit_for_bit_as_the_built_one(tmp_path: Path, spec: str) -> None:
    built, loaded = (Accelerator(MESH.vertices, MESH.faces, spec, cache=tmp_path) for _ in range(2))
    assert [tree.statistics()["loaded"] for tree in (built, loaded)] == [False, True]
    assert np.array_equal(built.planes(), loaded.planes())
    answers = [tree.closest(*rays(5000)) for tree in (built, loaded)]
    assert np.isfinite(answers[0]["t"]).any()
    assert all(answers[0][key].tobytes() == answers[1][key].tobytes() for key in answers[0])
    work = [tree.count(*rays(1000)) for tree in (built, loaded)]
    assert all(np.array_equal(work[0][key], work[1][key]) for key in work[0])


def test_no_folder_means_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        assert not Accelerator(MESH.vertices, MESH.faces).statistics()["loaded"]
    assert not list(tmp_path.iterdir())


def test_trouble_is_a_warning(tmp_path: Path) -> None:
    Accelerator(MESH.vertices, MESH.faces, cache=str(tmp_path))
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:200])
    with pytest.warns(UserWarning, match="the saved tree .* it is built again"):
        tree = Accelerator(MESH.vertices, MESH.faces, cache=tmp_path)
    assert not tree.statistics()["loaded"]
    assert Accelerator(MESH.vertices, MESH.faces, cache=tmp_path).statistics()["loaded"]
    with pytest.warns(UserWarning, match="the tree cannot be saved as"):
        Accelerator(MESH.vertices, MESH.faces, cache=file)


def test_processes_that_keep_the_same_tree_at_once(tmp_path: Path) -> None:
    command = [sys.executable, "-c", BUILD, str(tmp_path)]
    several = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    assert [process.stdout.readline() for process in several] == ["ready\n"] * 3
    for process in several:
        process.stdin.write("\n")
        process.stdin.flush()
    assert {process.communicate(timeout=60)[0].strip() for process in several} <= {"True", "False"}
    assert all(process.returncode == 0 for process in several)
    assert len(list(tmp_path.iterdir())) == 1
    assert subprocess.run(command, input="\n", capture_output=True, text=True, check=True).stdout.split()[-1] == "True"


def test_loading_is_faster_than_building(tmp_path: Path) -> None:
    mesh = sphere("large", 160)  # 100,000 triangles: the factor is near 50, but a busy machine must not fail the test
    built, loaded = (Accelerator(mesh.vertices, mesh.faces, cache=tmp_path).statistics() for _ in range(2))
    assert loaded["loaded"] and loaded["build_s"] < built["build_s"] / 2


def test_render_says_whether_it_built_or_loaded(
    room: Path, command: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    words = ("render", room, "--spec", "normals", "--spp", "1", "-o", "image.exr", "--cache", "trees")
    said = [command(*words).stdout for _ in range(2)]
    assert "built in" in said[0] and "loaded in" in said[1]


def test_compare_marks_trees_that_it_loaded(
    room: Path, tmp_path: Path, command: Callable[..., subprocess.CompletedProcess[str]]
) -> None:
    words = ("compare", room, "--specs", "native", "kd", "--spp", "1", "--resolution", "8", "--out")
    assert command(*words, "kept", "--cache", "trees").returncode == 0
    assert command(*words, "plain").returncode == 0
    loaded = {
        name: {str(row["spec"]): row["statistics"].get("loaded") for row in ResultsFolder(tmp_path / name).records()}
        for name in ("kept", "plain")
    }
    assert loaded == {"kept": {"native": None, "kd": True}, "plain": {"native": None, "kd": False}}
    assert "loaded" in (tmp_path / "kept" / "table.md").read_text().split("| spec")[1]
    assert "loaded" not in (tmp_path / "plain" / "table.md").read_text().split("| spec")[1]
