"""Move a scene's triangle meshes under one accelerator, changing nothing else in the scene.

Two steps. `dissolve` works on the parsed scene: groups that the file already names give way to their children.
`regroup` works on the scene's objects: every mesh moves into one group node, and a `bspmember` that stands for it
takes its place, so that the order of shapes, emitters and sensors and every parameter name stay as they were.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi

from .messages import choices
from .spec import BRUTE_MAX_TRIANGLES, Spec, Value, make_spec, value_text

GROUPS = ("bsptree", "nativekdtree")
MEMBER = "bspmember"

#: Meshes whose intersection is more than that of their triangles (this one culls back faces).
_NOT_PLAIN = ("EllipsoidsMesh",)

#: Keys of the group plugins that are no setting of a tree: flags, and paths of files.
_PLUGIN_FLAGS = {"expand": ("true", "false"), "count": ("true", "false")}
_PLUGIN_PATHS = ("cache", "record", "replay")


@dataclass(frozen=True)
class GroupOptions:
    """What our trees are asked for besides answers: to `count` the work for rays, to keep themselves in the folder
    `cache`, to write every ray and answer to the file `record` (and count), or to give the answers in the file `replay`
    instead of their own."""

    count: bool = False
    cache: str | Path | None = None
    record: str | Path | None = None
    replay: str | Path | None = None


def is_groupable(thing: mi.Object) -> bool:
    """Whether a scene object is a plain triangle mesh, which our accelerators take."""
    return isinstance(thing, mi.Mesh) and thing.class_name() not in _NOT_PLAIN


def other_shapes(objects: Sequence[mi.Object]) -> Counter[str]:
    """Class names and counts of the shapes that stay outside the group."""
    return Counter(o.class_name() for o in objects if isinstance(o, mi.Shape) and not is_groupable(o))


def dissolve(state: mi.parser.ParserState) -> None:
    """Replace top-level `bsptree`, `nativekdtree` and `merge` nodes by their children, in order.

    `merge` goes too because the order of merged meshes, hence of their emitters, depends on memory addresses.
    The references of `state` must be resolved. ValueError if a group holds another one, or something that is
    no shape, or has wrong settings.
    """
    root = state.nodes[0].props
    children = [pair for key in _object_keys(root) for pair in _flatten(state, key, root[key])]
    props = _without_objects(root)
    for key, child in children:
        props[key] = child
    state.nodes[0].props = props


def regroup(
    state: mi.parser.ParserState, children: Sequence[tuple[str, mi.Object]], spec: Spec, options: GroupOptions
) -> None:
    """Rewrite the root of `state` so that it holds `children` under the accelerator `spec`.

    `children` are the scene's objects with their property names, in order. ValueError if `spec` is `brute` and the
    scene is too large for it.
    """
    root = _without_objects(state.nodes[0].props)
    if spec.name == "embree":
        root["embree_use_robust_intersections"] = spec.settings["robust"]
    meshes = [child for _, child in children if spec.plugin and is_groupable(child)]
    _check_size(spec, meshes)
    group_index = len(state.nodes)
    members = iter(range(group_index + 1, group_index + 1 + len(meshes)))
    for key, child in children:
        grouped = spec.plugin and is_groupable(child)
        root[key] = mi.Properties.ResolvedReference(next(members)) if grouped else child
    state.nodes[0].props = root
    if meshes:
        _append_shape(state, _group(spec, options, meshes))
    for index, mesh in enumerate(meshes):
        _append_shape(state, _member(mesh.id(), group_index, index))


def _group(spec: Spec, options: GroupOptions, meshes: Sequence[mi.Mesh]) -> mi.Properties:
    """The node that holds the meshes and knows the settings of the accelerator."""
    props = mi.Properties(spec.plugin)
    for index, mesh in enumerate(meshes):
        props[f"child_{index}"] = mesh
    settings: dict[str, Value] = {"expand": False}
    if spec.is_tree:
        # As text, so that the plugin reads exactly what the spec says.
        settings |= {key: value_text(value) for key, value in spec.settings.items()}
        settings |= {"tree": spec.name, "count": options.count}
        settings |= {key: os.fspath(getattr(options, key) or "") for key in _PLUGIN_PATHS}
    else:
        settings |= spec.settings
    for key, value in settings.items():
        props[key] = value
    return props


def _member(name: str, group: int, index: int) -> mi.Properties:
    """The node that stands for one mesh of the node number `group`."""
    props = mi.Properties(MEMBER)
    props.set_id(name)
    props["group"] = mi.Properties.ResolvedReference(group)
    props["index"] = index
    return props


def _check_size(spec: Spec, meshes: Sequence[mi.Mesh]) -> None:
    triangles = sum(mesh.face_count() for mesh in meshes)
    if spec.name == "brute" and triangles > BRUTE_MAX_TRIANGLES:
        raise ValueError(
            f"brute tests every triangle for every ray and takes at most {BRUTE_MAX_TRIANGLES:,} triangles, "
            f"but this scene has {triangles:,}"
        )


def _object_keys(props: mi.Properties) -> list[str]:
    """Names of the properties that hold an object or a reference to one."""
    kinds = (mi.Properties.Type.ResolvedReference, mi.Properties.Type.Object)
    return [key for key in props if props.type(key) in kinds]


def _without_objects(props: mi.Properties) -> mi.Properties:
    """A copy of `props` with its plain values only."""
    copy = mi.Properties(props)
    for key in _object_keys(props):
        del copy[key]
    return copy


def _flatten(
    state: mi.parser.ParserState,
    key: str,
    child: mi.Object | mi.Properties.ResolvedReference,
    group: str | None = None,
) -> list[tuple[str, mi.Object | mi.Properties.ResolvedReference]]:
    """`child` itself, or what a group holds; `group` is the plugin that encloses it, if any."""
    if not isinstance(child, mi.Properties.ResolvedReference):
        return [(key, child)]
    node = state.nodes[child.index()]
    plugin, place = node.props.plugin_name(), mi.parser.file_location(state, node)
    if plugin == MEMBER:
        raise ValueError(f"{place}: {MEMBER} is written by mitsuba_bsp itself and cannot be part of a scene it loads")
    if group and node.type != mi.ObjectType.Shape:
        raise ValueError(f'{place}: a {group} takes only shapes as children, not the {node.type.name} "{plugin}"')
    if plugin in GROUPS and group in GROUPS:
        raise ValueError(f"{place}: a {plugin} cannot be inside a {group}")
    if plugin not in (*GROUPS, "merge"):
        return [(key, child)]
    _check_settings(plugin, node.props, place)
    inside = plugin if plugin in GROUPS else group or plugin
    pairs = [(f"{key}/{name}", node.props[name]) for name in _object_keys(node.props)]
    if not pairs:
        mi.Log(mi.LogLevel.Warn, f"{place}: this {plugin} is empty and adds nothing to the scene")
    return [pair for name, inner in pairs for pair in _flatten(state, name, inner, inside)]


def _check_settings(plugin: str, props: mi.Properties, place: str) -> None:
    """ValueError unless the settings that the file gives to a group are valid."""
    objects = set(_object_keys(props))
    given = {key: _text(props, key) for key in props if key not in objects}
    try:
        if plugin == "merge":
            if given:
                raise ValueError(f"merge takes no properties, but has {choices(given)}")
            return
        for key, valid in _PLUGIN_FLAGS.items():
            if given.pop(key, valid[0]) not in valid:
                raise ValueError(f'"{key}" is neither {" nor ".join(valid)}')
        _check_tree_settings(plugin, given)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None


def _check_tree_settings(plugin: str, given: Mapping[str, str]) -> None:
    options = dict(given)
    name = "native"
    if plugin == "bsptree":
        name = options.pop("tree", "kd")
        for path in _PLUGIN_PATHS:
            options.pop(path, None)
    make_spec(name, options, plugin)


def _text(props: mi.Properties, key: str) -> str:
    """A property's value as it would stand in a spec."""
    value = props[key]
    return value_text(value) if isinstance(value, bool | int | float | str) else props.as_string(key)


def _append_shape(state: mi.parser.ParserState, props: mi.Properties) -> None:
    """Add a shape node that reports errors at the place of the scene itself."""
    node = mi.parser.SceneNode(state.nodes[0])
    node.type = mi.ObjectType.Shape
    node.props = props
    state.nodes.append(node)
