"""Set a parsed scene up so that its images can be compared bit for bit.

Mitsuba seeds its random numbers per image block, and shrinks the blocks when there are fewer than threads; and with a
filter wider than a pixel, neighbouring blocks are added up in the order in which they finish. So the block size is
always fixed, and images that are compared are rendered with the box filter.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import mitsuba as mi

from .messages import choices

#: Mitsuba's own block size wherever the image has enough blocks for all threads.
BLOCK_SIZE = 32

#: The integrators that render in blocks and know `block_size`.
_BLOCK_INTEGRATORS = ("aov", "depth", "direct", "moment", "path", "raycost", "stokes", "volpath", "volpathmis")

#: Our integrator that says what the rays of another cost.
RAY_COST = "raycost"

#: Settings of a scene's integrator that decide how its image is divided among threads.
_BLOCK_SETTINGS = ("block_size", "samples_per_pass", "timeout")


def fix_block_size(state: mi.parser.ParserState) -> bool:
    """Give the scene's integrator a fixed block size; False if it has no such setting."""
    for child in _integrators(state):
        props = state.nodes[child].props
        if props.plugin_name() not in _BLOCK_INTEGRATORS:
            return False
        if "block_size" not in props:
            props["block_size"] = BLOCK_SIZE
    return True


def watch_costs(state: mi.parser.ParserState) -> None:
    """Put the scene's integrator into one that also says, pixel by pixel, what its rays cost.

    ValueError if its rays belong to no pixel.
    """
    for child in _integrators(state):
        inner = mi.parser.SceneNode(state.nodes[child])
        name = inner.props.plugin_name()
        if name == RAY_COST:
            continue
        if name not in _BLOCK_INTEGRATORS:
            raise ValueError(
                f'the integrator "{name}" traces its rays for the whole image, so no pixel has a cost: '
                f"those of {choices(_BLOCK_INTEGRATORS)} do"
            )
        outer = mi.Properties(RAY_COST)
        for key in _BLOCK_SETTINGS:
            if key in inner.props:
                outer[key] = inner.props[key]
        outer["integrator"] = mi.Properties.ResolvedReference(len(state.nodes))
        state.nodes[child].props = outer
        state.nodes.append(inner)


def use_box_filter(state: mi.parser.ParserState) -> None:
    """Replace the pixel filter of every film by the box filter."""
    for film in _films(state):
        props = state.nodes[film].props
        for key in [key for key in props if _is_filter(state, props, key)]:
            del props[key]
        props["rfilter"] = mi.Properties.ResolvedReference(len(state.nodes))
        _append(state, film, mi.ObjectType.ReconstructionFilter, "box")


def has_box_filter(state: mi.parser.ParserState) -> bool:
    """Whether every film uses the box filter."""
    filters = [
        state.nodes[child].props.plugin_name()
        for film in _films(state)
        for child in _references(state.nodes[film].props)
        if state.nodes[child].type == mi.ObjectType.ReconstructionFilter
    ]
    return filters == ["box"] * len(_films(state))


def filter_name(scene: mi.Scene) -> str:
    """The pixel filter of a scene's first sensor, in small letters: box, gaussian, ..."""
    return str(scene.sensors()[0].film().rfilter()).partition("Filter")[0].lower()


def set_resolution(state: mi.parser.ParserState, longer_side: int) -> None:
    """Scale every film, and its crop window, so that its longer side has `longer_side` pixels."""
    for film in _films(state):
        props = state.nodes[film].props
        width, height = props.get("width", 768), props.get("height", 576)
        scale = longer_side / max(width, height)
        props["width"], props["height"] = (max(1, round(scale * side)) for side in (width, height))
        for size, offset, full in (
            ("crop_width", "crop_offset_x", "width"),
            ("crop_height", "crop_offset_y", "height"),
        ):
            if offset in props:
                props[offset] = min(math.floor(scale * props[offset]), props[full] - 1)
            if size in props:
                props[size] = min(max(1, round(scale * props[size])), props[full] - props.get(offset, 0))


def _films(state: mi.parser.ParserState) -> list[int]:
    """Indices of all film nodes; a sensor that has none gets the film that Mitsuba would give it."""
    for index in range(len(state.nodes)):
        node = state.nodes[index]
        if node.type != mi.ObjectType.Sensor:
            continue
        if not any(state.nodes[child].type == mi.ObjectType.Film for child in _references(node.props)):
            node.props["film"] = mi.Properties.ResolvedReference(len(state.nodes))
            _append(state, index, mi.ObjectType.Film, "hdrfilm")
    return [index for index in range(len(state.nodes)) if state.nodes[index].type == mi.ObjectType.Film]


def _integrators(state: mi.parser.ParserState) -> list[int]:
    """Indices of the scene's own integrators, of which there should be one."""
    children = list(_references(state.nodes[0].props))
    return [child for child in children if state.nodes[child].type == mi.ObjectType.Integrator]


def _references(props: mi.Properties) -> Iterator[int]:
    """Indices of the nodes that `props` refers to."""
    for key in props:
        if props.type(key) == mi.Properties.Type.ResolvedReference:
            yield props[key].index()


def _is_filter(state: mi.parser.ParserState, props: mi.Properties, key: str) -> bool:
    if props.type(key) != mi.Properties.Type.ResolvedReference:
        return False
    return state.nodes[props[key].index()].type == mi.ObjectType.ReconstructionFilter


def _append(state: mi.parser.ParserState, near: int, kind: mi.ObjectType, plugin: str) -> None:
    """Add a node that reports errors at the place of the node `near`."""
    node = mi.parser.SceneNode(state.nodes[near])
    node.type, node.props = kind, mi.Properties(plugin)
    state.nodes.append(node)
