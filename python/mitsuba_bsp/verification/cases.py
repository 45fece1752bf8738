"""Rays in a mesh kept as JSON with hexadecimal floats, so that they can be asked again, bit for bit."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .meshes import Mesh

#: The permanent cases, checked on every run.
FOLDER = Path(__file__).parent / "cases"


@dataclass(frozen=True)
class Case:
    """Rays (origins, directions, ends) in a mesh, and why they are worth asking.

    The expected answers are those of brute force; `hits`, where it is known, says which rays hit anything at all.
    """

    why: str
    mesh: Mesh
    origins: NDArray[np.float32]
    directions: NDArray[np.float32]
    maxt: NDArray[np.float32]
    hits: tuple[bool, ...] | None = None
    spec: str = ""  #: under which it failed
    seed: int | None = None
    through: str = ""  #: in which kind of Mitsuba scene it failed, see `wrapped.SCENES`; "" for the tree alone

    @property
    def rays(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        return self.origins, self.directions, self.maxt

    def describe(self, index: int) -> str:
        """One of the rays, in hexadecimal floats."""
        return f"{self.mesh.name}, {describe_ray(*(part[index] for part in self.rays))}"

    def to_json(self) -> dict[str, Any]:
        """What `case_from` reads."""
        content = {
            "why": self.why,
            "spec": self.spec,
            "seed": self.seed,
            "through": self.through,
            "mesh": self.mesh.name,
            "vertices": [_hex(row) for row in self.mesh.vertices],
            "faces": self.mesh.faces.tolist(),
            "rays": [
                {"o": _hex(o), "d": _hex(d), "maxt": float(end).hex()} for o, d, end in zip(*self.rays, strict=True)
            ],
            "hits": None if self.hits is None else list(self.hits),
        }
        return {key: value for key, value in content.items() if value not in (None, "")}


def case_from(content: Mapping[str, Any]) -> Case:
    """The case that `to_json` described; ValueError, TypeError or KeyError if it is none."""
    vertices = _floats(content["vertices"])
    faces = np.ascontiguousarray(content["faces"], np.int64).reshape(-1, 3)
    if len(faces) and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise ValueError("a face refers to a vertex that does not exist")
    rays = content["rays"]
    hits = content.get("hits")
    if hits is not None and len(hits) != len(rays):
        raise ValueError(f"there are {len(rays)} rays, but {len(hits)} hits are expected")
    return Case(
        why=str(content["why"]),
        mesh=Mesh(str(content["mesh"]), vertices, faces.astype(np.uint32)),
        origins=_floats([ray["o"] for ray in rays]),
        directions=_floats([ray["d"] for ray in rays]),
        maxt=np.array([float.fromhex(ray["maxt"]) for ray in rays], np.float32),
        hits=None if hits is None else tuple(map(bool, hits)),
        spec=str(content.get("spec", "")),
        seed=content.get("seed"),
        through=str(content.get("through", "")),
    )


def read_case(file: Path) -> Case:
    """ValueError, in one sentence, if there is no such case."""
    if not file.is_file():
        raise ValueError(f"there is no case file {file}")
    try:
        return case_from(json.loads(file.read_text(encoding="utf-8")))
    except KeyError as error:
        raise ValueError(f"{file} is not a case: it has no {error}") from None
    except (ValueError, TypeError, AttributeError) as error:
        raise ValueError(f"{file} is not a case: {error}") from None


def permanent_cases() -> dict[str, Case]:
    """Those that come with the library, by name."""
    return {file.stem: read_case(file) for file in sorted(FOLDER.glob("*.json"))}


def describe_ray(o: ArrayLike, d: ArrayLike, maxt: float) -> str:
    """In hexadecimal floats."""
    numbers = [float(x).hex() for x in (*np.asarray(o), *np.asarray(d), maxt)]
    return "ray o=({}, {}, {}) d=({}, {}, {}) maxt={}".format(*numbers)


def _hex(row: ArrayLike) -> list[str]:
    return [float(x).hex() for x in np.asarray(row)]


def _floats(rows: list[list[str]]) -> NDArray[np.float32]:
    return np.array([[float.fromhex(x) for x in row] for row in rows], np.float32).reshape(-1, 3)
