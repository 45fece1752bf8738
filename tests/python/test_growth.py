"""The growth of building: tessellated meshes, and the fit on times that are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mitsuba_bsp.build_table import Growth, make_growth_tables
from mitsuba_bsp.comparison import SceneInfo
from mitsuba_bsp.figures import save_figure
from mitsuba_bsp.growth import fit_growth, sizes_from, tessellate
from mitsuba_bsp.growth_plot import growth_figure
from mitsuba_bsp.scene_content import Content

SIZES = np.array([1e5, 3e5, 1e6, 3e6])

SQUARE = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], np.float32)


class TestFit:
    def test_a_power_is_found_again(self) -> None:
        law = fit_growth(SIZES, 3e-6 * SIZES**1.2)
        assert law.exponent.value == pytest.approx(1.2)
        assert law.exponent.low == pytest.approx(1.2, abs=1e-6) and law.exponent.high == pytest.approx(1.2, abs=1e-6)
        assert law.seconds(SIZES) == pytest.approx(3e-6 * SIZES**1.2)

    def test_n_log_n_has_its_own_exponent(self) -> None:
        law = fit_growth(SIZES, SIZES * np.log2(SIZES))
        assert law.exponent.value == pytest.approx(law.linearithmic)
        assert 1 < law.linearithmic < 1.1

    def test_noise_widens_the_interval(self) -> None:
        law = fit_growth(SIZES, SIZES * [1.02, 0.98, 1.02, 0.98])
        assert law.exponent.low < 0.99 and 1 < law.exponent.high < 1.1

    def test_two_sizes_are_too_few(self) -> None:
        with pytest.raises(ValueError, match="a fit needs 3 sizes, but there are 2"):
            fit_growth([1, 2], [1, 2])


class TestTessellation:
    @pytest.mark.parametrize("wanted", [2, 5, 8, 17, 32, 1001])
    def test_about_as_many_triangles_on_the_same_surface(self, wanted: int) -> None:
        vertices, faces = tessellate(SQUARE, wanted)
        assert abs(len(faces) - wanted) <= 1
        a, b, c = (vertices[faces[:, i]].astype(float) for i in range(3))
        areas = np.cross(b - a, c - a)[:, 2] / 2
        assert (areas > 0).all() and areas.sum() == pytest.approx(1)
        assert np.ptp(np.log2(areas)) <= 2

    def test_sizes_start_at_the_scene_itself(self) -> None:
        assert sizes_from(150, [100, 120, 300, 500]) == [150, 300, 500]
        with pytest.raises(ValueError, match="a fit needs 3 sizes of at least the scene's own 400 triangles"):
            sizes_from(400, [100, 300, 500])


def grown(exponent: float, peak: int | None) -> Growth:
    seconds = 1e-6 * SIZES**exponent
    runs = tuple(
        [
            {
                "build_s": time,
                "peak_build_bytes": peak and peak * int(n),
                "triangles": int(n),
                "statistics": {"bytes": 80 * int(n), "references": 2 * int(n), "capped_leaves": 1234},
            }
        ]
        for n, time in zip(SIZES, seconds, strict=True)
    )
    return Growth("kd", tuple(map(int, SIZES)), tuple(seconds), runs, fit_growth(SIZES, seconds))


def test_tables_and_figure(tmp_path: Path) -> None:
    scene = SceneInfo("knot", Path("knot.xml"), "", Content(100_000, 1, {}), 4, (8, 8), True, True)
    exponents, every = make_growth_tables(scene, [grown(1.2, 2000), grown(1.1, None)])
    assert exponents.rows[0] == ("kd", "1.200 [1.200, 1.200]", "1.076", "NO", "2,000", "NO")
    assert exponents.rows[1][3:] == ("yes", "-", "-")
    assert every.rows[0][1:] == ("100,000", "1.000", "0.0%", "602.1", "2,000", "80", "2.00", "1,234")
    assert len(every.rows) == 8
    figure = growth_figure("Building", [grown(1.2, 2000), grown(1.1, None)])
    png, svg = save_figure(figure, tmp_path, "growth")
    assert png.stat().st_size > 10_000
    text = svg.read_text()
    assert all(word in text for word in ("triangles", "build time (s)", "n log n"))
    save_figure(growth_figure("Building", [grown(1.2, 2000), grown(1.1, None)]), tmp_path, "growth")
    assert svg.read_text() == text
