"""Small scenes, each for one thing that a Mitsuba scene may contain; `test_catalogue` renders them under all trees.

An item is a function of a folder for its files. It returns the scene's objects besides camera and integrator, or an XML
text. What else it needs is said where it is listed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from mitsuba_bsp.verification.meshes import soup, sphere

from .plugin_scenes import Description, ball, facing_down, place, to_mesh
from .test_children import merged, write_obj, write_ply, write_serialized

PATH = {"type": "path", "max_depth": 4}
VOLPATH = {"type": "volpath", "max_depth": 12, "rr_depth": 50}
VOLPATHMIS = {**VOLPATH, "type": "volpathmis"}

Make = Callable[[Path], Description | str]


@dataclass(frozen=True)
class Item:
    """A scene and how to render it.

    `sensor` is the number of the sensor, `camera` what the first one is beyond the usual. `single`: the integrator fits
    into no other. `params` are those of an XML file.
    """

    make: Make
    integrator: Description = field(default_factory=lambda: dict(PATH))
    variant: str = "scalar_rgb"
    sensor: int = 0
    camera: Description = field(default_factory=dict)
    single: bool = False
    params: Mapping[str, str] = field(default_factory=dict)


ITEMS: dict[str, Item] = {}


def item(name: str, **settings: Any) -> Callable[[Make], Make]:
    """Lists a scene; a function may be listed several times with other settings."""

    def add(make: Make) -> Make:
        assert name not in ITEMS
        ITEMS[name] = Item(make, **settings)
        return make

    return add


# -- parts ----------------------------------------------------------------------------------------------------------


def rgb(*value: float) -> Description:
    return {"type": "rgb", "value": list(value)}


def grey(albedo: float = 0.5) -> Description:
    return {"type": "twosided", "b": {"type": "diffuse", "reflectance": rgb(albedo, albedo, albedo)}}


def floor() -> Description:
    return {"type": "rectangle", "to_world": place(4, at=(0, 0, -1.2)), "bsdf": grey()}


def lamp(at: tuple[float, float, float] = (0, 0, 4), scale: float = 1, **light: Any) -> Description:
    return {"type": "rectangle", "to_world": facing_down(scale, at), "emitter": {"type": "area", **light}}


def lit(**things: Any) -> Description:
    """On a floor, under a sky and a lamp."""
    sky = {"type": "constant", "radiance": 0.3}
    return {"floor": floor(), **things, "lamp": lamp(radiance=rgb(5, 5, 5)), "sky": sky}


def in_the_dark(**things: Any) -> Description:
    """On a floor with a box and a ball on it, without light."""
    box = {"type": "cube", "to_world": place(0.5, 30, (-1, 0, -0.5)), "bsdf": grey(0.7)}
    return {"floor": floor(), "box": box, "ball": ball(centre=(1, 0, -0.4), scale=0.3), **things}


def noise(low: float, high: float, channels: int = 3, side: int = 8) -> Description:
    pixels = np.random.default_rng(5).uniform(low, high, (side, side, channels)).astype(np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "raw": True}


def smooth_obj(folder: Path) -> str:
    """A sphere with normals at its vertices and texture coordinates."""
    mesh = sphere("sphere", 7)
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices * 0.5]
    lines += [f"vn {x} {y} {z}" for x, y, z in mesh.vertices]
    lines += [f"vt {x} {z}" for x, _, z in mesh.vertices / 4 + 0.5]
    lines += ["f " + " ".join(f"{v + 1}/{v + 1}/{v + 1}" for v in face) for face in mesh.faces]
    (folder / "smooth.obj").write_text("\n".join(lines))
    return str(folder / "smooth.obj")


def leaves(count: int = 60) -> mi.Mesh:
    """Small squares everywhere, of which a texture shows a part."""
    rng = np.random.default_rng(3)
    centres, sides = rng.uniform(-1.2, 1.2, (count, 1, 3)), rng.uniform(-0.3, 0.3, (count, 2, 3))
    a, b = sides[:, :1], sides[:, 1:]
    corners = centres + np.concatenate([-a - b, a - b, a + b, b - a], axis=1)
    faces = np.arange(count)[:, None, None] * 4 + np.array([(0, 1, 2), (0, 2, 3)])
    opacity = {"type": "bitmap", "bitmap": mi.Bitmap(np.eye(8, dtype=np.float32)[..., None]), "raw": True}
    mask = mi.load_dict({"type": "mask", "opacity": opacity, "bsdf": grey(0.6)})
    return to_mesh(corners, faces, mask, uv=np.tile([(0, 0), (1, 0), (1, 1), (0, 1)], (count, 1)))


def with_attributes(name: str, kind: str) -> Description:
    mesh = sphere("sphere", 5)
    size = len(mesh.vertices if kind == "vertex" else mesh.faces)
    bsdf = mi.load_dict({"type": "diffuse", "reflectance": {"type": "mesh_attribute", "name": name}})
    made = to_mesh(mesh.vertices * 0.5, mesh.faces, bsdf)
    made.add_attribute(name, 3, np.random.default_rng(1).uniform(size=3 * size).tolist())
    return lit(mesh=made)


# -- meshes ---------------------------------------------------------------------------------------------------------


@item("ply")
def _(folder: Path) -> Description:
    return lit(mesh=write_ply(folder))


@item("obj")
def _(folder: Path) -> Description:
    return lit(mesh=write_obj(folder))


@item("serialized")
def _(folder: Path) -> Description:
    return lit(mesh=write_serialized(folder))


@item("cube")
def _(_: Path) -> Description:
    return lit(cube={"type": "cube", "to_world": place(0.7, 20)})


@item("rectangle")
def _(_: Path) -> Description:
    return lit(rectangle={"type": "rectangle", "to_world": place([1.5, 0.5, 1], 30), "bsdf": grey()})


@item("merge")
def _(folder: Path) -> Description:
    return lit(merge=merged(folder))


@item("vertex attributes")
def _(_: Path) -> Description:
    return with_attributes("vertex_color", "vertex")


@item("face attributes")
def _(_: Path) -> Description:
    return with_attributes("face_color", "face")


@item("vertex normals")
def _(folder: Path) -> Description:
    return lit(mesh={"type": "obj", "filename": smooth_obj(folder), "bsdf": {"type": "roughconductor"}})


@item("face normals")
def _(folder: Path) -> Description:
    return lit(mesh={"type": "obj", "filename": smooth_obj(folder), "face_normals": True})


@item("flipped normals")
def _(folder: Path) -> Description:
    shapes = {"a": smooth_obj(folder), "b": smooth_obj(folder)}
    made = {k: {"type": "obj", "filename": f, "flip_normals": k == "a", "to_world": place(at=(x, 0, 0))}
            for (k, f), x in zip(shapes.items(), (-1, 1), strict=True)}  # fmt: skip
    return lit(**made)


@item("a group of one triangle")
def _(_: Path) -> Description:
    triangle = to_mesh(np.array([(-2, 0, -1), (2, 0, -1), (0, 0, 2)]), np.array([(0, 1, 2)]))
    return {"triangle": triangle, "sky": {"type": "constant"}}


@item("meshes without faces")
def _(_: Path) -> Description:
    return lit(empty=mi.Mesh("empty", 3, 0), cube={"type": "cube"}, nothing=mi.Mesh("nothing", 0, 0))


@item("no mesh at all")
def _(_: Path) -> Description:
    return {"ball": {"type": "sphere"}, "sky": {"type": "constant"}}


@item("many triangles in disorder")
def _(_: Path) -> Description:
    mesh = soup("soup", 500, edge=0.4)
    return lit(soup=to_mesh(mesh.vertices, mesh.faces, mi.load_dict(grey())))


# -- materials ------------------------------------------------------------------------------------------------------


@item("checkerboard")
def _(folder: Path) -> Description:
    checks = {"type": "checkerboard", "to_uv": mi.ScalarTransform4f().scale(9)}
    return lit(mesh=write_obj(folder) | {"bsdf": {"type": "diffuse", "reflectance": checks}})


@item("bitmap")
def _(folder: Path) -> Description:
    return lit(mesh=write_obj(folder) | {"bsdf": {"type": "diffuse", "reflectance": noise(0.1, 0.9)}})


@item("normal map")
def _(folder: Path) -> Description:
    bsdf = {"type": "normalmap", "normalmap": noise(0.3, 0.7), "bsdf": {"type": "roughconductor"}}
    return lit(mesh={"type": "obj", "filename": smooth_obj(folder), "bsdf": bsdf})


@item("bump map")
def _(folder: Path) -> Description:
    bsdf = {"type": "bumpmap", "arbitrary": noise(0, 1, channels=1), "bsdf": {"type": "roughplastic"}, "scale": 0.3}
    return lit(mesh={"type": "obj", "filename": smooth_obj(folder), "bsdf": bsdf})


@item("two sides")
def _(folder: Path) -> Description:
    sides = {"a": {"type": "diffuse", "reflectance": rgb(0.8, 0.1, 0.1)}, "b": {"type": "plastic"}}
    return lit(mesh=write_ply(folder) | {"bsdf": {"type": "twosided", **sides}})


@item("masked leaves")
def _(_: Path) -> Description:
    return lit(leaves=leaves())


@item("null")
def _(_: Path) -> Description:
    inside = {"type": "cube", "to_world": place(0.4, 20), "bsdf": grey(0.8)}
    return lit(shell={"type": "cube", "to_world": place(0.8, 50), "bsdf": {"type": "null"}}, inside=inside)


@item("glass", integrator={"type": "path", "max_depth": 12})
@item("glass in a spectral variant", integrator={"type": "path", "max_depth": 12}, variant="scalar_spectral")
def _(_: Path) -> Description:
    rough = {"type": "cube", "to_world": place(0.5, 30, (-1, 0, 0)), "bsdf": {"type": "roughdielectric"}}
    return lit(ball=ball(mi.load_dict({"type": "dielectric"}), centre=(0.8, 0, 0)), rough=rough)


@item("blended and principled")
def _(folder: Path) -> Description:
    blend = {"type": "blendbsdf", "weight": noise(0, 1, channels=1), "a": {"type": "plastic"}, "b": grey()}
    principled = {"type": "principled", "metallic": 0.6, "roughness": 0.3}
    return lit(mesh=write_obj(folder) | {"bsdf": blend}, cube={
        "type": "cube", "to_world": place(0.4, 20, (1.5, 0, 0)), "bsdf": principled,
    })  # fmt: skip


# -- other shapes ---------------------------------------------------------------------------------------------------


@item("sphere")
def _(_: Path) -> Description:
    return lit(sphere={"type": "sphere", "radius": 0.8, "bsdf": {"type": "roughconductor"}}, cube={"type": "cube"})


@item("disk")
def _(_: Path) -> Description:
    tilted = mi.ScalarTransform4f().rotate([1, 1, 0], 50)
    return lit(disk={"type": "disk", "to_world": tilted, "bsdf": grey()},
               through={"type": "rectangle", "to_world": place([1.5, 0.3, 1], 20), "bsdf": grey(0.8)})  # fmt: skip


@item("cylinder")
def _(folder: Path) -> Description:
    ends = {"p0": [-1, 0, -0.5], "p1": [1, 0.5, 0.5]}
    return lit(cylinder={"type": "cylinder", "radius": 0.4, **ends, "bsdf": grey(0.7)}, mesh=write_obj(folder))


def curve(kind: str, folder: Path) -> Description:
    points = [f"{np.cos(t)} {np.sin(t)} {t / 6 - 0.5} {0.1 + 0.02 * t}" for t in np.linspace(0, 6, 12)]
    (folder / "curve.txt").write_text("\n".join(points))
    file = str(folder / "curve.txt")
    return lit(curve={"type": kind, "filename": file, "bsdf": grey(0.7)}, cube={"type": "cube", "to_world": place(0.4)})


@item("b-spline curve")
def _(folder: Path) -> Description:
    return curve("bsplinecurve", folder)


@item("linear curve")
def _(folder: Path) -> Description:
    return curve("linearcurve", folder)


@item("signed distances")
def _(_: Path) -> Description:
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 12)] * 3, indexing="ij")
    distance = np.sqrt(x**2 + y**2 + z**2) - 0.7 + 0.1 * np.sin(7 * x)
    grid = mi.TensorXf(distance[..., None].astype(np.float32))
    shape = {"type": "sdfgrid", "grid": grid, "normals": "smooth", "to_world": place(2, at=(-1, -1, -1))}
    return lit(grid=shape | {"bsdf": grey(0.7)}, cube={"type": "cube", "to_world": place(0.5)})


def blobs(kind: str) -> Description:
    rng = np.random.default_rng(8)
    parts = {"centers": rng.uniform(-1, 1, (9, 3)), "scales": rng.uniform(0.05, 0.2, (9, 3)),
             "quaternions": rng.normal(size=(9, 4))}  # fmt: skip
    parts["quaternions"] /= np.linalg.norm(parts["quaternions"], axis=1, keepdims=True)
    tensors = {name: mi.TensorXf(value.astype(np.float32)) for name, value in parts.items()}
    return lit(blobs={"type": kind, **tensors, "bsdf": grey(0.8)}, cube={"type": "cube", "to_world": place(0.4, 20)})


@item("ellipsoids")
def _(_: Path) -> Description:
    return blobs("ellipsoids")


@item("meshed ellipsoids")
def _(_: Path) -> Description:
    return blobs("ellipsoidsmesh")


# -- light ----------------------------------------------------------------------------------------------------------


@item("area light")
@item("direct light", integrator={"type": "direct", "emitter_samples": 2, "bsdf_samples": 1})
def _(_: Path) -> Description:
    return in_the_dark(lamp=lamp(radiance=rgb(9, 8, 7)))


@item("hidden light", integrator={**PATH, "hide_emitters": True})
@item("several lights")
def _(_: Path) -> Description:
    """Lights before, between and behind the other objects, one with another weight."""
    first = {"red": lamp((-1.5, 0, 2), 0.4, radiance=rgb(9, 1, 1))}
    between = {"green": lamp((1.5, 0, 2), 0.4, radiance=rgb(1, 9, 1), sampling_weight=3.0)}
    glow = mi.load_dict({"type": "area", "radiance": rgb(1, 1, 9)})
    return {**first, **in_the_dark(**between), "blue": ball(glow, centre=(0, 1.5, 1), scale=0.1)}


@item("textured light")
def _(_: Path) -> Description:
    glow = mi.load_dict({"type": "area", "radiance": noise(0, 12)})
    corners = np.array([(-1, 1, 3), (1, 1, 3), (1, -1, 3), (-1, -1, 3)])
    uv = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    mesh = to_mesh(corners, np.array([(0, 1, 2), (0, 2, 3)]), glow, uv=uv)
    return in_the_dark(mesh=mesh, rectangle=lamp((2, 0, 2), 0.5, radiance=noise(0, 9)))


@item("directional area light", integrator={"type": "ptracer", "max_depth": 4}, single=True)
def _(_: Path) -> Description:
    light = {"type": "directionalarea", "radiance": rgb(4, 4, 4)}
    return in_the_dark(light={"type": "rectangle", "to_world": facing_down(1, (0, 0, 3)), "emitter": light})


@item("lights of every shape")
def _(_: Path) -> Description:
    light = {"emitter": {"type": "area", "radiance": rgb(6, 6, 6)}}
    down = facing_down(0.4, (0, 1, 2))
    return in_the_dark(
        sphere={"type": "sphere", "radius": 0.2, "center": [-1.5, -1, 1], **light},
        disk={"type": "disk", "to_world": down, **light},
        cylinder={"type": "cylinder", "p0": [1, 1, 1], "p1": [2, 1, 1], "radius": 0.1, **light},
        cube={"type": "cube", "to_world": place(0.1, at=(0, -1, 1)), **light},
    )


@item("environment map")
def _(_: Path) -> Description:
    return in_the_dark(sky={"type": "envmap", "bitmap": noise(0, 2, side=16)["bitmap"]})


@item("sun and sky")
def _(_: Path) -> Description:
    return in_the_dark(sky={"type": "sunsky", "sun_direction": [0.3, -0.5, 1], "turbidity": 3.0, "to_world": place()})


@item("point light")
def _(_: Path) -> Description:
    return in_the_dark(light={"type": "point", "position": [1, -2, 3], "intensity": rgb(9, 9, 9)})


@item("spot light")
def _(_: Path) -> Description:
    aim = mi.ScalarTransform4f().look_at([1, -2, 4], [0, 0, 0], [0, 0, 1])
    return in_the_dark(light={"type": "spot", "to_world": aim, "intensity": rgb(30, 30, 30), "cutoff_angle": 25})


@item("directional light")
def _(_: Path) -> Description:
    return in_the_dark(light={"type": "directional", "direction": [0.3, 0.5, -1], "irradiance": rgb(2, 2, 2)})


@item("projector")
def _(_: Path) -> Description:
    aim = mi.ScalarTransform4f().look_at([0, -3, 4], [0, 0, 0], [0, 0, 1])
    projector = {"type": "projector", "to_world": aim, "irradiance": noise(0, 20), "fov": 50, "scale": 2.0}
    return in_the_dark(light=projector)


@item("furnace", integrator={"type": "path", "max_depth": 40, "rr_depth": 100})
def _(_: Path) -> Description:
    """Closed, grey, and glowing everywhere: every path adds up to radiance 1, but for what 40 bounces leave out."""
    glow = {"emitter": {"type": "area", "radiance": rgb(0.5, 0.5, 0.5)}}
    half = {"type": "diffuse", "reflectance": rgb(0.5, 0.5, 0.5)}
    walls = {"type": "cube", "flip_normals": True, "to_world": place(9), "bsdf": half, **glow}
    solid = ball(mi.load_dict(half), mi.load_dict(glow["emitter"]), scale=0.5)
    return {"walls": walls, "ball": solid}


# -- media ----------------------------------------------------------------------------------------------------------


def fog(density: float = 1.5) -> Description:
    return {"type": "homogeneous", "albedo": rgb(0.8, 0.7, 0.6), "sigma_t": density}


def smoke() -> Description:
    density = np.random.default_rng(2).uniform(0, 4, (4, 4, 4, 1)).astype(np.float32)
    volume = {"type": "gridvolume", "grid": mi.VolumeGrid(density), "to_world": place(2, at=(-1, -1, -1)), "raw": True}
    return {"type": "heterogeneous", "sigma_t": volume, "albedo": {"type": "constvolume", "value": rgb(0.9, 0.8, 0.7)}}


@item("fog in a box", integrator=VOLPATH)
def _(_: Path) -> Description:
    inner = {"type": "cube", "to_world": place(0.3, 40), "bsdf": grey(0.8)}
    return lit(box={"type": "cube", "interior": fog(), "bsdf": {"type": "null"}}, inner=inner)


@item("smoke", integrator=VOLPATH)
@item("smoke with multiple importance sampling", integrator=VOLPATHMIS)
@item("spectral smoke", integrator=VOLPATHMIS, variant="scalar_spectral")
def _(_: Path) -> Description:
    return lit(box={"type": "cube", "interior": smoke(), "bsdf": {"type": "null"}})


@item("milk behind glass", integrator=VOLPATH)
def _(_: Path) -> Description:
    glass = {"type": "cube", "to_world": place(0.8, 30), "interior": fog(4.0), "bsdf": {"type": "roughdielectric"}}
    return lit(glass=glass)


@item("a medium outside", integrator=VOLPATH)
def _(_: Path) -> Description:
    """The camera stands in it, and a ball keeps it out."""
    air = {"type": "homogeneous", "albedo": 0.7, "sigma_t": 0.1, "id": "air"}
    bounds = {"type": "sphere", "radius": 9, "interior": {"type": "ref", "id": "air"}, "bsdf": {"type": "null"}}
    mesh = sphere("ball", 7)
    inside = mi.load_dict({"type": "dielectric"})
    return {"air": air, **lit(ball=to_mesh(mesh.vertices * 0.4, mesh.faces, inside)), "bounds": bounds}


# -- instances ------------------------------------------------------------------------------------------------------


def instanced(*transforms: Any, **shapes: Any) -> Description:
    placed = {f"i{n}": {"type": "instance", "to_world": t, "g": {"type": "ref", "id": "group"}}
              for n, t in enumerate(transforms)}  # fmt: skip
    return lit(group={"type": "shapegroup", **shapes}, **placed)


def corner(folder: Path) -> Description:
    """Something without symmetry, with a texture."""
    checks = {"type": "twosided", "b": {"type": "diffuse", "reflectance": {"type": "checkerboard"}}}
    return write_obj(folder) | {"to_world": place([0.8, 0.5, 0.4], 20, (0.2, 0, 0)), "bsdf": checks}


@item("instances")
def _(folder: Path) -> Description:
    return instanced(place(0.7, 10, (-1, 0, 0)), place(1, 80, (1, 0, 0)), corner=corner(folder))


@item("mirrored instances")
def _(folder: Path) -> Description:
    cube = {"type": "cube", "to_world": place(0.2, 30, (0.7, 0, 0)), "bsdf": {"type": "plastic"}}
    return instanced(place([-1, 1, 1], 20), place([1, -1, -0.7], 50, (1, 0, 1)), corner=corner(folder), cube=cube)


@item("squeezed instances")
def _(folder: Path) -> Description:
    thin = place([1, 0.03, 2], 35) @ place(0.7, 40)
    return instanced(thin, place([2, 2, 0.01], 0, (0, 0, 1)), corner=corner(folder))


@item("instances of every shape")
def _(folder: Path) -> Description:
    tilted = mi.ScalarTransform4f().rotate([1, 1, 0], 60) @ mi.ScalarTransform4f().scale([1, 0.6, 0.8])
    return instanced(tilted, place(0.5, at=(1.5, 0, 0)), corner=corner(folder),
                     sphere={"type": "sphere", "radius": 0.3, "center": [-0.5, 0, 0.5]},
                     disk={"type": "disk", "to_world": place(0.5, at=(0, 0, -0.3)), "bsdf": grey()},
                     cylinder={"type": "cylinder", "radius": 0.2, "bsdf": grey()})  # fmt: skip


@item("several shape groups")
def _(folder: Path) -> Description:
    scene = instanced(place(0.6, 10, (-1, 0, 0)), corner=corner(folder))
    other = {"type": "shapegroup", "cube": {"type": "cube"}, "again": {"type": "ref", "id": "floor"}}
    placed = {"type": "instance", "to_world": place(0.3, 45, (1, 0, 0)), "g": {"type": "ref", "id": "other"}}
    return {**scene, "other": other, "placed": placed}


# -- how a scene is written -----------------------------------------------------------------------------------------


@item("a shape in two places")
def _(_: Path) -> Description:
    cube = {"type": "cube", "to_world": place(0.6, 20), "bsdf": grey()}
    return lit(first=cube, second={"type": "ref", "id": "first"})


@item("groups in the file")
def _(folder: Path) -> Description:
    cube = {"type": "cube", "to_world": place(0.4, 20, (-1, 0, 0))}
    return lit(one={"type": "bsptree", "cube": cube}, two={"type": "nativekdtree", "mesh": write_obj(folder)},
               three={"type": "bsptree", "tree": "normals"})  # fmt: skip


XML = """
<scene version="{version}">
    <integrator type="moment"><integrator type="path"><integer name="{max_depth}" value="4"/></integrator>
        <integer name="block_size" value="16"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="50"/>
        <transform name="{to_world}"><{look_at} origin="0, -6, 2" target="0, 0, 0" up="0, 0, 1"/></transform>
        <sampler type="independent"><integer name="{sample_count}" value="16"/></sampler>
        <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
            <rfilter type="box"/></film>
    </sensor>
    <emitter type="constant"/>
    <shape type="rectangle" id="floor"><transform name="{to_world}"><scale value="3"/></transform></shape>
    {content}
</scene>
"""
NEW = {"version": "3.0.0", "max_depth": "max_depth", "to_world": "to_world", "look_at": "lookat",
       "sample_count": "sample_count"}  # fmt: skip
OLD = {"version": "0.6.0", "max_depth": "maxDepth", "to_world": "toWorld", "look_at": "lookat",
       "sample_count": "sampleCount"}  # fmt: skip


def mesh_file(folder: Path) -> None:
    folder.mkdir()
    mi.load_dict({"type": "cube", "to_world": place(0.6, 30, (0, 0, 0.6))}).write_ply(str(folder / "mesh.ply"))


@item("relative paths")
def _(folder: Path) -> str:
    mesh_file(folder / "parts")
    return XML.format(**NEW, content='<shape type="ply"><string name="filename" value="parts/mesh.ply"/></shape>')


@item("an included file")
def _(folder: Path) -> str:
    mesh_file(folder / "parts")
    part = '<scene version="3.0.0"><shape type="ply"><string name="filename" value="mesh.ply"/></shape></scene>'
    (folder / "parts" / "part.xml").write_text(part)
    return XML.format(**NEW, content='<path value="parts"/><include filename="parts/part.xml"/>')


@item("defaults")
@item("parameters", params={"file": "parts/mesh.ply", "size": "0.5"})
def _(folder: Path) -> str:
    mesh_file(folder / "parts")
    mesh_file(folder / "other")
    defaults = '<default name="file" value="other/mesh.ply"/><default name="size" value="1"/>'
    shape = '<shape type="ply"><string name="filename" value="$file"/><transform name="to_world"><scale value="$size"/>'
    return XML.format(**NEW, content=f"{defaults}{shape}</transform></shape>")


@item("an old version")
def _(_: Path) -> str:
    shape = '<shape type="cube"><transform name="toWorld"><scale value="0.7"/><rotate z="1" angle="30"/></transform>'
    material = '<bsdf type="diffuse"><rgb name="reflectance" value="0.7, 0.3, 0.2"/></bsdf></shape>'
    return XML.format(**OLD, content=shape + material)


# -- sensors and integrators ----------------------------------------------------------------------------------------


@item("irradiance meter", sensor=1)
@item("several sensors", sensor=2)
def _(_: Path) -> Description:
    small, film = ({"type": "hdrfilm", "width": n, "height": n, "rfilter": {"type": "box"}} for n in (4, 24))
    meter = {"type": "irradiancemeter", "film": small, "sampler": {"type": "independent", "sample_count": 64}}
    above = mi.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]) @ mi.ScalarTransform4f().scale(3)
    sampler = {"type": "independent", "sample_count": 16}
    return lit(
        metered={"type": "rectangle", "to_world": place(0.8, at=(0, 0, 0.5)), "meter": meter, "bsdf": grey()},
        second={"type": "orthographic", "to_world": above, "film": film, "sampler": sampler},
    )


@item("a sensor far away", sensor=1)
@item("a batch of sensors", sensor=2)
@item("a single ray", sensor=3)
def _(_: Path) -> Description:
    def pixels(width: int, height: int, samples: int) -> Description:
        film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}}
        return {"film": film, "sampler": {"type": "independent", "sample_count": samples}}

    def view_from(*origin: float) -> Description:
        at = mi.ScalarTransform4f().look_at(origin, [0, 0, 0], [0, 0, 1])
        return {"type": "perspective", "to_world": at, **pixels(16, 16, 16)}

    return in_the_dark(
        sky={"type": "constant"},
        far={"type": "distant", "direction": [0.3, 0.2, -1], **pixels(1, 1, 256)},
        batch={"type": "batch", "left": view_from(-5, -4, 2), "right": view_from(5, -4, 3), **pixels(32, 16, 16)},
        ray={"type": "radiancemeter", "origin": [0, -4, 1], "direction": [0.1, 1, -0.3], **pixels(1, 1, 256)},
    )


@item("thin lens", camera={"type": "thinlens", "aperture_radius": 0.3, "focus_distance": 6.0})
def _(_: Path) -> Description:
    return in_the_dark(sky={"type": "constant"})


@item("light tracer", integrator={"type": "ptracer", "max_depth": 5}, single=True)
def _(_: Path) -> Description:
    return in_the_dark(lamp=lamp(radiance=rgb(9, 8, 7)))


@item("depth", integrator={"type": "depth"})
def _(_: Path) -> Description:
    return in_the_dark(sky={"type": "constant"})


AOVS = (
    "depth:depth,position:position,uv:uv,ng:geo_normal,ns:sh_normal,prim:prim_index,shape:shape_index,du:dp_du,a:albedo"
)


@item("arbitrary output variables", integrator={"type": "aov", "aovs": AOVS, "image": PATH}, single=True)
def _(folder: Path) -> Description:
    return in_the_dark(smooth={"type": "obj", "filename": smooth_obj(folder)}, sphere={"type": "sphere", "radius": 0.2},
                       lamp=lamp((0, 1, 2), radiance=rgb(1, 2, 3)), sky={"type": "constant"})  # fmt: skip


@item("polarized light", integrator={"type": "stokes", "i": PATH}, variant="scalar_spectral_polarized", single=True)
def _(_: Path) -> Description:
    metal = {"type": "roughconductor", "material": "Au"}
    glass = ball(mi.load_dict({"type": "dielectric"}), centre=(-1, 0, 0), scale=0.3)
    return lit(metal={"type": "cube", "to_world": place(0.6, 30, (1, 0, 0)), "bsdf": metal}, glass=glass)
