"""A scene as one file, to be sent to another machine: its XML files and everything that they name.

Files keep their places relative to one another, and what is named by an absolute path is named relatively instead, so
that the scene loads in any folder. Its XML files as they were written go along, for the scene's hash.
"""

from __future__ import annotations

import io
import os
import re
import tarfile
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape, unescape

import mitsuba as mi

from .jobs import Job
from .loading import parsed_file
from .scene_hash import AS_WRITTEN, scene_hash

#: A value in an XML file that is an absolute path, what may name a file, a folder, and the default of a parameter.
_ABSOLUTE = re.compile(rb"""(\b(?:value|filename)\s*=\s*)(["'])(/[^"'<]+)\2""")
_NAME = re.compile(r"""\bfilename\s*=\s*["']([^"']+)["']""")
_FOLDER = re.compile(r"""<path\b[^>]*\bvalue\s*=\s*["']([^"']+)["']""")
_DEFAULT = re.compile(r"""<default\b[^>]*?\bname\s*=\s*["']([^"']+)["'][^>]*?\bvalue\s*=\s*["']([^"']*)["']""")


def pack(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Write the scene as a tar archive to `job.arrays`.

    `scene` is the place of its main file in there, `params` are the parameters that it is to be loaded with.
    """
    stage(f"packing {job.scene}")
    scene = Path(job.scene).absolute()
    with parsed_file(scene, params=job.params) as (_, state):
        written = {_plain(Path(str(file))): Path(str(file)).read_bytes() for file in state.files}
        texts = [content.decode(errors="replace") for content in written.values()]
        known = {key: unescape(value) for text in texts for key, value in _DEFAULT.findall(text)} | dict(job.params)
        named = [*_named_by_shapes(state), *(_filled(name, known) for text in texts for name in _NAME.findall(text))]
        files = {_place(scene.parent, name): file for name in named if (file := _resolved(name))}
        folders = [_filled(name, known) for text in texts for name in _FOLDER.findall(text)]
    contents = {place: file.read_bytes() for place, file in files.items()}
    for place in {*written, *(place for place, file in files.items() if _plain(file) in written)}:
        own = written[_plain(files.get(place, place))]
        contents[place] = _ABSOLUTE.sub(lambda found: _relatively(found, scene.parent), own)
        contents[place.with_name(place.name + AS_WRITTEN)] = own
    passed = {folder for name in (*named, *folders) for folder in _passed(scene.parent, name)}
    _write(Path(job.arrays), contents, passed | {_place(scene.parent, name) for name in folders})
    params = {key: _relative(value, scene.parent) for key, value in job.params.items()}
    digest = scene_hash(scene, job.params)
    return {"scene": _inside(_plain(scene)), "params": params, "scene_hash": digest}


def unpack(archive: bytes, folder: Path) -> None:
    """Make `folder` from an archive, all or nothing; one that exists is left as it is."""
    if folder.exists():
        return
    folder.parent.mkdir(parents=True, exist_ok=True)
    unfinished = Path(tempfile.mkdtemp(dir=folder.parent))
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        tar.extractall(unfinished, filter="data")
    unfinished.rename(folder)


def hash_scene(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """The hash of a scene that was unpacked; `choices` are its parameters as they were."""
    stage(f"loading {job.scene}")
    return {"scene_hash": scene_hash(job.scene, job.params, job.choices)}


def moved(job: Job, root: Path, scene: str, params: Mapping[str, str]) -> tuple[Job, dict[str, Path]]:
    """The job for a scene that was unpacked in `root`, and where the files that it reads or writes are there.

    What a job writes is in folders of the same names beside each other, as some jobs find files of others there. Trees
    that are kept are those of the machine.
    """
    files = {path: root / "made" / Path(path).parent.name / Path(path).name for path in (*job.reads, *job.writes)}
    own = {key: str(files[path]) for key in ("image", "arrays", "streams") if (path := getattr(job, key))}
    cache = str(root.parent / "trees") if job.cache else ""
    return replace(job, scene=str(root / scene), params=params, cache=cache, **own), files


def _named_by_shapes(state: mi.parser.ParserState) -> Iterator[str]:
    """File names among the properties of shapes, textures, ..., as they are after parsing."""
    for node in state.nodes:
        for key in node.props:
            if "filename" in key and node.props.type(key) == mi.Properties.Type.String:
                yield str(node.props[key])


def _resolved(name: str) -> Path | None:
    """The file of this name, if there is one; needs the scene's file resolver."""
    path = Path(str(mi.file_resolver().resolve(name)))
    return path if path.is_file() else None


def _filled(text: str, known: Mapping[str, str]) -> str:
    """A value with its parameters filled in."""
    text = unescape(text)
    for key in sorted(known, key=len, reverse=True):
        text = text.replace(f"${key}", known[key])
    return text


def _plain(path: Path) -> Path:
    return Path(os.path.normpath(path.absolute()))


def _place(folder: Path, name: str) -> Path:
    """Where a file of this name is looked for first, as seen from the scene's folder."""
    return _plain(folder / name)


def _passed(folder: Path, name: str) -> list[Path]:
    """The folders on the way to a name, which must be there for the system to go up from them."""
    return [_plain(part) for part in (folder / name).parents]


def _relatively(found: re.Match[bytes], folder: Path) -> bytes:
    start, quote, value = found.groups()
    return start + quote + escape(_relative(unescape(value.decode()), folder)).encode() + quote


def _relative(value: str, folder: Path) -> str:
    """The path of something that exists, or that has a parameter in it, as seen from a folder; others as they are."""
    is_path = value.startswith("/") and ("$" in value or Path(value).exists())
    return os.path.relpath(value, folder) if is_path else value


def _inside(place: Path) -> str:
    return str(place).lstrip("/")


def _write(file: Path, contents: Mapping[Path, bytes], folders: set[Path]) -> None:
    """An archive that depends on nothing else."""
    with tarfile.open(file, "w") as tar:
        for folder in sorted(folders - {Path("/")}):
            entry = tarfile.TarInfo(_inside(folder))
            entry.type, entry.mode = tarfile.DIRTYPE, 0o755
            tar.addfile(entry)
        for place, content in sorted(contents.items()):
            entry = tarfile.TarInfo(_inside(place))
            entry.size = len(content)
            tar.addfile(entry, io.BytesIO(content))
