"""Move a scene's meshes and bounded primitives under an accelerator, changing nothing else in the scene.

Two steps. `dissolve` works on the parsed scene: groups that the file already names give way to their children.
`regroup` works on the objects of a container, which is the scene or one of its shape groups: every such shape moves
into one group node, and a `bspmember` that stands for it takes its place, so that the order of shapes, emitters and
sensors and every parameter name stay as they were. So the scene has an accelerator, and each shape group has its own,
built once however often it is instanced.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mitsuba as mi

from .messages import choices
from .spec import Spec, Value, make_spec, value_text

GROUPS = ("bsptree", "nativekdtree")
MEMBER = "bspmember"
SHAPE_GROUP, INSTANCE, MERGE = "shapegroup", "instance", "merge"

#: Refers to a node of the parsed scene.
Reference = mi.Properties.ResolvedReference

#: Meshes whose intersection is more than that of their triangles (this one culls back faces).
_NOT_PLAIN = ("EllipsoidsMesh",)

#: Other shapes that Mitsuba intersects one ray and one primitive at a time.
_BOUNDED = ("Sphere", "Disk", "Cylinder", "SDFGrid", "Ellipsoids")

#: Keys of the group plugins that are no setting of a tree: flags, and paths of files.
_PLUGIN_FLAGS = {"bsptree": ("expand", "count"), "nativekdtree": ("expand", "count", "check")}
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


@dataclass(frozen=True)
class Container:
    """The scene (node 0 of the parsed scene) or one of its shape groups.

    `children` are its objects with their property names, in order. Shape groups and their instances are still
    references to nodes: they are made with the scene itself, when their content is under an accelerator.
    """

    node: int
    children: tuple[tuple[str, mi.Object | Reference], ...]

    @property
    def meshes(self) -> list[mi.Mesh]:
        """The triangle meshes, which go under every accelerator, in order, each once."""
        return list({child.ptr: child for _, child in self.children if is_groupable(child)}.values())

    def grouped(self, spec: Spec) -> list[mi.Shape]:
        """What goes under this accelerator, in order, each once."""
        return list({child.ptr: child for _, child in self.children if goes_under(child, spec)}.values())

    @property
    def triangles(self) -> int:
        """Number of triangles under the accelerator."""
        return sum(mesh.face_count() for mesh in self.meshes)

    @property
    def others(self) -> Counter[str]:
        """Class names and counts of the shapes that stay with Embree under any accelerator."""
        return self._count(lambda shape: not is_groupable(shape) and not is_bounded(shape))

    @property
    def bounded(self) -> Counter[str]:
        """Of the shapes other than meshes that go under accelerators."""
        return self._count(is_bounded)

    @property
    def several(self) -> Counter[str]:
        """Of those that have more than one primitive."""
        return self._count(lambda shape: is_bounded(shape) and shape.primitive_count() > 1)

    def _count(self, chosen: Callable[[mi.Shape], bool]) -> Counter[str]:
        shapes = (child for _, child in self.children if isinstance(child, mi.Shape))
        return Counter(shape.class_name() for shape in shapes if chosen(shape))


def is_groupable(thing: mi.Object | Reference) -> bool:
    """Whether a scene object is a plain triangle mesh, which all accelerators take."""
    return isinstance(thing, mi.Mesh) and thing.class_name() not in _NOT_PLAIN


def is_bounded(thing: mi.Object | Reference) -> bool:
    """Whether it is another shape that can go under an accelerator."""
    return isinstance(thing, mi.Shape) and thing.class_name() in _BOUNDED


def goes_under(thing: mi.Object | Reference, spec: Spec) -> bool:
    """Whether it goes under this one: Mitsuba's kd-tree takes shapes of one primitive, `ize` nothing but meshes."""
    if not is_bounded(thing):
        return is_groupable(thing)
    return spec.name != "ize" and (spec.name != "native" or thing.primitive_count() == 1)


def dissolve(state: mi.parser.ParserState) -> None:
    """Replace the `bsptree` and `nativekdtree` nodes of the scene and its shape groups by their children, in order.

    The references of `state` must be resolved. ValueError if a group holds another one, or something that is
    no shape, or has wrong settings.
    """
    _dissolve_in(state, 0)
    for group in nodes_of(state, SHAPE_GROUP):
        _dissolve_in(state, group)


def nodes_of(state: mi.parser.ParserState, plugin: str) -> list[int]:
    """Numbers of the nodes of this plugin that the root of a parsed scene refers to, each once."""
    root = state.nodes[0].props
    found = [root[key].index() for key in object_keys(root) if isinstance(root[key], Reference)]
    return [node for node in dict.fromkeys(found) if state.nodes[node].props.plugin_name() == plugin]


def regroup(state: mi.parser.ParserState, container: Container, spec: Spec, options: GroupOptions) -> None:
    """Rewrite the node of `container` so that it holds its children under the accelerator `spec`."""
    props = without_objects(state.nodes[container.node].props)
    if spec.name == "embree" and container.node == 0:
        props["embree_use_robust_intersections"] = spec.settings["robust"]
    shapes = container.grouped(spec) if spec.plugin else []
    group = len(state.nodes)
    members = {shape.ptr: group + 1 + index for index, shape in enumerate(shapes)}
    for key, child in container.children:
        grouped = spec.plugin and goes_under(child, spec)
        props[key] = Reference(members[child.ptr]) if grouped else child
    state.nodes[container.node].props = props
    if shapes:
        _append_shape(state, _group(spec, options, shapes))
    for index, shape in enumerate(shapes):
        _append_shape(state, _member(shape.id(), group, index))


def _group(spec: Spec, options: GroupOptions, shapes: Sequence[mi.Shape]) -> mi.Properties:
    """The node that holds the shapes and knows the settings of the accelerator."""
    props = mi.Properties(spec.plugin)
    for index, shape in enumerate(shapes):
        props[f"child_{index}"] = shape
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
    """The node that stands for one shape of the node number `group`."""
    props = mi.Properties(MEMBER)
    props.set_id(name)
    props["group"] = Reference(group)
    props["index"] = index
    return props


def object_keys(props: mi.Properties) -> list[str]:
    """Names of the properties that hold an object or a reference to one."""
    kinds = (mi.Properties.Type.ResolvedReference, mi.Properties.Type.Object)
    return [key for key in props if props.type(key) in kinds]


def without_objects(props: mi.Properties) -> mi.Properties:
    """A copy of `props` with its plain values only."""
    copy = mi.Properties(props)
    for key in object_keys(props):
        del copy[key]
    return copy


def _dissolve_in(state: mi.parser.ParserState, container: int, group: str | None = None) -> None:
    before = state.nodes[container].props
    children = [pair for key in object_keys(before) for pair in _flatten(state, key, before[key], group)]
    props = without_objects(before)
    for key, child in children:
        props[key] = child
    state.nodes[container].props = props


def _flatten(
    state: mi.parser.ParserState, key: str, child: mi.Object | Reference, group: str | None
) -> list[tuple[str, mi.Object | Reference]]:
    """`child` itself, or what a group holds; `group` is the plugin that encloses it, if any."""
    if not isinstance(child, Reference):
        return [(key, child)]
    node = state.nodes[child.index()]
    plugin, place = node.props.plugin_name(), mi.parser.file_location(state, node)
    if plugin == MEMBER:
        raise ValueError(f"{place}: {MEMBER} is written by mitsuba_bsp itself and cannot be part of a scene it loads")
    if group and node.type != mi.ObjectType.Shape:
        raise ValueError(f'{place}: a {group} takes only shapes as children, not the {node.type.name} "{plugin}"')
    if plugin in GROUPS and group in GROUPS:
        raise ValueError(f"{place}: a {plugin} cannot be inside a {group}")
    if plugin not in (*GROUPS, MERGE):
        return [(key, child)]
    _check_settings(plugin, node.props, place)
    pairs = [(f"{key}/{name}", node.props[name]) for name in object_keys(node.props)]
    if not pairs:
        mi.Log(mi.LogLevel.Warn, f"{place}: this {plugin} is empty and adds nothing to the scene")
    if plugin == MERGE:
        _dissolve_in(state, child.index(), group)
        return [(key, child)]
    return [pair for name, inner in pairs for pair in _flatten(state, name, inner, plugin)]


def _check_settings(plugin: str, props: mi.Properties, place: str) -> None:
    """ValueError unless the settings that the file gives to a group are valid."""
    objects = set(object_keys(props))
    given = {key: _text(props, key) for key in props if key not in objects}
    try:
        if plugin == MERGE:
            if given:
                raise ValueError(f"merge takes no properties, but has {choices(given)}")
            return
        for key in _PLUGIN_FLAGS[plugin]:
            if given.pop(key, "true") not in ("true", "false"):
                raise ValueError(f'"{key}" is neither true nor false')
        _check_tree_settings(plugin, given)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None


def _check_tree_settings(plugin: str, given: Mapping[str, str]) -> None:
    options = dict(given)
    name = "native"
    if plugin == "bsptree":
        name = options.pop("tree", "auto")
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
