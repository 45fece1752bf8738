"""Turn everything in a parsed scene around the origin: the same picture, but other planes and boxes along the axes."""

from __future__ import annotations

from collections.abc import Iterator

import mitsuba as mi

from .swap import GROUPS, MERGE, SHAPE_GROUP, object_keys

_PLACED = (mi.ObjectType.Shape, mi.ObjectType.Sensor, mi.ObjectType.Emitter)
_POINTS, _VECTORS = ("position",), ("direction",)


def turn(state: mi.parser.ParserState, seed: int) -> None:
    """Turn all shapes, sensors and emitters by one random rotation. The references of `state` must be resolved."""
    from scipy.spatial.transform import Rotation

    matrix = Rotation.random(rng=seed).as_matrix()
    rotation = mi.ScalarAffineTransform4d([[*row, 0.0] for row in matrix.tolist()] + [[0.0, 0.0, 0.0, 1.0]])
    for node in sorted(set(_placed(state, 0))):
        props = state.nodes[node].props
        vectors = [key for key in _VECTORS if key in props and "to_world" not in props]
        points = [key for key in _POINTS if key in props]
        for key in vectors:
            props[key] = rotation @ mi.ScalarVector3d(props[key])
        for key in points:
            props[key] = rotation @ mi.ScalarPoint3d(props[key])
        if not vectors and not points:
            props["to_world"] = rotation @ props.get("to_world", mi.ScalarAffineTransform4d())


def _placed(state: mi.parser.ParserState, parent: int) -> Iterator[int]:
    """Nodes that have a place in the world, where groups only hold others; what instances show is theirs to place."""
    props = state.nodes[parent].props
    for key in object_keys(props):
        if not isinstance(props[key], mi.Properties.ResolvedReference):
            continue
        child = props[key].index()
        plugin = state.nodes[child].props.plugin_name()
        if plugin in (*GROUPS, MERGE):
            yield from _placed(state, child)
        elif plugin != SHAPE_GROUP and state.nodes[child].type in _PLACED:
            yield child
