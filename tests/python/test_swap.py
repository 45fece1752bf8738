"""A swapped scene is the scene it was, but for what answers its rays."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from conftest import ROOM, scene_xml

import mitsuba_bsp
from mitsuba_bsp import parse_spec
from mitsuba_bsp.loading import LoadedScene, open_file
from mitsuba_bsp.scene_content import Content
from mitsuba_bsp.spec import make_spec
from mitsuba_bsp.swap import GroupOptions

CUBE = '<shape type="cube"/>'
RED = '<bsdf type="diffuse" id="red"/>'
RED_CUBES = [f'<shape type="cube" id="{name}"><ref id="red"/></shape>' for name in "abc"]
LAMP = '<shape type="cube"><emitter type="area"/></shape>'


def merge(*shapes: str) -> str:
    return f'<shape type="merge" id="m">{"".join(shapes)}</shape>'


#: Scenes with hand-written merges: what they merge, and what they pass on.
MERGES = {
    "alike": [RED, merge(*RED_CUBES)],
    "unlike": [merge(CUBE, CUBE)],
    "one": [merge(CUBE), CUBE],
    "lamps": [merge(LAMP, LAMP)],
    "others": [RED, merge(RED_CUBES[0], '<shape type="sphere" id="s"/>', RED_CUBES[1], '<bsdf type="diffuse"/>')],
    "nested": [RED, merge('<shape type="merge">', *RED_CUBES[:2], "</shape>", RED_CUBES[2])],
}


def write(tmp_path: Path, *shapes: str) -> Path:
    path = tmp_path / "scene.xml"
    path.write_text(scene_xml(*shapes))
    return path


def summary(shape: mi.Shape) -> tuple[str, str, int, bool]:
    """Class, id (unless Mitsuba made it up), triangles and light of a shape."""
    name = "" if shape.id().startswith("_unnamed_") else shape.id()
    return shape.class_name(), name, shape.effective_primitive_count(), shape.is_emitter()


def plugins(loaded: LoadedScene, spec: str) -> list[str]:
    """What stands in the root of the swapped scene, in order: class names of objects, plugin names of nodes."""
    state = loaded.regrouped(parse_spec(spec))
    root = state.nodes[0].props
    found = []
    for key in root:
        if root.type(key) == mi.Properties.Type.ResolvedReference:
            found.append(state.nodes[root[key].index()].props.plugin_name())
        elif root.type(key) == mi.Properties.Type.Object:
            found.append(root[key].class_name())
    return found


class TestDescription:
    """The rewritten description, before any accelerator is built."""

    def test_every_shape_gives_way_to_a_member_in_its_place(self, room: Path) -> None:
        assert plugins(open_file(room), "kd") == [
            "PathIntegrator", "PerspectiveCamera", "SmoothDiffuse", "bspmember", "bspmember", "PointLight", "bspmember",
            "bspmember", "bspmember", "bspmember", "ConstantBackgroundEmitter",
        ]  # fmt: skip

    def test_members_are_numbered_and_named_like_their_shapes(self, room: Path) -> None:
        loaded = open_file(room)
        state = loaded.regrouped(parse_spec("kd"))
        members = [node.props for node in state.nodes if node.props.plugin_name() == "bspmember"]
        assert [member["index"] for member in members] == list(range(6))
        shapes = loaded.containers[0].grouped(parse_spec("kd"))
        assert [member.id() for member in members] == [shape.id() for shape in shapes]
        assert {member["group"].index() for member in members} == {len(state.nodes) - 7}

    def test_the_group_holds_the_shapes_in_order_and_the_settings(self, room: Path) -> None:
        loaded, spec = open_file(room), parse_spec("normals:k=4")
        state = loaded.regrouped(spec, GroupOptions(count=True, cache=Path("trees")))
        group = next(node.props for node in state.nodes if node.props.plugin_name() == "bsptree")
        children = [group[key] for key in group if group.type(key) == mi.Properties.Type.Object]
        assert [child.ptr for child in children] == [shape.ptr for shape in loaded.containers[0].grouped(spec)]
        given = {key: group[key] for key in group if group.type(key) != mi.Properties.Type.Object}
        plugin_keys = {"tree": "normals", "expand": False, "count": True, "cache": "trees"}
        plugin_keys |= {"record": "", "replay": ""}
        assert plugin_keys.items() <= given.items()
        settings = {key: value for key, value in given.items() if key not in plugin_keys}
        assert make_spec("normals", settings, "").settings == spec.settings

    def test_native_gets_its_own_plugin(self, room: Path) -> None:
        state = open_file(room).regrouped(parse_spec("native:kd_clip=false"), GroupOptions(count=True))
        group = next(node.props for node in state.nodes if node.props.plugin_name() == "nativekdtree")
        assert group["kd_clip"] is False
        assert "count" not in group and "tree" not in group

    def test_embree_keeps_the_meshes_and_its_mode(self, room: Path) -> None:
        loaded = open_file(room)
        assert "bspmember" not in plugins(loaded, "embree")
        for text, robust in (("embree", False), ("embree:robust=true", True)):
            root = loaded.regrouped(parse_spec(text)).nodes[0].props
            assert root["embree_use_robust_intersections"] is robust

    def test_one_loaded_scene_serves_several_specs(self, room: Path) -> None:
        loaded = open_file(room)
        assert plugins(loaded, "kd") == plugins(loaded, "native") == plugins(loaded, "kd")

    @pytest.mark.parametrize("group", ["bsptree", "nativekdtree"])
    def test_groups_in_the_file_give_way_to_their_children(self, tmp_path: Path, group: str) -> None:
        inner = f'<shape type="{group}">{CUBE}<shape type="rectangle"/></shape>'
        path = write(tmp_path, '<shape type="sphere"/>', inner, '<emitter type="constant"/>')
        assert plugins(open_file(path), "embree")[2:] == ["Sphere", "Cube", "Rectangle", "ConstantBackgroundEmitter"]

    @pytest.mark.parametrize("kind", MERGES)
    def test_merge_makes_what_mitsuba_makes(self, tmp_path: Path, kind: str) -> None:
        path = write(tmp_path, *MERGES[kind])
        plain = mi.load_file(str(path), optimize=False)
        swapped = mitsuba_bsp.load_file(path, "embree", optimize=False)
        assert sorted(map(summary, swapped.shapes())) == sorted(map(summary, plain.shapes()))

    def test_a_merge_inside_a_group_is_one_mesh(self, tmp_path: Path) -> None:
        path = write(tmp_path, RED, f'<shape type="bsptree">{merge(*RED_CUBES)}{CUBE}</shape>')
        assert plugins(open_file(path), "kd")[3:] == ["bspmember"] * 2

    def test_a_group_inside_a_merge_gives_way(self, tmp_path: Path) -> None:
        path = write(tmp_path, RED, merge(f'<shape type="bsptree">{"".join(RED_CUBES)}</shape>'))
        assert [mesh.id() for mesh in open_file(path).meshes] == ["m"]

    def test_a_shape_named_twice_is_listed_twice(self, tmp_path: Path) -> None:
        loaded = open_file(write(tmp_path, '<shape type="cube" id="a"/>', '<ref id="a"/>'))
        assert [mesh.id() for mesh in loaded.meshes] == ["a"]
        assert plugins(loaded, "kd")[2:] == ["bspmember"] * 2

    def test_a_shape_group_gets_its_own_accelerator(self, tmp_path: Path) -> None:
        sphere = '<shape type="sphere"/>'
        group = f'<shape type="shapegroup" id="g">{CUBE}{sphere}</shape>'
        instance = '<shape type="instance"><ref id="g"/></shape>'
        loaded = open_file(write(tmp_path, group, instance, instance, CUBE, sphere))
        assert loaded.content == Content(24, 2, {}, shape_groups=1, instances=2, grouped=12, bounded={"Sphere": 2})
        assert plugins(loaded, "kd")[2:] == ["shapegroup", "instance", "instance", "bspmember", "bspmember"]
        state = loaded.regrouped(parse_spec("kd"), GroupOptions(record=tmp_path / "rays"))
        (inner,) = [node.props for node in state.nodes if node.props.plugin_name() == "shapegroup"]
        first, second = (inner[key] for key in inner if inner.type(key) != mi.Properties.Type.String)
        assert {state.nodes[one.index()].props.plugin_name() for one in (first, second)} == {"bspmember"}
        trees = [node.props for node in state.nodes if node.props.plugin_name() == "bsptree"]
        assert [(tree["record"] != "", tree["count"]) for tree in trees] == [(True, False), (False, False)]

    def test_brute_refuses_a_large_scene(self, tmp_path: Path) -> None:
        sides = np.linspace(0, 1, 103, dtype=np.float32)
        mesh = mi.Mesh("grid", len(sides) ** 2, 2 * (len(sides) - 1) ** 2)
        corner = np.arange(len(sides) ** 2).reshape(len(sides), -1)
        quads = (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
        a, b, c, d = (quad.ravel() for quad in quads)
        params = mi.traverse(mesh)
        params["faces"] = np.stack([a, b, c, a, c, d], axis=1).ravel().astype(np.uint32)
        x, y = np.meshgrid(sides, sides)
        params["vertex_positions"] = np.stack([x, y, 0 * x], axis=2).ravel()
        params.update()
        mesh.write_ply(str(tmp_path / "grid.ply"))
        path = write(tmp_path, '<shape type="ply"><string name="filename" value="grid.ply"/></shape>')
        with pytest.raises(ValueError, match=r"at most 20,000 triangles, but this scene has 20,808"):
            mitsuba_bsp.load_file(path, "brute")


class TestMistakes:
    """Scenes that are refused, each with one sentence."""

    @pytest.mark.parametrize(
        ("shape", "sentence"),
        [
            ('<shape type="bsptree"><shape type="bsptree"/></shape>', "a bsptree cannot be inside a bsptree"),
            ('<shape type="bsptree"><shape type="nativekdtree"/></shape>', "a nativekdtree cannot be inside a bsptree"),
            (
                '<shape type="bsptree"><shape type="merge"><shape type="bsptree"/></shape></shape>',
                "a bsptree cannot be inside a bsptree",
            ),
            ('<shape type="bsptree"><bsdf type="diffuse"/></shape>', 'not the BSDF "diffuse"'),
            ('<shape type="bsptree"><integer name="k" value="0"/></shape>', "k"),
            ('<shape type="bsptree"><string name="tree" value="oak"/></shape>', "oak"),
            ('<shape type="bsptree"><string name="colour" value="red"/></shape>', "colour"),
            (
                '<shape type="bsptree"><string name="expand" value="maybe"/></shape>',
                '"expand" is neither true nor false',
            ),
            ('<shape type="nativekdtree"><integer name="kd_stop_prims" value="0"/></shape>', "from 1 to 2^30"),
            ('<shape type="merge"><integer name="k" value="6"/></shape>', "merge takes no properties, but has k"),
            ('<shape type="bspmember"/>', "bspmember is written by mitsuba_bsp itself"),
        ],
    )
    def test_a_wrong_group_in_the_file(self, tmp_path: Path, shape: str, sentence: str) -> None:
        path = write(tmp_path, shape)
        with pytest.raises(ValueError) as caught:
            mitsuba_bsp.load_file(path, "embree")
        message = str(caught.value)
        assert sentence in message
        assert f"{path} (line 1, col " in message
        assert "\n" not in message

    def test_native_may_be_checked_in_the_file(self, tmp_path: Path) -> None:
        checked = f'<shape type="nativekdtree"><boolean name="check" value="true"/>{CUBE}</shape>'
        assert "Cube" in plugins(open_file(write(tmp_path, checked)), "embree")

    def test_settings_in_the_file_may_be_right(self, tmp_path: Path) -> None:
        settings = (
            '<string name="tree" value="normals"/><integer name="k" value="6"/><string name="axes" value="fast"/>'
            '<boolean name="count" value="true"/>'
        )
        path = write(tmp_path, f'<shape type="bsptree">{settings}{CUBE}</shape>')
        assert plugins(open_file(path), "embree")[2:] == ["Cube"]

    def test_a_property_that_nothing_reads_is_still_an_error(self, tmp_path: Path) -> None:
        path = write(tmp_path, '<boolean name="embree_is_fun" value="true"/>')
        with pytest.raises(RuntimeError, match="embree_is_fun"):
            mitsuba_bsp.load_file(path, "embree")
        path = write(tmp_path, '<shape type="cube"><float name="size" value="2"/></shape>')
        with pytest.raises(RuntimeError, match="size"):
            mitsuba_bsp.load_file(path, "embree")

    def test_only_scenes_can_be_swapped(self) -> None:
        with pytest.raises(ValueError, match='this describes a "cube", not a scene'):
            mitsuba_bsp.load_dict({"type": "cube"}, "embree")

    def test_a_missing_file(self, tmp_path: Path) -> None:
        with pytest.raises(FileNotFoundError, match=r"there is no scene file .*nothing\.xml"):
            mitsuba_bsp.load_file(tmp_path / "nothing.xml", "embree")

    def test_a_wrong_spec_comes_before_anything_else(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="oak"):
            mitsuba_bsp.load_file(tmp_path / "nothing.xml", "oak")

    def test_a_variant_that_does_not_work(self, room: Path) -> None:
        mi.set_variant("scalar_rgb", "llvm_ad_rgb")
        wrong = next(name for name in mi.variants() if not name.startswith("scalar"))
        mi.set_variant(wrong)
        with pytest.raises(RuntimeError, match=f'"{wrong}".*scalar_rgb, scalar_spectral, scalar_spectral_polarized'):
            mitsuba_bsp.load_file(room, "embree")

    def test_the_search_path_is_left_alone(self, room: Path) -> None:
        before = [str(folder) for folder in mi.file_resolver()]
        mitsuba_bsp.load_file(room, "embree")
        with pytest.raises(RuntimeError):
            mitsuba_bsp.load_string(scene_xml('<shape type="ply"/>'), "embree")
        assert [str(folder) for folder in mi.file_resolver()] == before


@pytest.mark.parametrize("spec", ["embree", "native", "kd", "normals"])
class TestScene:
    """The scene itself, against the one that Mitsuba loads."""

    def test_shapes_emitters_and_sensors_keep_their_order(self, room: Path, spec: str) -> None:
        plain, swapped = mi.load_file(str(room), optimize=False), mitsuba_bsp.load_file(room, spec)
        assert [shape.id() for shape in swapped.shapes()] == [shape.id() for shape in plain.shapes()]
        assert [shape.is_emitter() for shape in swapped.shapes()] == [shape.is_emitter() for shape in plain.shapes()]
        kinds = [type(emitter).__name__ + emitter.id() for emitter in plain.emitters()]
        assert [type(emitter).__name__ + emitter.id() for emitter in swapped.emitters()] == kinds
        assert [sensor.id() for sensor in swapped.sensors()] == ["camera"]

    def test_parameters_keep_their_names(self, room: Path, spec: str) -> None:
        plain, swapped = mi.load_file(str(room), optimize=False), mitsuba_bsp.load_file(room, spec)
        names = {name for name in mi.traverse(plain).properties if not name.startswith("object_")}
        assert {name for name in mi.traverse(swapped).properties if not name.startswith("object_")} == names

    def test_the_image_stays(self, room: Path, spec: str) -> None:
        plain = np.array(mi.render(mi.load_file(str(room), optimize=False), seed=1, spp=16))
        swapped = np.array(mi.render(mitsuba_bsp.load_file(room, spec), seed=1, spp=16))
        assert np.mean(np.abs(swapped - plain) > 1e-3 * plain.mean()) < 0.01
        assert abs(swapped.mean() / plain.mean() - 1) < 1e-3

    def test_parameters_and_strings(self, spec: str) -> None:
        scene = mitsuba_bsp.load_string(ROOM, spec, parallel=False, optimize=False, res=20, spp=2)
        assert mi.render(scene).shape == (20, 20, 3)

    def test_dictionaries_with_objects_made_before(self, spec: str) -> None:
        description = {"type": "scene", "first": mi.load_dict({"type": "cube"}), "second": {"type": "rectangle"}}
        scene = mitsuba_bsp.load_dict(description, spec)
        assert [shape.id() for shape in scene.shapes()] == ["first", "second"]
        names = set(mi.traverse(mi.load_dict(description, optimize=False)).properties)
        assert "first.vertex_positions" in names
        assert set(mi.traverse(scene).properties) == names

    def test_a_scene_without_meshes(self, spec: str) -> None:
        scene = mitsuba_bsp.load_dict({"type": "scene", "ball": {"type": "sphere"}}, spec)
        assert [shape.id() for shape in scene.shapes()] == ["ball"]
        assert scene.ray_test(mi.Ray3f([0, 0, 5], [0, 0, -1]))

    def test_shapes_that_stay_outside_are_named(
        self, tmp_path: Path, spec: str, capfd: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "curve.txt").write_text("0 0 0 0.1\n1 0 0 0.1\n2 0 1 0.1\n3 0 0 0.1\n")
        curve = '<shape type="bsplinecurve"><string name="filename" value="curve.txt"/></shape>'
        mitsuba_bsp.load_file(write(tmp_path, CUBE, '<shape type="sphere"/>', curve), spec)
        said = "".join(capfd.readouterr())
        assert ("these shapes stay with Embree: 1 BSplineCurve" in said) == (spec != "embree")
        assert "Sphere" not in said


@pytest.mark.parametrize(
    ("spec", "inside"), [("kd", 5), ("normals", 5), ("auto", 5), ("brute", 5), ("native", 2), ("ize", 0)]
)
def test_bounded_primitives_go_under_the_trees_that_take_them(spec: str, inside: int) -> None:
    ellipsoids = {
        "centers": np.zeros((3, 3)),
        "scales": np.ones((3, 3)),
        "quaternions": np.tile([0, 0, 0, 1], (3, 1)),
    }
    scene = mitsuba_bsp.load_dict(
        {
            "type": "scene",
            "cube": {"type": "cube"},
            "ball": {"type": "sphere", "center": [5, 0, 0]},
            "disk": {"type": "disk"},
            "many": {
                "type": "ellipsoids",
                **{key: mi.TensorXf(v.astype(np.float32)) for key, v in ellipsoids.items()},
            },
        },
        spec,
    )
    found = mitsuba_bsp.statistics(scene)
    assert found["primitives"] == inside and found["triangles"] == 12


def test_old_scenes_are_upgraded(tmp_path: Path) -> None:
    path = tmp_path / "old.xml"
    inner = '<sensor type="perspective"><transform name="toWorld"><translate z="7"/></transform></sensor>'
    path.write_text(f'<scene version="0.6.0"><integrator type="path"/>{inner}</scene>')
    scene = mitsuba_bsp.load_file(path, "embree")
    assert scene.sensors()[0].world_transform().translation().z == 7


def test_included_files_and_relative_paths(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    mi.load_dict({"type": "cube"}).write_ply(str(tmp_path / "parts" / "mesh.ply"))
    (tmp_path / "part.xml").write_text(
        '<scene version="3.0.0"><default name="file" value="mesh.ply"/>'
        '<shape type="ply" id="included"><string name="filename" value="$file"/></shape></scene>'
    )
    path = write(tmp_path, '<path value="parts"/>', '<include filename="part.xml"/>')
    assert [mesh.id() for mesh in open_file(path).meshes] == ["included"]


def test_statistics_of_a_tree_and_of_embree(room: Path) -> None:
    assert mitsuba_bsp.statistics(mitsuba_bsp.load_file(room, "embree")) == {}
    found = mitsuba_bsp.statistics(mitsuba_bsp.load_file(room, "kd"))
    assert found["triangles"] == 30
    assert found["nodes"] > 0 and found["bytes"] > 0 and found["build_s"] >= 0
