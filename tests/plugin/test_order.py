"""A grouped scene lists what the plain scene lists, in the same order, under the same names."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp

from .plugin_scenes import assert_same_up_to_rounding, ball, facing_down, load, pixels, place, view

#: Emitters, sensors and media on meshes, between objects of every other kind.
XML = """
<scene version="3.0.0">
    <integrator type="path"><integer name="block_size" value="16"/></integrator>
    {open}
    <shape type="rectangle" id="red">
        <transform name="to_world"><scale value="0.5"/><rotate x="1" angle="180"/><translate z="3"/></transform>
        <emitter type="area" id="red-lamp"><rgb name="radiance" value="9, 1, 1"/></emitter>
    </shape>
    <shape type="cube" id="meter-cube">
        <transform name="to_world"><scale value="0.5"/><translate z="0.5"/></transform>
        <sensor type="irradiancemeter" id="meter">
            <film type="hdrfilm"><integer name="width" value="1"/><integer name="height" value="1"/></film>
        </sensor>
    </shape>
    <shape type="cube" id="fog">
        <transform name="to_world"><scale value="0.3"/><translate x="2"/></transform>
        <medium type="homogeneous" name="interior" id="smoke"><rgb name="albedo" value="0.5"/></medium>
        <bsdf type="null"/>
    </shape>
    <shape type="rectangle" id="floor"><transform name="to_world"><scale value="4"/></transform></shape>
    <shape type="rectangle" id="green">
        <transform name="to_world"><scale value="0.5"/><rotate x="1" angle="180"/><translate x="1" z="3"/></transform>
        <emitter type="area" id="green-lamp"><rgb name="radiance" value="1, 9, 1"/></emitter>
    </shape>
    {close}
    <emitter type="point" id="point"><rgb name="intensity" value="5"/></emitter>
    <sensor type="perspective" id="camera">
        <transform name="to_world"><lookat origin="0, -6, 2" target="0, 0, 0" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
            <rfilter type="box"/></film>
    </sensor>
    <shape type="sphere" id="ball"><point name="center" value="0, 0, 9"/></shape>
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.1"/></emitter>
</scene>
"""
PLAIN = XML.format(open="", close="")
GROUPED = {
    "bsptree": XML.format(open='<shape type="bsptree" id="g"><string name="tree" value="normals"/>', close="</shape>"),
    "nativekdtree": XML.format(open='<shape type="nativekdtree" id="g">', close="</shape>"),
}
ORDER_OF_EMITTERS = ["red-lamp", "green-lamp", "point", "sky"]


def ids(objects: list[Any]) -> list[str]:
    return [thing.id() for thing in objects]


def names(scene: mi.Scene) -> list[str]:
    """Parameter names, without those of Mitsuba's own that contain an address."""
    return [name for name in mi.traverse(scene).properties if not name.startswith("object_")]


@pytest.mark.parametrize("spec", ["kd", "normals", "native"])
class TestSwappedScene:
    """Loaded by the harness."""

    @pytest.fixture
    def pair(self, tmp_path: Path, spec: str) -> tuple[mi.Scene, mi.Scene]:
        path = tmp_path / "scene.xml"
        path.write_text(PLAIN)
        return mi.load_file(str(path), optimize=False), mitsuba_bsp.load_file(path, spec)

    def test_lists(self, pair: tuple[mi.Scene, mi.Scene]) -> None:
        plain, swapped = pair
        assert ids(swapped.emitters()) == ids(plain.emitters()) == ORDER_OF_EMITTERS
        assert ids(swapped.sensors()) == ids(plain.sensors()) == ["meter", "camera"]
        assert ids(swapped.shapes()) == ids(plain.shapes()) == ["red", "meter-cube", "fog", "floor", "green", "ball"]
        for ours, theirs in zip(swapped.shapes(), plain.shapes(), strict=True):
            assert ours.bbox() == theirs.bbox()
            assert ours.is_medium_transition() == theirs.is_medium_transition()
            assert (ours.is_emitter(), ours.is_sensor()) == (theirs.is_emitter(), theirs.is_sensor())
            assert ours.effective_primitive_count() == theirs.effective_primitive_count()
        assert swapped.bbox() == plain.bbox()

    def test_parameter_names(self, pair: tuple[mi.Scene, mi.Scene]) -> None:
        plain, swapped = pair
        assert names(swapped) == names(plain)
        assert "floor.to_world" in names(swapped) and "meter-cube.vertex_positions" in names(swapped)

    def test_the_image_and_the_meter(self, pair: tuple[mi.Scene, mi.Scene]) -> None:
        plain, swapped = pair
        for sensor in range(2):
            images = [np.array(mi.render(s, sensor=sensor, seed=1, spp=16), np.float32) for s in (swapped, plain)]
            assert images[1].max() > 0.1
            assert_same_up_to_rounding(*images)

    def test_groups_in_the_file_make_no_difference(self, tmp_path: Path, spec: str) -> None:
        for xml in GROUPED.values():
            scene = mitsuba_bsp.load_string(xml, spec)
            assert ids(scene.emitters()) == ORDER_OF_EMITTERS
            assert ids(scene.shapes()) == ["red", "meter-cube", "fog", "floor", "green", "ball"]


@pytest.mark.parametrize("plugin", GROUPED)
class TestHandWrittenGroup:
    """Loaded by Mitsuba itself, which moves what a group expands into behind the other objects, as for `merge`."""

    def test_lists_and_names(self, plugin: str) -> None:
        plain, grouped = (mi.load_string(xml, optimize=False) for xml in (PLAIN, GROUPED[plugin]))
        assert ids(grouped.emitters()) == ["point", "sky", "red-lamp", "green-lamp"]
        assert ids(grouped.sensors()) == ["camera", "meter"]
        assert ids(grouped.shapes()) == ["ball", "red", "meter-cube", "fog", "floor", "green"]
        assert sorted(names(grouped)) == sorted(names(plain))

    def test_the_image_is_that_of_the_scene_in_that_order(self, plugin: str) -> None:
        lines = PLAIN.splitlines()
        first = next(i for i, line in enumerate(lines) if 'id="red"' in line)
        last = next(i for i, line in enumerate(lines) if 'id="point"' in line)
        moved = "\n".join(lines[:first] + lines[last:-1] + lines[first:last] + lines[-1:])
        plain = mi.load_string(moved, optimize=False)
        grouped = mi.load_string(GROUPED[plugin], optimize=False)
        assert ids(plain.emitters()) == ids(grouped.emitters())
        assert_same_up_to_rounding(pixels(grouped, spp=16), pixels(plain, spp=16))

    def test_it_works_with_mitsubas_own_optimizer(self, plugin: str) -> None:
        """Which merges meshes, but neither those in a group nor what a group expands into."""
        grouped = mi.load_string(GROUPED[plugin])
        assert set(ids(grouped.shapes())) >= {"red", "meter-cube", "fog", "floor", "green"}
        assert pixels(grouped)[..., :3].max() > 0.15


def test_arbitrary_output_variables() -> None:
    """`shape_index` is the place of the hit shape in the scene's list; all others are those of the mesh."""
    aovs = "shape:shape_index,prim:prim_index,t:depth,uv:uv,n:geo_normal,s:sh_normal,p:position,a:albedo"
    description = {
        **view(64),
        "integrator": {"type": "aov", "aovs": aovs, "block_size": 16},
        "floor": {"type": "rectangle", "to_world": place(4)},
        "sphere": {"type": "sphere", "center": [1.5, 0, 0.5], "radius": 0.5},
        "ball": ball(centre=(0, 0, 1)),
        "cube": {"type": "cube", "to_world": place(0.4, 20, (-1.5, 0, 0.4))},
        "lamp": {"type": "rectangle", "to_world": facing_down(0.5, (0, 2, 2)), "emitter": {"type": "area"}},
    }
    description["camera"]["sampler"]["sample_count"] = 1
    plain = pixels(mi.load_dict(description, optimize=False))
    for spec in ("kd", "normals", "native"):
        found = pixels(load(description, spec))
        same = np.isclose(found, plain, rtol=1e-4, atol=1e-4).all(axis=2)
        assert same.mean() > 0.998, spec
        assert set(np.unique(found[..., 0])) == {0, 1, 2, 3, 4}  # the lamp is seen from behind its face, but is seen
