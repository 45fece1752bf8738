"""Load any Mitsuba scene under an accelerator: the namesakes of Mitsuba's `load_file`, `load_string`, `load_dict`.

Loading has two halves, so that building an accelerator can be timed alone: all of the scene's objects are made first
(`open_file` and its kin return a `LoadedScene`), and `LoadedScene.construct` then makes the scene itself from them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mitsuba as mi

from .messages import choices
from .spec import Spec, parse_spec
from .swap import GroupOptions, dissolve, is_groupable, other_shapes, regroup

VARIANTS = ("scalar_rgb", "scalar_spectral", "scalar_spectral_polarized")

#: Changes a parsed scene before its objects are made.
Edit = Callable[["mi.parser.ParserState"], None]


@dataclass(frozen=True)
class LoadedScene:
    """A scene whose objects (meshes, materials, ...) exist, but not yet the scene with its accelerator.

    `source` is kept because Mitsuba's parser state points into it.
    """

    state: mi.parser.ParserState
    config: mi.parser.ParserConfig
    children: tuple[tuple[str, mi.Object], ...]
    source: object

    @property
    def meshes(self) -> list[mi.Mesh]:
        """The triangle meshes that go under the accelerator, in scene order."""
        return [child for _, child in self.children if is_groupable(child)]

    @property
    def triangles(self) -> int:
        """Number of triangles under the accelerator."""
        return sum(mesh.face_count() for mesh in self.meshes)

    @property
    def others(self) -> dict[str, int]:
        """Class names and counts of the shapes that stay outside the accelerator."""
        return dict(other_shapes([child for _, child in self.children]))

    def regrouped(self, spec: Spec, options: GroupOptions | None = None) -> mi.parser.ParserState:
        """The scene description with its meshes under `spec`, ready for `construct`."""
        state = mi.parser.ParserState(self.state)
        regroup(state, self.children, spec, options or GroupOptions())
        return state

    def construct(self, state: mi.parser.ParserState) -> mi.Scene:
        """Make the scene from loaded objects: building the accelerator is nearly all the work.

        KeyboardInterrupt if Ctrl-C ends the building of our trees.
        """
        try:
            return mi.parser.instantiate(self.config, state)
        except RuntimeError as error:
            if "building the tree was interrupted" in str(error):
                raise KeyboardInterrupt from None
            raise


def load_file(
    path: str | Path,
    spec: str,
    parallel: bool = True,
    optimize: bool = True,
    cache: str | Path | None = None,
    **kwargs: object,
) -> mi.Scene:
    """Load an XML scene with its triangle meshes under the accelerator `spec`.

    The keywords are those of `mitsuba.load_file`; `optimize` shares equal materials and the like, but never merges
    meshes. `cache` is a folder (created if it is missing) in which our trees are kept: what was built before is loaded
    from there. ValueError for a wrong spec, FileNotFoundError for a missing file, RuntimeError for what Mitsuba
    rejects.
    """
    checked = parse_spec(spec)
    return _finish(open_file(path, parallel, optimize, kwargs), checked, cache)


def load_string(
    value: str,
    spec: str,
    parallel: bool = True,
    optimize: bool = True,
    cache: str | Path | None = None,
    **kwargs: object,
) -> mi.Scene:
    """Like `load_file`, for a scene given as an XML string."""
    checked = parse_spec(spec)
    with _file_resolver(None):
        config = _config(parallel, optimize)
        loaded = _load(config, mi.parser.parse_string(config, value, **kwargs), value, None)
    return _finish(loaded, checked, cache)


def load_dict(
    dict: Mapping[str, object],
    spec: str,
    parallel: bool = True,
    optimize: bool = True,
    cache: str | Path | None = None,
) -> mi.Scene:
    """Like `load_file`, for a scene given as a dictionary, which may hold objects made before."""
    checked = parse_spec(spec)
    return _finish(open_dict(dict, parallel, optimize), checked, cache)


def open_dict(
    dict: Mapping[str, object], parallel: bool = True, optimize: bool = True, edit: Edit | None = None
) -> LoadedScene:
    """Make the objects of a scene given as a dictionary; `edit` may change the parsed scene first."""
    with _file_resolver(None):
        config = _config(parallel, optimize)
        return _load(config, mi.parser.parse_dict(config, dict), dict, edit)


def open_file(
    path: str | Path,
    parallel: bool = True,
    optimize: bool = True,
    params: Mapping[str, object] | None = None,
    edit: Edit | None = None,
) -> LoadedScene:
    """Make the objects of an XML scene; `edit` may change the parsed scene first."""
    with parsed_file(path, parallel, optimize, params) as (config, state):
        return _load(config, state, None, edit)


@contextmanager
def parsed_file(
    path: str | Path, parallel: bool = True, optimize: bool = True, params: Mapping[str, object] | None = None
) -> Iterator[tuple[mi.parser.ParserConfig, mi.parser.ParserState]]:
    """Parse an XML scene; inside the context its relative file names resolve as they do for Mitsuba."""
    if not Path(path).is_file():
        raise FileNotFoundError(f"there is no scene file {path}")
    with _file_resolver(Path(path).parent):
        config = _config(parallel, optimize)
        yield config, mi.parser.parse_file(config, str(path), **(params or {}))


def check_variant() -> str:
    """The active variant; RuntimeError if there is none or our plugins do not work in it."""
    variant = mi.variant()
    if variant in VARIANTS:
        return variant
    found = f'the active variant is "{variant}"' if variant else "no variant is set"
    raise RuntimeError(
        f"{found}, but mitsuba_bsp works in {choices(VARIANTS)} only: call mitsuba.set_variant() with one of them"
    )


def _config(parallel: bool, optimize: bool) -> mi.parser.ParserConfig:
    config = mi.parser.ParserConfig(check_variant())
    config.parallel = parallel
    config.merge_equivalent = optimize
    # Merged meshes come in an order that depends on memory addresses, and with them the emitters.
    config.merge_meshes = False
    return config


@contextmanager
def _file_resolver(folder: Path | None) -> Iterator[None]:
    """Look up files in `folder` first, and undo every change to the search path afterwards."""
    before = mi.file_resolver()
    inner = mi.FileResolver(before)
    if folder is not None:
        inner.prepend(str(folder))
    mi.set_file_resolver(inner)
    try:
        yield
    finally:
        mi.set_file_resolver(before)


def _load(
    config: mi.parser.ParserConfig, state: mi.parser.ParserState, source: object, edit: Edit | None
) -> LoadedScene:
    """Make all objects that the root of a parsed scene refers to."""
    if state.nodes[0].props.plugin_name() != "scene":
        raise ValueError(f'this describes a "{state.nodes[0].props.plugin_name()}", not a scene')
    mi.parser.transform_all(config, state)
    if edit is not None:
        edit(state)
    dissolve(state)
    root = mi.Properties(state.nodes[0].props)
    keys = [key for key in root if root.type(key) == mi.Properties.Type.ResolvedReference]
    holder = mi.Properties(_holder_plugin(config.variant))
    for index, key in enumerate(keys):
        holder[str(index)] = root[key]
    state.nodes[0].type, state.nodes[0].props = mi.ObjectType.Texture, holder
    mi.parser.instantiate(config, state)
    made = {key: _made(state.nodes[0].props, str(index)) for index, key in enumerate(keys)}
    state.nodes[0].type, state.nodes[0].props = mi.ObjectType.Scene, root
    return LoadedScene(state, config, tuple(_children(root, made)), source)


def _made(holder: mi.Properties, key: str) -> list[mi.Object]:
    """The object that a reference became, or the several it expanded into."""
    if key in holder:
        return [holder[key]]
    found: list[mi.Object] = []
    while f"{key}_{len(found)}" in holder:
        found.append(holder[f"{key}_{len(found)}"])
    return found


def _children(root: mi.Properties, made: Mapping[str, list[mi.Object]]) -> Iterator[tuple[str, mi.Object]]:
    """The scene's objects in the order in which Mitsuba itself would list them."""
    for key in root:
        if root.type(key) == mi.Properties.Type.Object:
            yield key, root[key]
        elif len(made.get(key, ())) == 1:
            yield key, made[key][0]
    # Mitsuba appends what an object expands into behind everything else.
    for key, objects in made.items():
        if len(objects) > 1:
            yield from ((f"{key}_{index}", child) for index, child in enumerate(objects))


def _finish(loaded: LoadedScene, spec: Spec, cache: str | Path | None) -> mi.Scene:
    """Say what stays outside the accelerator, and construct the scene."""
    if spec.plugin:
        for note in notes(loaded.others, len(loaded.meshes)):
            mi.Log(mi.LogLevel.Warn, note)
    return loaded.construct(loaded.regrouped(spec, GroupOptions(cache=cache)))


def notes(others: Mapping[str, int], meshes: int) -> list[str]:
    """What a user must know about a scene before reading anything into a comparison."""
    said = []
    if others:
        listed = ", ".join(f"{count} {kind}" for kind, count in others.items())
        said.append(f"only triangle meshes go under the accelerator, so these shapes stay with Embree: {listed}")
    if not meshes:
        said.append("the scene has no triangle mesh, so the accelerator stays empty")
    return said


@cache
def _holder_plugin(variant: str) -> str:
    """Register (once per variant) a plugin that accepts any objects and does nothing with them.

    As the root of a parsed scene it makes Mitsuba create all of the scene's objects, with its own checks and in
    parallel, and no scene.
    """

    class Holder(mi.Texture):
        def __init__(self, props: mi.Properties) -> None:
            super().__init__(props)
            props.objects()  # marks them as used

    name = "mitsuba_bsp_holder"
    mi.register_texture(name, Holder)
    return name
