"""The command `heatmap`: cost images side by side, their tables, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from mitsuba_bsp.cli import main
from mitsuba_bsp.exr import read_exr


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as stopped:
        main([*map(str, words)])
    return int(stopped.value.code or 0)


def test_pictures_and_tables_of_every_quantity(room: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    words = ["heatmap", room, "--specs", "native", "kd", "normals", "--resolution", "16", "--spp", "2"]
    assert run(*words, "--out", tmp_path / "out") == 0
    shown = capfd.readouterr().out
    assert shown.count("p99 / mean") == 2 and "whole paths" in shown and "camera rays" in shown
    for quantity in ("cost", "steps", "leaves", "tests"):
        for suffix in ("png", "svg"):
            assert (tmp_path / "out" / f"heatmap-room-{quantity}.{suffix}").stat().st_size > 10_000
    planes = read_exr(next((tmp_path / "out" / "images").rglob("*kd.exr")))
    assert planes["path.rays"].shape == (16, 16) and (planes["path.rays"] >= planes["camera.rays"]).all()
    before = (tmp_path / "out" / "table.md").read_bytes()
    assert run(*words, "--out", tmp_path / "out") == 0
    assert (tmp_path / "out" / "table.md").read_bytes() == before
    assert "3 of 3 jobs were finished" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("integrator", "spec", "sentence"),
    [
        ("path", "embree", "Embree does not count its work: leave it out of --specs"),
        ("ptracer", "kd", 'the integrator "ptracer" traces its rays for the whole image, so no pixel has a cost'),
    ],
)
def test_what_has_no_cost(
    room: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], integrator: str, spec: str, sentence: str
) -> None:
    room.write_text(room.read_text().replace('integrator type="path"', f'integrator type="{integrator}"'))
    words = ["heatmap", room, "--specs", spec, "--resolution", "16", "--spp", "2", "--out", tmp_path / "out"]
    assert run(*words) in (1, 2)
    assert sentence in " ".join("".join(capfd.readouterr()).split())
