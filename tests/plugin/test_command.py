"""The stock command renders scenes that name our shapes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import mitsuba_bsp
from mitsuba_bsp import _core
from mitsuba_bsp.exr import read_exr

from .plugin_scenes import assert_same_up_to_rounding

SCENE = """
<scene version="3.0.0">
    <integrator type="path"><integer name="block_size" value="16"/></integrator>
    <sensor type="perspective">
        <transform name="to_world"><lookat origin="0, -6, 2" target="0, 0, 0" up="0, 0, 1"/></transform>
        <sampler type="independent"><integer name="sample_count" value="8"/></sampler>
        <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="32"/>
            <rfilter type="box"/></film>
    </sensor>
    <emitter type="constant"/>
    {open}
        <shape type="cube"><transform name="to_world"><rotate z="1" angle="30"/></transform></shape>
        <shape type="rectangle">
            <transform name="to_world"><scale value="4"/><translate z="-1"/></transform>
        </shape>
    {close}
</scene>
"""


#: With fewer threads Mitsuba's own command waits forever when it writes an EXR file.
THREADS = "3"


def stock_command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    words = ["-m", "scalar_rgb", "-t", THREADS, "-a", str(mitsuba_bsp.plugin_dir()), *arguments]
    command = [str(Path(sys.executable).parent / "mitsuba"), *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("group", ['type="bsptree"', 'type="nativekdtree"'])
def test_it_renders_a_hand_written_group(tmp_path: Path, group: str) -> None:
    (tmp_path / "plain.xml").write_text(SCENE.format(open="", close=""))
    (tmp_path / "grouped.xml").write_text(SCENE.format(open=f"<shape {group}>", close="</shape>"))
    images = []
    for name in ("plain", "grouped"):
        result = stock_command(tmp_path, "-o", f"{name}.exr", f"{name}.xml")
        assert result.returncode == 0, result.stdout + result.stderr
        planes = read_exr(tmp_path / f"{name}.exr")
        images.append(np.stack([planes[channel] for channel in "RGB"], axis=2))
    assert images[0].std() > 0.05
    assert_same_up_to_rounding(images[1], images[0])


def test_it_reports_a_mistake(tmp_path: Path) -> None:
    wrong = SCENE.format(open='<shape type="bsptree"><string name="tree" value="oak"/>', close="</shape>")
    (tmp_path / "wrong.xml").write_text(wrong)
    result = stock_command(tmp_path, "wrong.xml")
    assert result.returncode != 0
    said = result.stdout + result.stderr
    assert f"there is no tree 'oak': the trees are {', '.join(_core.trees())}" in said
