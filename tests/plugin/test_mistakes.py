"""Every mistake is one clear sentence that names it and the valid choices."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp import _core, parse_spec

from .plugin_scenes import ball, place, to_mesh

CUBE = {"type": "cube"}
TREES = ", ".join(_core.trees())
BSPTREE = "tree, count, record, replay, cache, expand"
NATIVE = "count, check, expand, kd_intersection_cost, kd_traversal_cost"


def error_of(description: dict[str, Any]) -> str:
    with pytest.raises(RuntimeError) as caught:
        mi.load_dict(description)
    message = str(caught.value)
    assert "\n" not in message, message
    return message


def properties(plugin: str, **settings: Any) -> dict[str, Any]:
    """A group with these properties; functions stand for what they make once there is a variant."""
    return {"type": plugin, **{key: v() if callable(v) else v for key, v in settings.items()}, "a": CUBE}


def ellipsoids() -> dict[str, Any]:
    parts = {"centers": [0.0, 0, 0], "scales": [1.0, 1, 1], "quaternions": [0.0, 0, 0, 1]}
    return {"type": "ellipsoidsmesh", **{key: mi.TensorXf(v, (1, len(v))) for key, v in parts.items()}}


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"colour": 3}, f'a bsptree with tree=auto has no property "colour": its properties are {BSPTREE}, '),
        ({"k": 6}, f'a bsptree with tree=auto has no property "k": its properties are {BSPTREE}, '),
        ({"tree": "kd", "k": 6}, f'a bsptree with tree=kd has no property "k": its properties are {BSPTREE}, '),
        ({"to_world": place}, 'has no property "to_world": its properties are'),
        ({"cache": 3}, 'the property "cache" of a bsptree is a text: the path of a folder'),
        ({"tree": "oak"}, f"there is no tree 'oak': the trees are {TREES}"),
        ({"tree": 3}, f"there is no tree '3': the trees are {TREES}"),
        ({"tree": "random", "k": 0}, "k=0 is not valid: k is an integer from 1 to 32"),
        ({"tree": "random", "k": 1000}, "k=1000 is not valid: k is an integer from 1 to 32"),
        ({"tree": "random", "k": 6.5}, "k=6.5 is not valid: k is an integer from 1 to 32"),
        ({"tree": "random", "k": True}, "k=true is not valid: k is an integer from 1 to 32"),
        ({"tree": "random", "k": "six"}, "k=six is not valid: k is an integer from 1 to 32"),
        ({"tree": "random", "k": place}, 'the property "k" of a bsptree is a text, a number or a boolean'),
        ({"tree": "normals", "axes": "slow"}, "axes=slow is not valid: axes is one of none, plain, fast"),
        ({"triangle_test": "box"}, "triangle_test=box is not valid: triangle_test is one of woop, mt"),
        ({"tree": "kd", "intersection_cost": -1.0}, "intersection_cost=-1 is not valid: "),
        ({"tree": "kd", "empty_bonus": "nan"}, "empty_bonus=nan is not valid: empty_bonus is a number from 0 to 1"),
        ({"count": "yes"}, 'the property "count" of a bsptree is a boolean: true or false'),
        ({"expand": 1}, 'the property "expand" of a bsptree is a boolean: true or false'),
    ],
)  # fmt: skip
def test_settings_of_a_bsptree(settings: dict[str, Any], sentence: str) -> None:
    assert sentence in error_of(properties("bsptree", **settings))


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"colour": 3}, f'a nativekdtree has no property "colour": its properties are {NATIVE}'),
        ({"tree": "kd"}, 'a nativekdtree has no property "tree": its properties are'),
        ({"kd_stop_prims": 0}, "kd_stop_prims=0 is not valid: kd_stop_prims is an integer from 1 to 2^30"),
        ({"kd_stop_prims": -1}, "kd_stop_prims=-1 is not valid: kd_stop_prims is an integer from 1 to 2^30"),
        ({"kd_stop_prims": 2.5}, "kd_stop_prims=2.5 is not valid: kd_stop_prims is an integer from 1 to 2^30"),
        ({"kd_stop_prims": "few"}, "kd_stop_prims is an integer from 1 to 2^30"),
        ({"kd_max_depth": 49}, "kd_max_depth=49 is not valid: kd_max_depth is an integer from 0 to 48"),
        ({"kd_clip": 1}, "kd_clip=1 is not valid: kd_clip is true or false"),
        ({"kd_empty_space_bonus": 0}, "kd_empty_space_bonus is a number from 1e-6 to 1"),
        ({"kd_intersection_cost": 0.0}, "kd_intersection_cost is a number from 1e-6 to 2^30"),
        ({"kd_traversal_cost": float("nan")}, "kd_traversal_cost is a number from 1e-6 to 2^30"),
        (
            {"kd_exact_primitive_threshold": 3},
            "kd_exact_primitive_threshold is 3, but must be above kd_stop_prims, which is 3",
        ),
    ],
)
def test_settings_of_a_nativekdtree(settings: dict[str, Any], sentence: str) -> None:
    assert sentence in error_of(properties("nativekdtree", **settings))


@pytest.mark.parametrize(
    ("name", "value", "is_valid"),
    [
        ("kd_empty_space_bonus", 1.0, True),
        ("kd_empty_space_bonus", 0.0, False),
        ("kd_intersection_cost", 1e7, True),
        ("kd_traversal_cost", 2e9, False),
        ("kd_min_max_bins", 2**20 + 1, False),
    ],
)
def test_the_spec_allows_native_what_its_plugin_allows(name: str, value: float, is_valid: bool) -> None:
    if is_valid:
        parse_spec(f"native:{name}={value}")
        mi.load_dict(properties("nativekdtree", **{name: value}))
        return
    assert f"{name} is " in error_of(properties("nativekdtree", **{name: value}))
    with pytest.raises(ValueError, match=f'"{name}" cannot be'):
        parse_spec(f"native:{name}={value}")


@pytest.mark.parametrize("plugin", ["bsptree", "nativekdtree"])
class TestChildren:
    @pytest.mark.parametrize(
        "shape", [{"type": "shapegroup", "inner": CUBE}, ellipsoids], ids=["shapegroup", "ellipsoidsmesh"]
    )
    def test_other_shapes(self, plugin: str, shape: dict[str, Any]) -> None:
        sentence = (
            f'child "odd" of a {plugin} is neither a triangle mesh nor bounded primitives: ply, obj, serialized, '
        )
        assert sentence in error_of({"type": plugin, "a": CUBE, "odd": shape() if callable(shape) else shape})

    def test_a_sphere_that_reaches_too_far(self, plugin: str) -> None:
        sphere = {"type": "sphere", "radius": 1e19}
        assert 'child "odd" extends from [' in error_of({"type": plugin, "a": CUBE, "odd": sphere})

    def test_objects_that_are_no_shapes(self, plugin: str) -> None:
        sentence = f'a {plugin} takes shapes as children, but "bsdf" is none'
        assert sentence in error_of({"type": plugin, "a": CUBE, "bsdf": {"type": "diffuse"}})

    @pytest.mark.parametrize("inner", ["bsptree", "nativekdtree"])
    def test_groups_in_groups(self, plugin: str, inner: str) -> None:
        sentence = f"a {plugin} cannot hold another accelerated group"
        for content in ({}, {"a": CUBE}, {"a": CUBE, "b": {"type": "rectangle"}}):
            assert sentence in error_of({"type": plugin, "inner": {"type": inner, **content}})

    def test_an_index_out_of_range(self, plugin: str) -> None:
        wrong = to_mesh(np.eye(3), np.array([(0, 1, 2), (0, 1, 7)]), name="wrong")
        sentence = 'child "w": triangle 1 refers to vertex 7, but the mesh has 3 vertices'
        assert sentence in error_of({"type": plugin, "a": CUBE, "w": wrong})

    def test_a_group_that_nothing_shows(self, plugin: str) -> None:
        """`expand=false` is for bspmember; the children of such a group would be lost in silence."""
        sentence = "a group with expand=false is seen only through its members, the bspmember shapes"
        assert sentence in error_of({"type": "scene", "group": {"type": plugin, "expand": False, "a": CUBE}})


@pytest.mark.parametrize("index", [-1, 2])
def test_members_that_do_not_exist(index: int) -> None:
    group = {"type": "bsptree", "expand": False, "a": CUBE, "b": ball()}
    found = error_of({"type": "scene", "m": {"type": "bspmember", "group": group, "index": index}})
    assert f"a bspmember has index {index}, but its group has 2 children" in found


@pytest.mark.parametrize("content", [{}, {"group": CUBE}, {"group": {"type": "bsptree", "a": CUBE}}])
def test_members_of_something_else(content: dict[str, Any]) -> None:
    found = error_of({"type": "scene", "m": {"type": "bspmember", "index": 0, **content}})
    assert 'the property "group" of a bspmember is a bsptree or nativekdtree with expand=false' in found


def test_a_member_without_index() -> None:
    group = {"type": "bsptree", "expand": False, "a": CUBE}
    for wrong in ({}, {"index": "one"}):
        found = error_of({"type": "scene", "m": {"type": "bspmember", "group": group, **wrong}})
        assert 'the property "index" of a bspmember is the number of one of its group\'s children' in found
