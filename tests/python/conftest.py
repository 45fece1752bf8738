"""Small scenes and a way to run the command line, for the tests of the harness."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from fake_workers import Workers

from mitsuba_bsp import scheduling
from mitsuba_bsp.exr import read_exr, write_exr

#: Nine shapes in an order that a careless swap would change: lights between meshes, a sphere, ids here and there.
ROOM = """
<scene version="3.0.0">
    <default name="spp" value="4"/>
    <default name="res" value="32"/>
    <integrator type="path"><integer name="max_depth" value="4"/></integrator>
    <sensor type="perspective" id="camera">
        <float name="fov" value="60"/>
        <transform name="to_world"><lookat origin="0, -6, 1" target="0, 0, 0" up="0, 0, 1"/></transform>
        <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
        <film type="hdrfilm" id="film">
            <integer name="width" value="$res"/><integer name="height" value="$res"/>
            <rfilter type="box"/>
        </film>
    </sensor>
    <bsdf type="diffuse" id="grey"><rgb name="reflectance" value="0.5"/></bsdf>
    <shape type="rectangle" id="left-light">
        <transform name="to_world"><scale value="0.5"/><translate x="-1" z="2.5"/></transform>
        <emitter type="area"><rgb name="radiance" value="1, 8, 1"/></emitter>
    </shape>
    <shape type="cube" id="box">
        <transform name="to_world"><rotate z="1" angle="30"/><scale value="0.7"/></transform>
        <ref id="grey"/>
    </shape>
    <emitter type="point" id="lamp">
        <point name="position" value="0, -4, 3"/><rgb name="intensity" value="4"/>
    </emitter>
    <shape type="sphere" id="ball"><float name="radius" value="0.4"/><point name="center" value="1.5, 0, 0"/></shape>
    <shape type="cube">
        <transform name="to_world"><scale value="0.4"/><translate x="-1.5"/></transform><ref id="grey"/>
    </shape>
    <shape type="rectangle" id="right-light">
        <transform name="to_world"><scale value="0.5"/><rotate x="1" angle="180"/><translate x="1" z="2.5"/></transform>
        <emitter type="area"><rgb name="radiance" value="8, 1, 1"/></emitter>
    </shape>
    <shape type="rectangle" id="floor">
        <transform name="to_world"><scale value="4"/><translate z="-0.7"/></transform><ref id="grey"/>
    </shape>
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.1"/></emitter>
</scene>
"""

#: A PLY file whose index is far out of range, on which Mitsuba's loader dies.
WILD_PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
element face 1
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
3 0 1 900000000
"""

#: The accelerators in the `results`.
REPORTED = ["native", "embree", "kd", "normals"]

#: An integrator and a sensor, for scenes that need no more.
VIEW = '<integrator type="path"/><sensor type="perspective"/>'


def scene_xml(*shapes: str) -> str:
    """A scene with a view and these elements."""
    return f'<scene version="3.0.0">{VIEW}{"".join(shapes)}</scene>'


@pytest.fixture(autouse=True)
def _variant() -> None:
    mi.set_variant("scalar_rgb")


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """The room as a file."""
    path = tmp_path / "room.xml"
    path.write_text(ROOM)
    return path


@pytest.fixture
def workers(monkeypatch: pytest.MonkeyPatch) -> Workers:
    """Jobs of studies take no time."""
    found = Workers()
    monkeypatch.setattr(scheduling, "run_job", found.run)
    return found


@pytest.fixture
def wild(tmp_path: Path) -> Path:
    """A scene whose mesh file kills Mitsuba's loader."""
    (tmp_path / "wild.ply").write_text(WILD_PLY)
    shapes = '<shape type="cube"/><shape type="ply"><string name="filename" value="wild.ply"/></shape>'
    path = tmp_path / "wild.xml"
    path.write_text(scene_xml(shapes))
    return path


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `mitsuba-bsp` with these arguments in an empty folder."""

    def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
        words = [sys.executable, "-m", "mitsuba_bsp", *map(str, arguments)]
        environment = {**os.environ, "COLUMNS": "200"}
        return subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)

    return run


@pytest.fixture(scope="session")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small comparison, replayed rays, builds and heat maps of a room, and the page about all of them."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "room.xml").write_text(ROOM)

    def run(*words: str) -> None:
        found = subprocess.run(
            [sys.executable, "-m", "mitsuba_bsp", *words], cwd=folder, capture_output=True, text=True, check=False
        )
        assert found.returncode == 0, found.stderr

    run("compare", "room.xml", "--specs", *REPORTED, "--out", "all/compare")
    image = folder / "all" / "compare" / "images" / "room--native.exr"
    write_exr(image, np.stack([plane * 0.8 for plane in read_exr(image).values()], axis=2), [], {})  # seen in 8 bits
    run("bench", "rays", "room.xml", "--specs", *REPORTED, "--resolution", "16", "--out", "all/rays")
    run("heatmap", "room.xml", "--specs", "kd", "--resolution", "16", "--out", "all/heat")
    run("report", "all", "--title", "A & B")
    return folder / "all"


def error_line(result: subprocess.CompletedProcess[str]) -> str:
    """The one line in which a command reports its error."""
    lines = [line for line in result.stderr.splitlines() if "mitsuba-bsp: error: " in line]
    assert len(lines) == 1, result.stderr
    return lines[0].partition("error: ")[2]
