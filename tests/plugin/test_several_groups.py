"""Several groups in one scene, as a user writes them, loaded by Mitsuba itself."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp

from .plugin_scenes import assert_same_up_to_rounding, ball, pixels, place, ray, view
from .test_emitters import lamp, surfaces, textured

PARTS = {
    "walls": ("bsptree", {"tree": "kd"}),
    "things": ("bsptree", {"tree": "normals", "k": 5}),
    "lamps": ("nativekdtree", {}),
    "mixed": ("bsptree", {"tree": "random"}),
}


def parts() -> dict[str, dict[str, Any]]:
    """Shapes with lamps among them; the third group has only lamps, the last has both."""
    solid = surfaces()
    return {
        "walls": {"floor": solid["floor"]},
        "things": {"box": solid["box"], "ball": solid["ball"]},
        "lamps": {"red": lamp((-1, 0, 3), [9, 1, 1]), "green": lamp((1, 0, 3), [1, 9, 1])},
        "mixed": {"glow": textured((0, 1, 2)), "small": ball(centre=(0, -1, 0.5), scale=0.1)},
    }


def description(grouped: bool) -> dict[str, Any]:
    scene = {**view(hide_emitters=True), "aside": {"type": "sphere", "center": [2, 2, 0.5], "radius": 0.5}}
    for name, shapes in parts().items():
        plugin, settings = PARTS[name]
        scene |= {name: {"type": plugin, **settings, **shapes}} if grouped else shapes
    return scene


def test_the_image_is_that_of_the_plain_scene() -> None:
    plain, grouped = (mi.load_dict(description(g), optimize=False) for g in (False, True))
    assert [s.id() for s in grouped.shapes()] == [s.id() for s in plain.shapes()]
    assert_same_up_to_rounding(pixels(grouped, spp=16), pixels(plain, spp=16), share=0.01)


def test_each_answers_for_itself() -> None:
    scene = mi.load_dict(description(True), optimize=False)
    found = mitsuba_bsp.statistics(scene)
    assert [tree["spec"].partition(":")[0] for tree in found["trees"]] == ["kd", "normals", "native", "random"]
    assert [tree["triangles"] for tree in found["trees"]] == [2, 12 + 288, 4, 2 + 288]
    assert found["triangles"] == sum(tree["triangles"] for tree in found["trees"])
    assert found["spec"].count(" + ") == 3
    for x, name in ((0.01, "floor"), (-0.6, "box"), (0.9, "ball")):
        assert scene.ray_intersect(ray([x, 0.02, 1.9], [0, 0, -1])).shape.id() == name
    assert scene.ray_intersect(ray([2, 2, 9], [0, 0, -1])).shape.id() == "aside"


def test_an_edit_rebuilds_one(capfd: pytest.CaptureFixture[str]) -> None:
    scene = mi.load_dict(description(True), optimize=False)
    params = mi.traverse(scene)
    mi.set_log_level(mi.LogLevel.Info)
    params["ball.vertex_positions"] = np.array(params["ball.vertex_positions"]) + np.float32(0.1)
    params.update()
    mi.set_log_level(mi.LogLevel.Warn)
    said = capfd.readouterr().out
    assert said.count("bsptree normals") == 1 and said.count("bsptree") == 1 and "nativekdtree" not in said


def test_the_harness_makes_one_of_them() -> None:
    scene = mitsuba_bsp.load_dict(description(True), "kd")
    assert "trees" not in mitsuba_bsp.statistics(scene)
    plain = mi.load_dict(description(False), optimize=False)
    assert_same_up_to_rounding(pixels(scene, spp=16), pixels(plain, spp=16), share=0.01)


def test_groups_in_shape_groups_and_outside() -> None:
    inside = {"type": "bsptree", "tree": "clustered", "cube": {"type": "cube"}}
    scene = mi.load_dict({
        "type": "scene",
        "group": {"type": "shapegroup", "tree": inside, "other": {"type": "nativekdtree", "b": ball(centre=(0, 0, 3))}},
        "placed": {"type": "instance", "to_world": place(at=(5, 0, 0)), "g": {"type": "ref", "id": "group"}},
        "outside": {"type": "bsptree", "cube": {"type": "cube"}},
    }, optimize=False)  # fmt: skip
    for x, t in ((0.1, 8), (5.1, 5.1)):
        assert scene.ray_intersect(ray([x, 0.1, 9], [0, 0, -1])).t == pytest.approx(t, abs=0.1)
    assert {tree["shape_group"] for tree in mitsuba_bsp.statistics(scene)["trees"]} == {"", "group"}
