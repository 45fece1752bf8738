"""Edited geometry: the tree is built again, and the image is that of a fresh scene."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp.verification.meshes import sphere

from .plugin_scenes import assert_same_up_to_rounding, ball, group, load, pixels, place, ray, to_mesh, view
from .test_emitters import lamp, surfaces, textured

SPECS = ("kd", "normals", "native")


def scene() -> dict[str, Any]:
    return {**view(), "lamp": lamp((0, 0, 3), [5, 5, 5]), **surfaces(), "glow": textured((1.5, 0, 2))}


def move(name: str, offset: tuple[float, float, float]) -> Callable[[Any], None]:
    """Shift a mesh's vertices."""

    def edit(params: Any) -> None:
        key = f"{name}.vertex_positions"
        params[key] = (np.array(params[key]).reshape(-1, 3) + np.array(offset, np.float32)).ravel()

    return edit


def move_rectangle(params: Any) -> None:
    params["floor.to_world"] = place(3, 10, (0, 0, -0.3))


def move_lamp(params: Any) -> None:
    params["lamp.to_world"] = params["lamp.to_world"] @ mi.ScalarTransform4f().translate([0.3, 0, 0.5])


def drop_faces(params: Any) -> None:
    """Shrink some to points."""
    params["ball.faces"] = np.where(np.arange(len(params["ball.faces"])) < 3 * 100, 0, params["ball.faces"])


def resize(params: Any, key: str, value: np.ndarray) -> None:
    """Assign an array of another length, at which Mitsuba's assignment fails in scalar variants when it compares."""
    current, kind, _, _ = params.properties[key]
    array = dr.scalar.ArrayXu if value.dtype == np.uint32 else dr.scalar.ArrayXf
    params.set_dirty(key)
    params.set_property(current, kind, array(value))


def half_the_faces(params: Any) -> None:
    resize(params, "ball.faces", np.array(params["ball.faces"], np.uint32)[: 3 * 100])
    resize(params, "box.faces", np.array(params["box.faces"], np.uint32)[: 3 * 7])


def another_mesh(params: Any) -> None:
    """More vertices and more faces."""
    mesh = sphere("finer", 14)
    resize(params, "ball.vertex_positions", (mesh.vertices * 0.3 + [0.9, 0, 0.6]).astype(np.float32).ravel())
    resize(params, "ball.faces", mesh.faces.astype(np.uint32).ravel())


def reverse_faces(params: Any) -> None:
    params["ball.faces"] = np.array(params["ball.faces"]).reshape(-1, 3)[::-1].ravel()


def several(params: Any) -> None:
    for edit in (move("ball", (-0.3, 0, 0.2)), move("box", (0.1, 0, 0)), move_rectangle, move_lamp):
        edit(params)


EDITS = {
    "mesh": move("ball", (-0.5, 0, 0.4)),
    "mesh out of the old box": move("ball", (2.5, 0, 0.4)),
    "textured lamp": move("glow", (-1, 0, -0.5)),
    "rectangle": move_rectangle,
    "rectangular lamp": move_lamp,
    "faces without area": drop_faces,
    "fewer faces": half_the_faces,
    "another mesh": another_mesh,
    "faces in another order": reverse_faces,
    "several": several,
}


@pytest.mark.parametrize("edit", EDITS)
@pytest.mark.parametrize("spec", SPECS)
def test_an_edited_scene_is_a_fresh_one(spec: str, edit: str) -> None:
    """The reference is a scene whose tree never saw the old geometry: edited under Embree first, and then grouped."""
    edited = load(scene(), spec)
    before = pixels(edited)
    params = mi.traverse(edited)
    EDITS[edit](params)
    params.update()
    parts = {name: part for name, part in scene().items() if name not in view()}
    shapes = {name: mi.load_dict(part) if isinstance(part, dict) else part for name, part in parts.items()}
    plain = mi.load_dict({**view(), **shapes}, optimize=False)
    params = mi.traverse(plain)
    EDITS[edit](params)
    params.update()
    fresh = load({**view(), **shapes}, spec)
    assert np.array_equal(pixels(edited), pixels(fresh))
    if edit != "faces in another order":
        assert not np.array_equal(before, pixels(edited))
        assert_same_up_to_rounding(pixels(edited), pixels(plain))


@pytest.mark.parametrize("spec", SPECS)
def test_only_geometry_makes_a_new_tree(spec: str, capfd: pytest.CaptureFixture[str]) -> None:
    edited = load(scene(), spec)
    params = mi.traverse(edited)
    mi.set_log_level(mi.LogLevel.Info)
    params["floor.bsdf.brdf_0.reflectance.value"] = 0.1
    params["lamp.emitter.radiance.value"] = [1, 2, 3]
    params.update()
    changed = pixels(edited)
    built = "nativekdtree: " if spec == "native" else "bsptree "
    assert built not in capfd.readouterr().out
    several(params)
    params.update()
    assert capfd.readouterr().out.count(built) == 1
    mi.set_log_level(mi.LogLevel.Warn)
    assert not np.array_equal(changed, pixels(edited))


@pytest.mark.parametrize("spec", SPECS)
def test_a_hand_written_group_can_be_edited(spec: str) -> None:
    scene = mi.load_dict({"type": "scene", "g": group(spec, {"ball": ball(), "cube": {"type": "cube"}})})
    params = mi.traverse(scene)
    move("ball", (0, 0, 50))(params)
    params.update()
    assert scene.ray_intersect(ray([0, 0.01, 60], [0, 0, -1])).t == pytest.approx(9, abs=0.1)
    assert scene.bbox().max.z == pytest.approx(51, abs=0.1)


@pytest.mark.parametrize("spec", SPECS)
def test_edits_inside_an_instanced_group(spec: str) -> None:
    scene = mi.load_dict({
        "type": "scene",
        "shapes": {"type": "shapegroup", "inner": group(spec, {"ball": ball(), "cube": {"type": "cube"}})},
        "placed": {"type": "instance", "to_world": place(2), "g": {"type": "ref", "id": "shapes"}},
        "far": {"type": "sphere", "center": [0, 0, -90]},
    })  # fmt: skip
    params = mi.traverse(scene)
    move("shapes.ball", (0, 0, 3))(params)
    params.update()
    assert scene.ray_intersect(ray([0, 0.01, 60], [0, 0, -1])).t == pytest.approx(52, abs=0.1)


@pytest.mark.parametrize("spec", SPECS)
def test_a_wrong_edit_is_an_error_and_leaves_nothing_dangling(spec: str) -> None:
    """The triangles are gone until the next edit is right; rendering goes on."""
    mesh = to_mesh(np.eye(3), np.array([(0, 1, 2)]))
    scene = mi.load_dict({"type": "scene", "g": group(spec, {"m": mesh, "cube": {"type": "cube"}})})
    params = mi.traverse(scene)
    params["m.faces"] = np.array([0, 1, 9])
    with pytest.raises(RuntimeError, match="triangle 0 refers to vertex 9, but the mesh has 3 vertices"):
        params.update()
    through = ray([0.3, 0.3, 9], [0, 0, -1])
    assert not scene.ray_intersect(through).is_valid()
    others = mi.traverse(scene)
    move("cube", (0, 0, 1))(others)
    others.update()
    assert not scene.ray_intersect(through).is_valid()
    params["m.faces"] = np.array([0, 2, 1])
    params.update()
    assert scene.ray_intersect(through).t == 7
