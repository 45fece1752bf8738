"""Images on disk: every bit of every channel, and what made them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp.exr import read_exr, read_header, write_exr


def test_pixels_survive_bit_for_bit(tmp_path: Path) -> None:
    pixels = np.random.default_rng(5).random((6, 5, 3)).astype(np.float32)
    pixels[0, 0] = (-0.0, 1e-40, 3e38)
    write_exr(tmp_path / "a.exr", pixels, [], {})
    found = read_exr(tmp_path / "a.exr")
    assert set(found) == {"R", "G", "B"}
    for index, name in enumerate("RGB"):
        assert found[name].tobytes() == np.ascontiguousarray(pixels[..., index]).tobytes()


def test_the_header_says_what_made_the_image(tmp_path: Path) -> None:
    header = {"spec": "normals:k=6,axes=fast", "scene_hash": "0" * 64, "version_mitsuba": "3.9.1"}
    write_exr(tmp_path / "a.exr", np.zeros((2, 2, 3), np.float32), [], header)
    assert header.items() <= read_header(tmp_path / "a.exr").items()


@pytest.mark.parametrize(
    ("channels", "extra", "names"),
    [(1, [], {"Y"}), (4, [], {"R", "G", "B", "A"}), (5, ["dd.y", "nn.X"], {"R", "G", "B", "dd.y", "nn.X"})],
)
def test_channels_are_named(tmp_path: Path, channels: int, extra: list[str], names: set[str]) -> None:
    write_exr(tmp_path / "a.exr", np.zeros((2, 3, channels), np.float32), extra, {})
    assert set(read_exr(tmp_path / "a.exr")) == names


def test_no_half_written_file_is_left(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.zeros((2, 2, 3), np.float32), [], {})
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]
