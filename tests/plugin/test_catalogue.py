"""The catalogue under every accelerator: identical pixels under our trees, and those of Embree by the gates.

Every scene is rendered with path tracing or the like inside the integrator `moment`, which says how noisy the pixels
are, and once more with what the camera's rays hit first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp.exr import channels
from mitsuba_bsp.gates import identical
from mitsuba_bsp.judging import Rendering, judge
from mitsuba_bsp.noise import own_variance, rendered_channels

from .catalogue import ITEMS, Item
from .plugin_scenes import view

OURS = ("brute", "kd", "normals", "clustered")
SPECS = (*OURS, "native", "embree")

SAMPLES, SEED, SIDE = 16, 3, 32

#: What the first hit of a camera ray is described by, and how many pixels may differ from Embree's robust mode: a ray
#: through an edge may hit either of two triangles.
AOVS = "depth:depth,position:position,uv:uv,normal:geo_normal,primitive:prim_index,shape:shape_index"
EDGES = 0.005


@dataclass(frozen=True)
class Picture:
    """`image` as judged, `raw` with all channels, and the first hits (height, width, channels)."""

    image: Rendering
    raw: Mapping[str, np.ndarray]
    hits: np.ndarray


def load(item: Item, folder: Path, spec: str | None) -> mi.Scene:
    """The scene under `spec`, or as Mitsuba itself loads it."""
    folder.mkdir()
    made = item.make(folder)
    if isinstance(made, str):
        (folder / "scene.xml").write_text(made)
        if spec is None:
            return mi.load_file(str(folder / "scene.xml"), optimize=False, **item.params)
        return mitsuba_bsp.load_file(folder / "scene.xml", spec, optimize=False, **item.params)
    integrator = item.integrator if item.single else {"type": "moment", "inner": item.integrator}
    blocks = {} if item.integrator["type"] == "ptracer" else {"block_size": 16}
    description: dict[str, Any] = {**view(SIDE), "integrator": {**integrator, **blocks}}
    description["camera"] |= item.camera
    description["camera"]["film"]["pixel_format"] = "rgb"
    description["camera"]["sampler"]["sample_count"] = SAMPLES
    if spec is None:
        return mi.load_dict({**description, **made}, optimize=False)
    return mitsuba_bsp.load_dict({**description, **made}, spec, optimize=False)


def render(item: Item, folder: Path, spec: str) -> Picture:
    scene = load(item, folder, "embree:robust=true" if spec == "robust" else spec)
    raw = channels(np.array(mi.render(scene, seed=SEED, sensor=item.sensor), np.float32),
                   scene.integrator().aov_names())  # fmt: skip
    samples = scene.sensors()[item.sensor].sampler().sample_count()
    image = Rendering(spec, rendered_channels(raw), samples=samples, variance=own_variance(raw, samples))
    integrator = mi.load_dict({"type": "aov", "aovs": AOVS, "block_size": 16})
    hits = mi.render(scene, integrator=integrator, seed=SEED, spp=1, sensor=item.sensor)
    return Picture(image, raw, np.array(hits, np.float32))


@pytest.fixture(scope="module", params=ITEMS)
def pictures(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Picture]]:
    item = ITEMS[request.param]
    mi.set_variant(item.variant)
    threads = dr.thread_count()
    if item.integrator["type"] == "ptracer":
        dr.set_thread_count(1)  # its splats are added up in the order in which they come
    folder = tmp_path_factory.mktemp("scene")
    yield {spec: render(item, folder / spec, spec) for spec in (*SPECS, "robust")}
    dr.set_thread_count(threads)


def test_there_is_something_to_see(pictures: dict[str, Picture]) -> None:
    for picture in pictures.values():
        assert all(np.isfinite(plane).all() for plane in picture.raw.values())
    planes = pictures["kd"].image.image
    assert max(plane.std() for plane in planes.values()) > 0.02 or planes["G"].mean() > 0.2


def test_our_trees_make_identical_images(pictures: dict[str, Picture]) -> None:
    for spec in OURS[1:]:
        assert identical(pictures[spec].raw, pictures["brute"].raw).passed, spec
        assert np.array_equal(pictures[spec].hits, pictures["brute"].hits), spec


@pytest.mark.parametrize("spec", ["kd", "native"])
def test_they_are_those_of_embree(pictures: dict[str, Picture], spec: str) -> None:
    judgement = judge(pictures[spec].image, pictures["embree"].image, same_seed=True)
    assert judgement.same, [gate.found for gate in judgement.failed]


@pytest.mark.parametrize("spec", ["kd", "native"])
def test_camera_rays_hit_what_they_hit_in_embree(pictures: dict[str, Picture], spec: str) -> None:
    found, expected = pictures[spec].hits, pictures["robust"].hits
    same = np.isclose(found, expected, rtol=1e-3, atol=1e-3).all(axis=2)
    assert np.mean(~same) <= EDGES, np.argwhere(~same).tolist()


@pytest.mark.parametrize("name", [name for name in ITEMS if name != "groups in the file"])
def test_lists_and_names_stay(name: str, tmp_path: Path) -> None:
    """Shapes, emitters, sensors and parameters in the same order; but a mesh in the scene and in a shape group has its
    parameters under both names, not only under the first."""
    mi.set_variant(ITEMS[name].variant)
    plain, swapped = load(ITEMS[name], tmp_path / "plain", None), load(ITEMS[name], tmp_path / "kd", "kd")
    for objects in ("shapes", "emitters", "sensors"):
        found, expected = ([thing.id() for thing in getattr(s, objects)()] for s in (swapped, plain))
        assert [n for n in found if n not in expected] == [n for n in expected if n not in found], objects
        assert len(found) == len(expected)
    keys, wanted = ([key for key in mi.traverse(s).properties if "object_" not in key] for s in (swapped, plain))
    extra = set(keys) - set(wanted)
    assert [key for key in keys if key not in extra] == wanted
    assert name == "several shape groups" or not extra


@pytest.mark.parametrize("pictures", ["furnace"], indirect=True)
def test_the_furnace_glows_evenly(pictures: dict[str, Picture]) -> None:
    """Radiance 1 wherever one looks, within four standard errors; a path that escaped would be missing."""
    for spec, picture in pictures.items():
        for plane in picture.image.image.values():
            assert abs(plane.mean() - 1) < 4 * plane.std() / np.sqrt(plane.size), spec


def test_there_are_enough_items() -> None:
    assert len(ITEMS) >= 40
