"""Ctrl-C while a tree is being built: KeyboardInterrupt within a second, and Python goes on."""

from __future__ import annotations

import signal
import subprocess
import sys
import textwrap
import time

import pytest

SET_UP = """
import numpy as np
import mitsuba as mi
import mitsuba_bsp

mi.set_variant("scalar_rgb")
rng = np.random.default_rng(1)
count = 300_000
corners = np.repeat(rng.random((count, 3)), 3, axis=0) + 0.02 * rng.random((3 * count, 3))
vertices, faces = corners.astype(np.float32), np.arange(3 * count).reshape(-1, 3)
mesh = mi.Mesh("mesh", len(vertices), len(faces))
params = mi.traverse(mesh)
params["vertex_positions"], params["faces"] = vertices.ravel(), faces.ravel()
params.update()
spec = "random:k=32,axes=none,exact_below=1000000"  # takes long
"""
IN_CORE = "mitsuba_bsp.Accelerator(vertices, faces, spec)"
IN_SCENE = """
mitsuba_bsp.load_dict({"type": "scene", "mesh": mesh}, spec)
"""
IN_SHAPE_GROUPS = """
groups = {f"g{i}": {"type": "shapegroup", "mesh": mesh} for i in range(6)}
mitsuba_bsp.load_dict({"type": "scene", **groups}, spec)
"""
RUN = """
print("ready", flush=True)
try:
    build()
except KeyboardInterrupt:
    print("interrupted", flush=True)
print(mitsuba_bsp.Accelerator(vertices[:300], faces[:100]).statistics()["triangles"], flush=True)
"""


@pytest.mark.parametrize("build", [IN_CORE, IN_SCENE, IN_SHAPE_GROUPS], ids=["core", "scene", "shape groups"])
def test_ctrl_c_ends_a_build(build: str) -> None:
    code = f"{SET_UP}\ndef build():\n{textwrap.indent(build, '    ')}\n{RUN}"
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        start = time.monotonic()
        rest = process.stdout.read()
        elapsed = time.monotonic() - start
    assert "interrupted\n100\n" in rest
    assert elapsed < 2  # one second to notice, and one for a small tree and the end of Python on a busy machine
    assert process.returncode == 0
