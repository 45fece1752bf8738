"""Many threads render what one renders, and the tree is built once."""

from __future__ import annotations

from collections.abc import Iterator

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.verification.meshes import soup

from .plugin_scenes import ball, facing_down, group, load, pixels, place, to_mesh, view


@pytest.fixture
def _threads() -> Iterator[None]:
    before = dr.thread_count()
    yield
    dr.set_thread_count(before)


def description() -> dict[str, object]:
    mesh = soup("soup", 3000, edge=0.3)
    return {
        **view(64),
        "floor": {"type": "rectangle", "to_world": place(4, at=(0, 0, -1))},
        "soup": to_mesh(mesh.vertices, mesh.faces),
        "ball": ball(mi.load_dict({"type": "dielectric"}), centre=(0, -2, 0), scale=0.4),
        "lamp": {"type": "rectangle", "to_world": facing_down(1, (0, 0, 4)), "emitter": {"type": "area"}},
        "small": {"type": "rectangle", "to_world": facing_down(0.1, (1, 0, 1)), "emitter": {"type": "area"}},
    }


@pytest.mark.usefixtures("_threads")
@pytest.mark.parametrize("spec", ["kd", "normals", "native", "random:triangle_test=mt"])
def test_any_number_of_threads_makes_the_same_image(spec: str) -> None:
    images = []
    for threads in (1, 2, 7):
        dr.set_thread_count(threads)
        images.append(pixels(load(description(), spec)))
    assert images[0].std() > 0.01
    for image in images[1:]:
        assert np.array_equal(image, images[0])


@pytest.mark.usefixtures("_threads")
@pytest.mark.parametrize("spec", ["kd", "native"])
def test_no_ray_is_counted_twice_or_lost(spec: str) -> None:
    """Counters are shared by all threads: they must add up to what one thread counts."""
    found = []
    for threads in (1, 8):
        dr.set_thread_count(threads)
        shapes = {k: v for k, v in description().items() if k not in view()}
        scene = mi.load_dict({**view(64), "g": group(spec, shapes) | {"count": True}}, optimize=False)
        image = pixels(scene)
        found.append((mitsuba_bsp.statistics(scene)["counters"], image.tobytes()))
    assert found[0] == found[1]
    assert found[0][0]["closest"]["rays"] > 64 * 64 * 8 and found[0][0]["any"]["rays"] > 1000


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
def test_the_tree_is_built_once(spec: str, capfd: pytest.CaptureFixture[str]) -> None:
    """However often the scene is rendered or listed, and with lamps among the children or without."""
    mi.set_log_level(mi.LogLevel.Info)
    scene = load(description(), spec)
    for _ in range(2):
        pixels(scene, spp=1)
    assert "Member" in str(scene) and len(mi.traverse(scene)) > 0
    mi.set_log_level(mi.LogLevel.Warn)
    said = capfd.readouterr().out
    built = "nativekdtree: " if spec == "native" else f"bsptree {spec}:"
    assert said.count(built) == 1, said


def test_statistics_stay_what_they_are_while_rendering() -> None:
    scene = load(description(), "kd")
    before = mitsuba_bsp.statistics(scene)
    pixels(scene)
    assert mitsuba_bsp.statistics(scene) == before
    assert "counters" not in before
