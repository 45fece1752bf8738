"""PLY and OBJ files with damage, and the process that loads them: `python -m mitsuba_bsp.verification.damaged_files`.

It prints a JSON line when it begins to load, to build and to trace a file, and one with what it found.
"""

from __future__ import annotations

import json
import struct
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..scalar import mitsuba
from ..spec import parse_spec
from .checks_fuzz import aimed_rays
from .meshes import Mesh, soup
from .oracle import brute_force
from .rays import Generator
from .wrapped import answers, group, wrong_answers

KINDS = ("ply-ascii", "ply-binary", "obj")
TRIANGLES = 40
SPECS = ("kd", "normals")

_NUMBERS = (b"nan", b"inf", b"-1", b"1e39", b"4294967295", b"2147483648", b"99999999999", b"", b"0x10", b"1e-45", b"x")


@cache
def intact(kind: str) -> bytes:
    """A whole file of 40 triangles."""
    mesh = soup("soup", TRIANGLES)
    if kind == "obj":
        lines = [*(f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices)]
        lines += ["f {} {} {}".format(*(face + 1)) for face in mesh.faces]
        return "\n".join(lines).encode() + b"\n"
    form = "ascii" if kind == "ply-ascii" else "binary_little_endian"
    head = (
        f"ply\nformat {form} 1.0\nelement vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if kind == "ply-ascii":
        rows = [*(" ".join(f"{x:.9g}" for x in vertex) for vertex in mesh.vertices)]
        rows += [f"3 {a} {b} {c}" for a, b, c in mesh.faces]
        return head + "\n".join(rows).encode() + b"\n"
    faces = b"".join(struct.pack("<Biii", 3, *map(int, face)) for face in mesh.faces)
    return head + mesh.vertices.astype("<f4").tobytes() + faces


def damaged(data: bytes, rng: Generator) -> bytes:
    """One to three injuries, half of them small enough that the file may still be read as one."""
    for _ in range(int(rng.integers(1, 4))):
        if len(data) < 2:
            break
        injure = _other_byte if rng.random() < 0.5 else _INJURIES[int(rng.integers(len(_INJURIES)))]
        data = injure(data, rng)
    return data


def _part(data: bytes, rng: Generator) -> tuple[int, int]:
    start = int(rng.integers(len(data)))
    return start, min(len(data), start + int(rng.integers(1, 40)))


def _other_byte(data: bytes, rng: Generator) -> bytes:
    """A digit becomes another one; in a file without digits there, a bit is flipped."""
    changed = bytearray(data)
    place = int(rng.integers(len(data)))
    if chr(changed[place]).isdecimal():
        changed[place] = ord("0") + int(rng.integers(10))
    else:
        changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _random_bytes(data: bytes, rng: Generator) -> bytes:
    start, end = _part(data, rng)
    return data[:start] + rng.bytes(end - start) + data[end:]


def _lost(data: bytes, rng: Generator) -> bytes:
    start, end = _part(data, rng)
    return data[:start] + data[end:]


def _doubled(data: bytes, rng: Generator) -> bytes:
    start, end = _part(data, rng)
    return data[:end] + data[start:]


def _moved(data: bytes, rng: Generator) -> bytes:
    start, end = _part(data, rng)
    place = int(rng.integers(len(data)))
    return data[:place] + data[start:end] + data[place:]


def _cut_short(data: bytes, rng: Generator) -> bytes:
    return data[: int(rng.integers(len(data) // 2, len(data)))]


def _other_number(data: bytes, rng: Generator) -> bytes:
    """One word of the text, or of what looks like text, replaced."""
    words = data.split(b" ")
    place = int(rng.integers(len(words)))
    words[place] = _NUMBERS[int(rng.integers(len(_NUMBERS)))]
    return b" ".join(words)


_INJURIES = (_random_bytes, _other_number, _lost, _doubled, _moved, _cut_short)


def _say(**found: object) -> None:
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()


def _look_at(file: Path, seed: int, count: int) -> dict[str, Any]:
    """First without vertex normals: to compute them Mitsuba's loader reads and writes where indices point, also where
    they are out of range, and then nothing that happens later means anything. Such a file is not loaded again."""
    mi = mitsuba()
    _say(stage="loading")
    try:
        shape = mi.load_dict({"type": file.suffix[1:], "filename": str(file), "face_normals": True})
        vertices, faces = _arrays(shape)
        if len(faces) and faces.max() >= len(vertices):
            _say(stage="refusing")
            return {"file": file.name, "loaded": False, "wrong": int(not _is_refused(shape))}
        shape = mi.load_dict({"type": file.suffix[1:], "filename": str(file)})
        vertices, faces = _arrays(shape)
    except RuntimeError:
        return {"file": file.name, "loaded": False, "wrong": 0}
    if not len(faces):
        return {"file": file.name, "loaded": False, "wrong": 0}
    mesh = Mesh(file.name, np.ascontiguousarray(vertices), np.ascontiguousarray(faces))
    o, d = aimed_rays(mesh, count, np.random.default_rng([seed, *file.name.encode()]))
    expected = brute_force(mesh).closest(o, d, np.full(len(o), np.inf, np.float32))
    wrong = 0
    for spec in SPECS:
        _say(stage=f"building {spec}")
        try:
            scene = mi.load_dict({"type": "scene", "group": group(parse_spec(spec), {"mesh": shape})})
        except RuntimeError as error:
            if "beyond" not in str(error):  # of what Embree would drop for its size
                raise
            return {"file": file.name, "loaded": True, "wrong": 0, "rays": 0}
        _say(stage=f"tracing {spec}")
        wrong += int(wrong_answers(answers(scene, (o, d)), expected).sum())
    return {"file": file.name, "loaded": True, "wrong": wrong, "rays": len(o) * len(SPECS)}


def _arrays(shape: Any) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
    vertices = np.array(shape.vertex_positions_buffer(), np.float32).reshape(-1, 3)
    return vertices, np.array(shape.faces_buffer(), np.uint32).reshape(-1, 3)


def _is_refused(shape: Any) -> bool:
    """Whether our plugin says that an index of the mesh, which Mitsuba took, is out of range."""
    try:
        mitsuba().load_dict({"type": "scene", "group": group(parse_spec(SPECS[0]), {"mesh": shape})})
    except RuntimeError as error:
        return "vertices" in str(error)
    return False


def main() -> None:
    """Look at the files named on the command line, behind a seed and a number of rays."""
    seed, count, *files = sys.argv[1:]
    mitsuba().set_log_level(mitsuba().LogLevel.Error)
    for file in files:
        found = _look_at(Path(file), int(seed), int(count))
        _say(**found)


if __name__ == "__main__":
    main()
