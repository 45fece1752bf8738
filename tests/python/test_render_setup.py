"""What a comparison changes in a scene before it renders it."""

from __future__ import annotations

from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp import parse_spec
from mitsuba_bsp.loading import open_file, parsed_file
from mitsuba_bsp.render_setup import BLOCK_SIZE, fix_block_size, has_box_filter, set_resolution, use_box_filter


def scene(tmp_path: Path, film: str, integrator: str = '<integrator type="path"/>') -> Path:
    path = tmp_path / "scene.xml"
    path.write_text(f'<scene version="3.0.0">{integrator}<sensor type="perspective">{film}</sensor></scene>')
    return path


def film_of(path: Path, edit: object) -> mi.Film:
    loaded = open_file(path, edit=edit)
    return loaded.construct(loaded.regrouped(parse_spec("embree"))).sensors()[0].film()


@pytest.mark.parametrize(
    ("properties", "longer", "size"),
    [
        ("", 64, (64, 48)),  # Mitsuba's default is 768 x 576
        ('<integer name="width" value="300"/><integer name="height" value="400"/>', 100, (75, 100)),
        ('<integer name="width" value="1000"/><integer name="height" value="1"/>', 10, (10, 1)),
        ('<integer name="width" value="10"/><integer name="height" value="10"/>', 40, (40, 40)),
    ],
)
def test_resolution_is_the_longer_side(tmp_path: Path, properties: str, longer: int, size: tuple[int, int]) -> None:
    path = scene(tmp_path, f'<film type="hdrfilm">{properties}</film>')
    assert tuple(film_of(path, lambda state: set_resolution(state, longer)).size()) == size


def test_a_crop_window_is_scaled_too(tmp_path: Path) -> None:
    window = {
        "width": 100,
        "height": 100,
        "crop_width": 50,
        "crop_height": 20,
        "crop_offset_x": 50,
        "crop_offset_y": 80,
    }
    properties = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in window.items())
    path = scene(tmp_path, f'<film type="hdrfilm">{properties}</film>')
    film = film_of(path, lambda state: set_resolution(state, 10))
    assert tuple(film.size()) == (10, 10)
    assert tuple(film.crop_size()) == (5, 2)
    assert tuple(film.crop_offset()) == (5, 8)


@pytest.mark.parametrize("film", ["", '<film type="hdrfilm"/>', '<film type="hdrfilm"><rfilter type="tent"/></film>'])
def test_the_box_filter_replaces_any_other(tmp_path: Path, film: str) -> None:
    path = scene(tmp_path, film)
    with parsed_file(path) as (_, state):
        assert not has_box_filter(state)
        use_box_filter(state)
        assert has_box_filter(state)
    assert film_of(path, use_box_filter).rfilter().is_box_filter()


@pytest.mark.parametrize(
    ("integrator", "known", "size"),
    [
        ('<integrator type="path"/>', True, BLOCK_SIZE),
        ('<integrator type="path"><integer name="block_size" value="8"/></integrator>', True, 8),
        ('<integrator type="ptracer"/>', False, None),
    ],
)
def test_the_block_size_is_fixed_where_it_exists(
    tmp_path: Path, integrator: str, known: bool, size: int | None
) -> None:
    path = scene(tmp_path, "", integrator)
    with parsed_file(path) as (_, state):
        assert fix_block_size(state) is known
        node = next(node for node in state.nodes if node.type == mi.ObjectType.Integrator)
        assert node.props.get("block_size") == size


def test_the_inner_integrator_of_another_one_is_left_alone(tmp_path: Path) -> None:
    path = scene(tmp_path, "", '<integrator type="moment"><integrator type="path"/></integrator>')
    with parsed_file(path) as (_, state):
        assert fix_block_size(state)
        nodes = [node.props for node in state.nodes if node.type == mi.ObjectType.Integrator]
        assert {props.plugin_name(): props.get("block_size") for props in nodes} == {"moment": BLOCK_SIZE, "path": None}


def test_small_images_do_not_depend_on_the_number_of_threads(room: Path) -> None:
    def image(threads: int, fixed: bool) -> np.ndarray:
        before = dr.thread_count()
        dr.set_thread_count(threads)
        try:
            loaded = open_file(room, edit=fix_block_size if fixed else None)
            scene = loaded.construct(loaded.regrouped(parse_spec("embree")))
            return np.array(mi.render(scene, spp=2, seed=3))
        finally:
            dr.set_thread_count(before)

    assert np.array_equal(image(1, fixed=True), image(8, fixed=True))
    assert not np.array_equal(image(1, fixed=False), image(8, fixed=False))
