"""A group inside a stock `shapegroup`, placed by stock `instance`s."""

from __future__ import annotations

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from mitsuba_bsp.verification.meshes import soup

from .plugin_scenes import assert_same_up_to_rounding, ball, group, pixels, place, ray, rays_inward, to_mesh, view

#: Moved, mirrored, squeezed and turned, and hugely far from round.
TRANSFORMS = {
    "moved": lambda: place(0.7, at=(-1.5, 0, 0)),
    "mirrored": lambda: place([-0.7, 0.7, 0.7], 30, (0, 0, 0.5)),
    "squeezed": lambda: place([0.9, 0.3, 0.5], 60, (1.5, 0, 0)),
    "sheared": lambda: place([1, 0.05, 3], 25, (0, 2, 0)) @ place(0.5, 40),
}


def shapes() -> dict[str, Any]:
    mesh = soup("soup", 60, edge=0.5)
    uv = np.tile([(0, 0), (1, 0), (0, 1)], (60, 1))
    checks = {"type": "diffuse", "reflectance": {"type": "checkerboard"}}
    return {
        "soup": to_mesh(mesh.vertices, mesh.faces, mi.load_dict({"type": "twosided", "b": checks}), uv=uv),
        "ball": ball(mi.load_dict({"type": "roughconductor"}), scale=0.3),
        "cube": {"type": "cube", "to_world": place(0.4, 20, (0.5, 0.5, 0.5))},
    }


def instanced(spec: str) -> dict[str, Any]:
    content = shapes() if spec == "embree" else {"inner": group(spec, shapes())}
    placed = {
        name: {"type": "instance", "to_world": transform(), "shapegroup": {"type": "ref", "id": "group"}}
        for name, transform in TRANSFORMS.items()
    }
    return {
        **view(48),
        "group": {"type": "shapegroup", **content},
        **placed,
        "floor": {"type": "rectangle", "to_world": place(5, at=(0, 0, -1))},
        "sky": {"type": "constant"},
    }


@pytest.mark.parametrize("spec", ["kd", "normals", "random:triangle_test=mt", "native"])
def test_instances_look_as_under_embree(spec: str) -> None:
    plain, ours = (pixels(mi.load_dict(instanced(s), optimize=False), spp=16) for s in ("embree", spec))
    assert plain[..., :3].std() > 0.1
    assert_same_up_to_rounding(ours, plain, share=0.03)


def aimed_rays() -> tuple[np.ndarray, np.ndarray]:
    """At vertices of the soup as it is placed, at points of its edges, and anywhere."""
    o, d = rays_inward(4000)
    corners = soup("soup", 60, edge=0.5).vertices.reshape(-1, 3, 3)
    rng = np.random.default_rng(2)
    placed = [np.array(transform().matrix, float) for transform in TRANSFORMS.values()]
    for i in range(0, len(o), 2):
        a, b, _ = corners[rng.integers(len(corners))]
        point = a + rng.choice([0, 0.5]) * (b - a)
        d[i] = (placed[rng.integers(len(placed))] @ (*point, 1))[:3] - o[i]
    return o, d


@pytest.mark.parametrize("spec", ["kd", "normals", "random:triangle_test=mt", "native"])
def test_hits_on_instances(spec: str) -> None:
    """Position, normals, texture coordinates and their derivatives; texture coordinates stay inside the triangle.

    An instance turns a ray twice, once for Embree and once for itself, a little differently: the second may miss.
    """
    plain, ours = (mi.load_dict(instanced(s), optimize=False) for s in ("embree", spec))
    hits = wrong = 0
    for pair in zip(*aimed_rays(), strict=True):
        expected, found = plain.ray_intersect(ray(*pair)), ours.ray_intersect(ray(*pair))
        if not expected.is_valid() or expected.instance is None:
            continue
        hits += 1
        assert np.isfinite([*found.uv, *found.p, *found.n]).all()
        assert min(found.uv) >= -1e-6 and max(found.uv) <= 1 + 1e-6
        same = [found.instance is not None and found.instance.id() == expected.instance.id()]
        same += [np.allclose(getattr(found, name), getattr(expected, name), rtol=1e-3, atol=1e-3)
                for name in ("t", "p", "n", "uv", "dp_du", "dp_dv")]  # fmt: skip
        wrong += not all(same)
        assert ours.ray_test(ray(*pair)) == found.is_valid() or spec == "native"
    assert hits > 1500
    assert wrong <= hits * 0.2  # a ray at an edge may find either triangle


def test_lamps_cannot_be_instanced() -> None:
    """As outside a group."""
    lamp = {"type": "rectangle", "emitter": {"type": "area"}}
    with pytest.raises(RuntimeError, match="Instancing of emitters is not supported"):
        mi.load_dict({"type": "shapegroup", "inner": group("kd", {"lamp": lamp, "cube": {"type": "cube"}})})
