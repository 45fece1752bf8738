"""A scene that is turned as a whole shows the same picture."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp import parse_spec
from mitsuba_bsp.loading import open_file
from mitsuba_bsp.turning import turn

GROUPS = """
<shape type="bsptree"><shape type="cube"><transform name="to_world"><scale value="0.5"/></transform></shape></shape>
<shape type="merge"><shape type="cube"><transform name="to_world"><translate x="2"/></transform></shape></shape>
<shape type="shapegroup" id="group"><shape type="cube"/></shape>
<shape type="instance"><ref id="group"/><transform name="to_world"><translate x="-2"/></transform></shape>
<shape type="sphere"><point name="center" value="0, 0, 2"/></shape>
<emitter type="directional"><vector name="direction" value="1, 1, -1"/></emitter>
<emitter type="point"><point name="position" value="0, -5, 4"/></emitter>
"""


def rendered(path: Path, seed: int | None) -> tuple[np.ndarray, mi.Scene]:
    loaded = open_file(path, edit=None if seed is None else lambda state: turn(state, seed))
    scene = loaded.construct(loaded.regrouped(parse_spec("kd")))
    return np.array(mi.render(scene, spp=64, seed=0)), scene


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("inside", ["room", "groups"])
def test_the_picture_is_the_same(room: Path, seed: int, inside: str) -> None:
    if inside == "groups":
        room.write_text(room.read_text().replace("</scene>", f"{GROUPS}</scene>"))
    (plain, before), (turned, after) = rendered(room, None), rendered(room, seed)
    assert np.abs(turned - plain).mean() < 0.005 * plain.mean()
    assert plain.std() > 0.05 * plain.mean(), "something is to be seen"
    box, other = before.bbox(), after.bbox()
    assert np.abs(np.array(box.max) - np.array(other.max)).max() > 0.1, "and it was turned"


def test_the_same_seed_turns_alike(room: Path) -> None:
    first, second = (np.array(rendered(room, 4)[1].sensors()[0].world_transform().matrix) for _ in range(2))
    assert (first == second).all()
