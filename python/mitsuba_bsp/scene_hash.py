"""A scene's identity: the content of its files and its parameters, whatever folder they are in."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import mitsuba as mi

from .loading import parsed_file

#: What the name of an XML file ends with that is kept as it was written, beside one that names files in other places.
AS_WRITTEN = ".as-written"


def scene_hash(path: str | Path, params: Mapping[str, str], written: Mapping[str, str] | None = None) -> str:
    """SHA-256 over the XML files, the files they name (meshes, textures, ...), spectra and the `-D` parameters.

    `written` are these parameters as they were written, if the scene now lies elsewhere.
    """
    digest = hashlib.sha256()
    with parsed_file(path, params=params) as (_, state):
        for part in _parts(state, params if written is None else written):
            digest.update(len(part).to_bytes(8, "little"))
            digest.update(part)
    return digest.hexdigest()


def referenced_file(props: mi.Properties, key: str) -> Path | None:
    """The file that a property names, if it names one; needs the scene's file resolver."""
    if "filename" not in key or props.type(key) != mi.Properties.Type.String:
        return None
    path = Path(str(mi.file_resolver().resolve(props[key])))
    return path if path.is_file() else None


def _parts(state: mi.parser.ParserState, params: Mapping[str, str]) -> Iterator[bytes]:
    yield from (f"{key}={params[key]}".encode() for key in sorted(params))
    yield from (_as_written(Path(str(file))).read_bytes() for file in state.files)
    for node in state.nodes:
        for key in node.props:
            if node.props.type(key) == mi.Properties.Type.Spectrum:
                spectrum = node.props[key]
                yield repr((spectrum.wavelengths, spectrum.values)).encode()
            elif (file := referenced_file(node.props, key)) is not None:
                yield file.read_bytes()


def _as_written(file: Path) -> Path:
    original = file.with_name(file.name + AS_WRITTEN)
    return original if original.is_file() else file
