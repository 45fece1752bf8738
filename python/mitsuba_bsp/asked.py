"""What was asked of a results folder: `asked.jsonl` has one object per command that measured into it.

With it, tables, figures and reports can be made again from the folder alone, at any time and on any machine.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TypeVar

from .comparison import Options, SceneInfo
from .records import Record, ResultsFolder, append, read_lines, rewrite
from .scene_content import Content
from .spec import parse_spec

AnyOptions = TypeVar("AnyOptions", bound=Options)

#: Fields of options that say where things are on this machine, or that are written in another way.
_ELSEWHERE = ("scenes", "specs", "out", "cache")


def begin(folder: ResultsFolder, options: Options, scenes: Sequence[SceneInfo], subfolder: str = "") -> None:
    """Make the folder ready for a command's records, and write down what is asked.

    What failed earlier in these scenes is tried again, so it is no failure until it fails again.
    """
    folder.prepare(subfolder)
    names = {scene.name for scene in scenes}
    rewrite(folder.failures_file, [row for row in read_lines(folder.failures_file) if row["scene"] not in names])
    line = {
        "command": options.command,
        "options": {f.name: getattr(options, f.name) for f in fields(options) if f.name not in _ELSEWHERE},
        "specs": [spec.text for spec in options.specs],
        "scenes": [{key: value for key, value in asdict(scene).items() if key != "path"} for scene in scenes],
    }
    line = json.loads(json.dumps(line))
    if line not in read_lines(folder.asked_file):
        append(folder.asked_file, line)


def asked(folder: ResultsFolder) -> list[Record]:
    """What was asked, in order; of a scene only what was asked last. Empty if nothing was written down."""
    found, seen = [], set[str]()
    for line in reversed(read_lines(folder.asked_file)):
        scenes = [scene for scene in line["scenes"] if scene["name"] not in seen]
        seen.update(scene["name"] for scene in scenes)
        if scenes:
            found.append({**line, "scenes": scenes})
    return found[::-1]


def options_of(line: Record, kind: type[AnyOptions], folder: ResultsFolder) -> AnyOptions:
    """The options of a command, without its scenes' paths."""
    found: dict[str, Any] = {key: _frozen(value) for key, value in line["options"].items()}
    specs = tuple(parse_spec(text) for text in line["specs"])
    return kind(scenes=(), specs=specs, out=folder.path, **found)


def scenes_of(line: Record) -> list[SceneInfo]:
    """The scenes; where their files are is not known any more."""
    return [
        SceneInfo(**{**scene, "path": Path(scene["name"]), "content": Content(**scene["content"])})
        for scene in line["scenes"]
    ]


def _frozen(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value
