"""Meshes, scenes and renderings that the tests of the plugins share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np

import mitsuba_bsp
from mitsuba_bsp.images import ImageDifference, compare_images
from mitsuba_bsp.verification.meshes import Mesh, sphere

#: Our trees; with the watertight test all of them must make the same images, bit for bit.
TREES = ("brute", "kd", "ize", "random", "normals", "clustered:k=6,axes=plain")

#: Every accelerator but Embree.
SPECS = (*TREES, "kd:triangle_test=mt", "native")

#: Share of pixels that may be off by more than 1e-3 where an image is made with other roundings of the same hits.
ROUNDING_SHARE = 0.02

Description = dict[str, Any]


def to_mesh(
    vertices: np.ndarray,
    faces: np.ndarray,
    *children: mi.Object,
    uv: np.ndarray | None = None,
    name: str = "mesh",
) -> mi.Mesh:
    """A mesh made in Python; `children` are its BSDF, emitter and the like."""
    vertices, faces = np.reshape(vertices, (-1, 3)), np.reshape(faces, (-1, 3))
    props = mi.Properties()
    for index, child in enumerate(children):
        props[f"child_{index}"] = child
    mesh = mi.Mesh(name, len(vertices), len(faces), props=props, has_vertex_texcoords=uv is not None)
    params = mi.traverse(mesh)
    params["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    params["faces"] = np.ravel(faces).astype(np.uint32)
    if uv is not None:
        params["vertex_texcoords"] = np.ravel(uv).astype(np.float32)
    params.update()
    return mesh


def from_verification(mesh: Mesh, *children: mi.Object) -> mi.Mesh:
    return to_mesh(mesh.vertices, mesh.faces, *children, name=mesh.name)


def ball(*children: mi.Object, centre: tuple[float, float, float] = (0, 0, 0), scale: float = 0.5) -> mi.Mesh:
    """A tessellated sphere of radius 2 `scale`."""
    mesh = sphere("ball", 9)
    return to_mesh(mesh.vertices * scale + np.array(centre), mesh.faces, *children, name="ball")


def view(resolution: int = 32, **integrator: Any) -> Description:
    """An integrator and a camera that looks at the origin from (0, -6, 2), set up for bit-equal images."""
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 4, "block_size": 16, **integrator},
        "camera": {
            "type": "perspective",
            "fov": 50,
            "to_world": mi.ScalarTransform4f().look_at(origin=[0, -6, 2], target=[0, 0, 0], up=[0, 0, 1]),
            "sampler": {"type": "independent", "sample_count": 8},
            "film": {
                "type": "hdrfilm",
                "pixel_format": "rgba",
                "width": resolution,
                "height": resolution,
                "rfilter": {"type": "box"},
            },
        },
    }


def place(scale: float | list[float] = 1.0, turn: float = 0.0, at: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """Scaled, turned around z by degrees, moved."""
    t = mi.ScalarTransform4f()
    return t.translate(list(at)) @ t.rotate([0, 0, 1], turn) @ t.scale(scale)


def facing_down(scale: float, at: tuple[float, float, float]) -> Any:
    """For a rectangle that looks down."""
    t = mi.ScalarTransform4f()
    return t.translate(list(at)) @ t.rotate([1, 0, 0], 180) @ t.scale(scale)


def pixels(scene: mi.Scene, seed: int = 3, spp: int = 0) -> np.ndarray:
    return np.array(mi.render(scene, seed=seed, spp=spp), np.float32)


def channels(image: np.ndarray) -> Mapping[str, np.ndarray]:
    return {name: image[..., index] for index, name in enumerate("RGBA"[: image.shape[2]])}


def difference(image: np.ndarray, reference: np.ndarray) -> ImageDifference:
    return compare_images(channels(image), channels(reference))


def assert_same_up_to_rounding(image: np.ndarray, reference: np.ndarray, share: float = ROUNDING_SHARE) -> None:
    found = difference(image, reference)
    assert found.non_finite_pixels == 0, found
    assert found.verdict in ("identical", "rounding"), found
    assert found.share <= share, found


def load(description: Description, spec: str) -> mi.Scene:
    """The scene with its meshes under `spec`, by the harness."""
    return mitsuba_bsp.load_dict(description, spec)


def group(spec: str, shapes: Mapping[str, Any]) -> Description:
    """The shapes in a group as a user writes it."""
    parsed = mitsuba_bsp.parse_spec(spec)
    tree = {"tree": parsed.name} if parsed.is_tree else {}
    return {"type": parsed.plugin, **tree, **{key: parsed.settings[key] for key in parsed.options}, **shapes}


def ray(origin: np.ndarray, direction: np.ndarray, maxt: float = np.inf) -> mi.Ray3f:
    return mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction), maxt, 0.0, [])


def rays_inward(count: int, seed: int = 0, reach: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """From a cube around the centre at points of a smaller one, directions not normalised."""
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-reach, reach, (count, 3)).astype(np.float32)
    return origins, rng.uniform(-reach / 3, reach / 3, (count, 3)).astype(np.float32) - origins
