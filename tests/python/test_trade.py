"""The command `trade`: what is varied, what counts as a failure, and what is made of the records."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import error_line

from mitsuba_bsp import parse_spec
from mitsuba_bsp.contenders import Triangles, build
from mitsuba_bsp.trade import axes, failures, found, questions
from mitsuba_bsp.verification.meshes import Mesh, sphere

Command = Callable[..., subprocess.CompletedProcess[str]]


class TestAxes:
    def test_one_setting_at_a_time(self) -> None:
        specs = axes.factors("normals", ["precision", "k"])
        assert specs[:3] == ["normals", "normals:precision=epsilon", "normals:precision=fast"]
        assert "normals:k=13" in specs and len(specs) == 8
        assert axes.factors("kd", ["k"]) == ["kd"], "a tree without the setting is not varied in it"

    def test_every_axis_is_of_settings_that_exist(self) -> None:
        for name, changes in axes.AXES.items():
            assert len(axes.factors("normals", [name])) == len(changes) + 1, name
        specs = axes.all_specs(["kd", "normals"], list(axes.AXES), True)
        assert len(specs) == len(set(specs))
        assert len({parse_spec(spec).full for spec in specs}) >= 60

    def test_the_grid_leaves_defaults_out(self) -> None:
        grid = axes.grid("kd")
        assert "kd" in grid and "kd:precision=fast,triangle_test=mt,leaf_size=4" in grid
        assert len(grid) == 12 and len(axes.grid("normals")) == 24


def counts(spec: str, mesh: Mesh, family: str = "vertex") -> dict[str, int]:
    triangles = Triangles(((mesh.vertices, mesh.faces),))
    rng = np.random.default_rng(1)
    asked = questions.answered(mesh, family, failures.questions.FAMILIES[family](mesh, 400, rng))
    return failures.counted(mesh, build(parse_spec(spec), triangles), asked)


class TestFailures:
    def test_ours_have_none_and_the_bits_of_the_loop(self) -> None:
        for spec in ("kd", "normals", "kd:triangle_test=mt"):
            found = counts(spec, sphere("ball", 8))
            assert found["triangle"] == found["bits"] == 0, spec
        assert counts("kd", sphere("ball", 8))["wrong"] == 0

    @pytest.mark.parametrize("spec", ["native", "embree", "kd:triangle_test=mt"])
    def test_rays_through_vertices_are_lost_by_others_as_the_oracle_confirms(self, spec: str) -> None:
        found = counts(spec, sphere("ball", 8))
        assert found["wrong"] > 0 and found["hit_or_miss"] > 0
        assert 0 < found["confirmed"] <= found["checked"] <= found["wrong"]

    def test_a_moved_scene_has_the_same_shape(self) -> None:
        mesh = sphere("ball", 4)
        moved = questions.mesh_of("", questions.moved(Triangles(((mesh.vertices, mesh.faces),)), 100.0))
        assert np.linalg.norm(moved.centre - mesh.centre) == pytest.approx(100 * mesh.size, rel=0.01)
        assert np.abs((moved.vertices - moved.centre) - (mesh.vertices - mesh.centre)).max() < 1e-3


class TestWhatWasFound:
    def test_the_worst_family_is_that_with_most_confirmed_failures(self) -> None:
        family = {"rays": 100, "wrong": 10, "checked": 5, "confirmed": 1}
        worst = found.worst({"a": family, "b": {**family, "wrong": 4, "checked": 4, "confirmed": 4}})
        assert worst.family == "b" and worst.confirmed == 0.04 and worst.shown == 0.04
        assert found.worst({"a": {**family, "wrong": 0, "checked": 0, "confirmed": 0}}).shown == 0.03
        assert found.worst({}) is None

    def test_the_front_is_what_nothing_beats(self) -> None:
        points = {"slow": (0.0, 1.0), "safe": (0.0, 2.0), "fast": (0.1, 3.0), "bad": (0.2, 2.5), "free": (0.5, 9.0)}
        assert found.front(points) == ["safe", "fast", "free"]
        assert found.front({}) == []


def test_a_run(command: Command, room: Path, tmp_path: Path) -> None:
    words = ["trade", room, "--trees", "kd", "--axes", "precision", "--rays", "20", "--max-rays", "100"]
    words += ["--resolution", "16", "--spp", "1", "--repeats", "1", "--out", "out"]
    result = command(*words)
    assert result.returncode == 0, result.stderr
    rows = [json.loads(line) for line in (tmp_path / "out" / "records.jsonl").read_text().splitlines()]
    assert {row["measure"] for row in rows} == {"speed", "failures", "far"}
    assert len(rows) == 2 * 6 + 3 + 6
    table = (tmp_path / "out" / "table.md").read_text()
    for title in ("What each guarantee costs", "Mrays/s of one thread", "failures per million rays", "Pareto front"):
        assert title in table
    pictures = {file.name for file in (tmp_path / "out").glob("*.svg")}
    assert pictures == {f"trade-{name}.svg" for name in ("front", "distance", "bounds", "references")}
    again = command(*words)
    assert again.returncode == 0 and "21 of 21 jobs were finished" in again.stderr


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--trees", "oak"], 'there is no tree "oak"'),
        (["--axes", "colour"], 'there is no axis "colour"'),
        (["gone.xml"], "there is no scene file"),
    ],
)
@pytest.mark.usefixtures("room")
def test_bad_input(command: Command, words: list[str], sentence: str) -> None:
    result = command("trade", "room.xml", *words)
    assert result.returncode == 2, result.stderr
    assert sentence in error_line(result)
