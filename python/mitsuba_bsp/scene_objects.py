"""Make the objects of a parsed scene (meshes, materials, ...) without making the scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence, Set
from dataclasses import dataclass
from functools import cache

import mitsuba as mi

from .swap import MERGE, Container, Reference, object_keys

Child = tuple[str, mi.Object | Reference]


def make_objects(
    config: mi.parser.ParserConfig, state: mi.parser.ParserState, nodes: Sequence[int], kept: Set[int]
) -> tuple[Container, ...]:
    """Make the objects that these nodes refer to, but for the nodes `kept`."""
    maker = _Maker(state, kept)
    root, kind = mi.Properties(state.nodes[0].props), state.nodes[0].type
    holder = mi.Properties(_holder_plugin(config.variant))
    for node in nodes:
        for made in maker.to_make(state.nodes[node].props):
            holder[_slot(made)] = Reference(made)
    state.nodes[0].type, state.nodes[0].props = mi.ObjectType.Texture, holder
    mi.parser.instantiate(config, state)
    filled = mi.Properties(state.nodes[0].props)
    state.nodes[0].type, state.nodes[0].props = kind, root
    return tuple(Container(node, tuple(maker.children(state.nodes[node].props, filled))) for node in nodes)


@dataclass(frozen=True)
class _Maker:
    """What becomes of the nodes that a container refers to.

    Meshes are merged here and not by Mitsuba, because its `merge` orders them by their addresses in memory.
    """

    state: mi.parser.ParserState
    kept: Set[int]

    def to_make(self, props: mi.Properties) -> Iterator[int]:
        """The nodes that Mitsuba makes."""
        for key in object_keys(props):
            if not isinstance(props[key], Reference) or props[key].index() in self.kept:
                continue
            node = props[key].index()
            if self._merge(node):
                yield from self.to_make(self._merge(node))
            else:
                yield node

    def children(self, props: mi.Properties, holder: mi.Properties) -> Iterator[Child]:
        """The objects in the order in which Mitsuba itself would list them."""
        several: list[Child] = []
        for key in object_keys(props):
            found = self._became(props[key], holder)
            if len(found) == 1:
                yield key, found[0]
            else:
                several += [(f"{key}_{index}", child) for index, child in enumerate(found)]
        # Mitsuba appends what an object expands into behind everything else.
        yield from several

    def _became(self, thing: mi.Object | Reference, holder: mi.Properties) -> list[mi.Object | Reference]:
        if not isinstance(thing, Reference) or thing.index() in self.kept:
            return [thing]
        if props := self._merge(thing.index()):
            return _merged((child for _, child in self.children(props, holder)), props.id())
        slot = _slot(thing.index())
        if slot in holder:
            return [holder[slot]]
        found: list[mi.Object] = []
        while f"{slot}_{len(found)}" in holder:  # what it expanded into
            found.append(holder[f"{slot}_{len(found)}"])
        return found

    def _merge(self, node: int) -> mi.Properties | None:
        """The properties of a `merge`; None for any other node."""
        props = self.state.nodes[node].props
        return props if props.plugin_name() == MERGE else None


def _slot(node: int) -> str:
    """The holder's name for what a node becomes."""
    return f"node{node}"


def _merged(objects: Iterable[mi.Object], name: str) -> list[mi.Object]:
    """What Mitsuba's `merge` makes of these objects, but in their order; `name` is its id."""
    others: list[mi.Object] = []
    alike: dict[tuple[object, ...], list[mi.Mesh]] = {}
    for thing in objects:
        if not isinstance(thing, mi.Mesh) or thing.has_mesh_attributes():
            others.append(thing)
            continue
        parts = (thing.bsdf(), thing.interior_medium(), thing.exterior_medium(), thing.emitter(), thing.sensor())
        key = (
            *(part.ptr if part else None for part in parts),
            thing.has_vertex_normals(),
            thing.has_vertex_texcoords(),
            thing.has_face_normals(),
        )
        alike.setdefault(key, []).append(thing)
    merged = [_merge_alike(meshes) for meshes in alike.values()]
    if len(merged) == 1 and name:
        merged[0].set_id(name)
    return [*others, *merged]


def _merge_alike(meshes: Sequence[mi.Mesh]) -> mi.Mesh:
    if len(meshes) == 1:
        return meshes[0]
    return mi.load_dict({"type": MERGE, **{str(index): mesh for index, mesh in enumerate(meshes)}})


@cache
def _holder_plugin(variant: str) -> str:
    """Register (once per variant) a plugin that accepts any objects and does nothing with them.

    As the root of a parsed scene it makes Mitsuba create all of the scene's objects, with its own checks and in
    parallel, and no scene.
    """

    class Holder(mi.Texture):
        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            props.objects()  # marks them as used

    name = "mitsuba_bsp_holder"
    mi.register_texture(name, Holder)
    return name
