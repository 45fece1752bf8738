"""Images on disk: every bit of every channel, and what made them."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp.exr import channels, read_exr, read_header, write_exr


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
    [
        (1, [], {"Y"}),
        (4, [], {"R", "G", "B", "A"}),
        (5, ["dd.y", "nn.X"], {"R", "G", "B", "dd.y", "nn.X"}),
        (4, ["i.R", "i.G", "i.B", "i.A", "d.T"], {"i.R", "i.G", "i.B", "d.T"}),
        (3, ["i.R", "i.G", "i.B", "i.A", "j.R", "j.G", "j.B", "j.A", "d.T"], {"i.Y", "j.Y", "d.T"}),
    ],
)
def test_channels_are_named(tmp_path: Path, channels: int, extra: list[str], names: set[str]) -> None:
    write_exr(tmp_path / "a.exr", np.zeros((2, 3, channels), np.float32), extra, {})
    assert set(read_exr(tmp_path / "a.exr")) == names


def test_no_half_written_file_is_left(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.zeros((2, 2, 3), np.float32), [], {})
    assert [path.name for path in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("pixel_format", ["rgb", "rgba", "luminance"])
@pytest.mark.parametrize("inner", [{}, {"i": {"type": "path"}}, {"i": {"type": "path"}, "j": {"type": "direct"}}])
def test_channels_have_the_names_that_mitsuba_gives_them(pixel_format: str, inner: dict) -> None:
    film = {"type": "hdrfilm", "width": 3, "height": 2, "pixel_format": pixel_format}
    scene = mi.load_dict({
        "type": "scene", "s": {"type": "perspective", "film": film}, "e": {"type": "constant", "radiance": 2.0},
        "integrator": {"type": "aov", "aovs": "n:geo_normal,d:depth,a:albedo", **inner},
    })  # fmt: skip
    found = channels(np.array(mi.render(scene, spp=1)), scene.integrator().aov_names())
    assert list(found)[-7:] == ["n.X", "n.Y", "n.Z", "d.T", "a.R", "a.G", "a.B"]
    colours = {"rgb": "RGB", "rgba": "RGBA", "luminance": "Y"}[pixel_format]
    assert list(found)[:-7] == [f"{name}.{colour}" for name in inner for colour in colours]
    for name in inner:
        assert found[f"{name}.{colours[0]}"] == pytest.approx(2.0)
