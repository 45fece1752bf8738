"""What scenes look like under every accelerator: the pixels of the stored images, to the last bit under our trees."""

from __future__ import annotations

from pathlib import Path

import mitsuba as mi
import pytest

from mitsuba_bsp.spec import parse_spec
from mitsuba_bsp.verification.meshes import Mesh, sphere
from mitsuba_bsp.verification.subjects import trees
from mitsuba_bsp.verification.wrapped import to_mitsuba
from pytest_mitsuba_bsp import ImageRegression

OURS = [*trees(), *(f"{tree}:layout=binary" for tree in trees() if "layout" in parse_spec(tree).settings)]
OTHERS = ["embree", "embree:robust=true", "native"]


@pytest.fixture
def glass() -> dict[str, object]:
    """A bumpy ball of glass under a sky, long paths along its surface."""
    ball = sphere("ball", 9, bumps=0.1)
    mesh = Mesh("ball", ball.vertices * 0.8, ball.faces)
    look = mi.ScalarTransform4f().look_at(origin=[0, -6, 2], target=[0, 0, 0], up=[0, 0, 1])
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 6},
        "camera": {"type": "perspective", "fov": 40, "to_world": look, "film": {"type": "hdrfilm"}},
        "sky": {"type": "constant"},
        "lamp": {"type": "point", "position": [2, -4, 5], "intensity": {"type": "rgb", "value": [30, 20, 10]}},
        "ball": to_mitsuba(mesh, child={"type": "dielectric"}),
    }


@pytest.mark.parametrize("spec", OURS)
def test_our_trees_render_the_stored_pixels(
    image_regression: ImageRegression, room: Path, glass: dict[str, object], spec: str
) -> None:
    image_regression(room, spec, name="room", spp=16, resolution=48)
    image_regression(glass, spec, name="glass", spp=16, resolution=48)


@pytest.mark.parametrize("spec", OTHERS)
def test_other_accelerators_render_the_same_scenes(
    image_regression: ImageRegression, room: Path, glass: dict[str, object], spec: str
) -> None:
    """Rounded otherwise, and with another seed also noisy otherwise: a test of the gates as much as of Mitsuba."""
    image_regression(room, spec, name="room", spp=16, resolution=48)
    image_regression(room, spec, name="room", spp=16, resolution=48, seed=1)
    image_regression(glass, spec, name="glass", spp=16, resolution=48)
