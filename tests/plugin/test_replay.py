"""Recorded answers: one thread that asks again as it did gets the same image, without a tree; all else is refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.streams import RECORDED

from .plugin_scenes import ball, facing_down, group, pixels, view

MISS = 2**32 - 1


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    before = dr.thread_count()
    dr.set_thread_count(1)
    yield
    dr.set_thread_count(before)


def scene(spec: str = "kd", **properties: Any) -> dict[str, Any]:
    """Glass and grey under a lamp that is grouped too, beside a sphere that is not, seen through a wide filter."""
    shapes = {
        "ball": ball(mi.load_dict({"type": "dielectric"})),
        "floor": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(4)},
        "lamp": {"type": "rectangle", "to_world": facing_down(1, (0, 0, 4)), "e": {"type": "area"}},
    }
    made = view() | {"beside": {"type": "sphere", "center": [1.5, 0, 1], "radius": 0.4}}
    made["camera"]["film"]["rfilter"] = {"type": "gaussian"}
    return made | {"group": group(spec, shapes) | properties}


def recording(file: Path, spec: str = "kd", **properties: Any) -> np.ndarray:
    """The image of a frame that is recorded to `file`."""
    made = mi.load_dict(scene(spec, record=str(file), **properties))
    image = pixels(made)
    mitsuba_bsp.statistics(made)
    return image


@pytest.mark.parametrize("spec", ["kd", "normals", "kd:triangle_test=mt"])
def test_every_frame_is_the_recorded_one(tmp_path: Path, spec: str) -> None:
    """After the last answer comes the first again."""
    expected = recording(tmp_path / "frame", spec)
    made = mi.load_dict(scene(spec, replay=str(tmp_path / "frame")))
    for _ in range(3):
        assert pixels(made).tobytes() == expected.tobytes()


def test_lamps_that_are_hidden(tmp_path: Path) -> None:
    """Then two members of the group ask about a ray, and one answer is for both."""

    def hiding(**properties: Any) -> mi.Scene:
        description = scene(**properties)
        description["integrator"]["hide_emitters"] = True
        return mi.load_dict(description)

    recorder = hiding(record=str(tmp_path / "frame"))
    expected = pixels(recorder)
    mitsuba_bsp.statistics(recorder)
    made = hiding(replay=str(tmp_path / "frame"))
    assert pixels(made).tobytes() == pixels(made).tobytes() == expected.tobytes()


def test_the_answers_are_the_recorded_ones_not_those_to_the_rays(tmp_path: Path) -> None:
    recording(tmp_path / "frame")
    rays = np.fromfile(tmp_path / "frame", RECORDED)
    rays["triangle"] = MISS
    rays.tofile(tmp_path / "frame")
    made = mi.load_dict(scene(replay=str(tmp_path / "frame")))
    assert pixels(made).tobytes() != pixels(mi.load_dict(scene())).tobytes()
    assert mitsuba_bsp.statistics(made)["spec"] == "free"


def test_counted_rays_are_those_of_the_recorded_frame(tmp_path: Path) -> None:
    recording(tmp_path / "frame")
    made = mi.load_dict(scene(replay=str(tmp_path / "frame"), count=True))
    pixels(made)
    counters = mitsuba_bsp.statistics(made)["counters"]
    assert sum(kind["rays"] for kind in counters.values()) == len(np.fromfile(tmp_path / "frame", RECORDED))
    assert not any(kind["triangle_tests"] for kind in counters.values())


class TestRefusals:
    """Each in one sentence."""

    @pytest.fixture
    def file(self, tmp_path: Path) -> Path:
        recording(tmp_path / "frame")
        return tmp_path / "frame"

    def refused(self, file: Path, sentence: str) -> None:
        with pytest.raises(RuntimeError, match=sentence) as caught:
            mi.load_dict(scene(replay=str(file)))
        assert "\n" not in str(caught.value).partition("replay: ")[2].strip()

    def test_more_threads(self, file: Path) -> None:
        dr.set_thread_count(2)
        self.refused(file, "replay: .* one thread asked, but there are 2 threads: set the number of threads to 1")

    def test_no_such_file(self, tmp_path: Path) -> None:
        self.refused(tmp_path / "gone", r'replay: cannot read the file ".*gone"')
        self.refused(tmp_path, r"replay: cannot read the file")

    @pytest.mark.parametrize("size", [0, 39, 41])
    def test_a_file_that_was_cut_off(self, file: Path, size: int) -> None:
        file.write_bytes(file.read_bytes()[:size])
        self.refused(file, f'replay: the file ".*frame" has {size} bytes, but a recording has 48 for each of its rays')

    def test_the_recording_of_another_scene(self, file: Path) -> None:
        rays = np.fromfile(file, RECORDED)
        rays["triangle"][7] = 123456
        rays.tofile(file)
        self.refused(
            file, r"replay: a ray in .* hit triangle 123456, but here are only \d+: it was recorded with another"
        )
