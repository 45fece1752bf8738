"""Cost images: the integrator `raycost` counts what the rays of another integrator cost, pixel by pixel."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.exr import channels

from .plugin_scenes import ball, facing_down, group, view

RESOLUTION, SPP = 16, 4
COUNTERS = ("rays", "axis_steps", "oblique_steps", "leaves_visited", "triangle_tests")
OWN = [f"{of}.{name}" for of in ("camera", "shadow", "path") for name in COUNTERS]


def costs_of(spec: str, integrator: dict[str, Any] | None, **settings: Any) -> tuple[mi.Scene, dict[str, np.ndarray]]:
    """A ball under a lamp, and every channel of its image besides the colours."""
    scene = view(RESOLUTION)
    blocks = {key: value for key, value in scene["integrator"].items() if key == "block_size"}
    scene["integrator"] = {"type": "raycost", **blocks} | ({"of": integrator} if integrator else {})
    scene["camera"]["film"]["rfilter"] = {"type": "box"}
    lamp = {"type": "rectangle", "to_world": facing_down(1, (0, 0, 5)), "e": {"type": "area"}}
    scene["shapes"] = group(spec, {"ball": ball(), "lamp": lamp}) | {"count": True} | settings
    made = mi.load_dict(scene)
    image = np.array(mi.render(made, spp=SPP, seed=3))
    return made, channels(image, made.integrator().aov_names())


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
@pytest.mark.parametrize("inner", ["path", "direct", "volpath"])
def test_the_sums_are_what_the_accelerator_counts(spec: str, inner: str) -> None:
    """The camera ray is asked for once more, which is the only work that the counters of the group have besides."""
    made, found = costs_of(spec, {"type": inner})
    counted = mitsuba_bsp.statistics(made)["counters"]
    total = {name: float(found[name].sum() * SPP) for name in OWN}
    assert 0 < total["camera.rays"] < SPP * RESOLUTION**2  # the others miss the box of the group
    for name in COUNTERS:
        assert total[f"shadow.{name}"] == counted["any"][name]
        closest = total[f"path.{name}"] - total[f"shadow.{name}"]
        assert closest + total[f"camera.{name}"] == counted["closest"][name]
        assert (found[f"path.{name}"] >= found[f"camera.{name}"]).all()
    assert total["path.triangle_tests"] > total["camera.triangle_tests"] > 0


def test_the_picture_is_that_of_the_integrator_inside() -> None:
    _, found = costs_of("kd", {"type": "path", "max_depth": 3})
    scene = view(RESOLUTION)
    scene["integrator"] |= {"type": "path", "max_depth": 3}
    scene["camera"]["film"]["rfilter"] = {"type": "box"}
    lamp = {"type": "rectangle", "to_world": facing_down(1, (0, 0, 5)), "e": {"type": "area"}}
    made = mi.load_dict(scene | {"shapes": group("kd", {"ball": ball(), "lamp": lamp})})
    plain = channels(np.array(mi.render(made, spp=SPP, seed=3)), [])
    assert all(found[name].tobytes() == plain[name].tobytes() for name in plain)
    assert set(plain) >= {"R", "G", "B"}


def test_without_an_integrator_there_are_camera_rays_only() -> None:
    _, found = costs_of("kd", None)
    for name in COUNTERS:
        assert (found[f"path.{name}"] == found[f"camera.{name}"]).all() and not found[f"shadow.{name}"].any()
    assert not found["R"].any() and found["camera.triangle_tests"].any()


def test_variables_of_the_integrator_inside_come_first() -> None:
    inner = {"type": "aov", "aovs": "dd:depth", "img": {"type": "path"}}
    made, found = costs_of("kd", inner)
    assert made.integrator().aov_names()[-len(OWN) :] == OWN
    assert len(made.integrator().aov_names()) > len(OWN)
    assert found["camera.rays"].max() == 1 and found[made.integrator().aov_names()[0]].max() > 0


def test_nothing_is_counted_after_it() -> None:
    """A render without it leaves the counters of its own group alone, if these are not asked for."""
    _, first = costs_of("kd", {"type": "path"})
    _, second = costs_of("kd", {"type": "path"})
    assert all(first[name].tobytes() == second[name].tobytes() for name in first)


@pytest.mark.parametrize(
    ("integrator", "sentence"),
    [
        ({"of": {"type": "ptracer"}}, 'the child "of" of a raycost is no integrator that samples pixels'),
        ({"a": {"type": "path"}, "b": {"type": "path"}}, "a raycost takes one integrator"),
    ],
)
def test_mistakes(integrator: dict[str, Any], sentence: str) -> None:
    with pytest.raises(RuntimeError, match=sentence):
        mi.load_dict({"type": "raycost", **integrator})


def test_a_scene_without_trees_has_no_costs(capfd: pytest.CaptureFixture[str]) -> None:
    scene = view(RESOLUTION) | {"ball": {"type": "sphere"}}
    scene["integrator"] = {"type": "raycost", "of": {"type": "path"}}
    mi.set_log_level(mi.LogLevel.Warn)
    image = np.array(mi.render(mi.load_dict(scene), spp=1))
    assert not image[..., 4:].any()
    assert "no camera ray was counted" in "".join(capfd.readouterr())
