"""Load any Mitsuba scene under an accelerator: the namesakes of Mitsuba's `load_file`, `load_string`, `load_dict`.

Loading has two halves, so that building an accelerator can be timed alone: all of the scene's objects are made first
(`open_file` and its kin return a `LoadedScene`), and `LoadedScene.construct` then makes the scene itself from them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import drjit as dr
import mitsuba as mi

from .expected_rays import AUTO, with_expected_rays
from .messages import choices
from .scene_content import Content, notes
from .scene_objects import make_objects
from .spec import BRUTE_MAX_TRIANGLES, Spec, parse_spec
from .swap import INSTANCE, SHAPE_GROUP, Container, GroupOptions, Reference, dissolve, nodes_of, regroup

VARIANTS = ("scalar_rgb", "scalar_spectral", "scalar_spectral_polarized")

#: With one thread Mitsuba waits forever for another one, which is to unpack the EXR file that it reads or writes.
MIN_EXR_THREADS = 2

#: Changes a parsed scene before its objects are made.
Edit = Callable[["mi.parser.ParserState"], None]


class NotASceneError(ValueError):
    """A description of something else than a scene; the text is one sentence."""


@dataclass(frozen=True)
class LoadedScene:
    """A scene whose objects (meshes, materials, ...) exist, but not yet the scene with its accelerators.

    `containers` are the scene itself and its shape groups. `source` is kept because Mitsuba's parser state points into
    it.
    """

    state: mi.parser.ParserState
    config: mi.parser.ParserConfig
    containers: tuple[Container, ...]
    source: object

    @property
    def meshes(self) -> list[mi.Mesh]:
        """The triangle meshes that go under the accelerator of the scene itself, in scene order."""
        return self.containers[0].meshes

    @property
    def sensor(self) -> mi.Sensor | None:
        """The scene's first sensor, which is that of the picture."""
        return next((child for _, child in self.containers[0].children if isinstance(child, mi.Sensor)), None)

    @property
    def content(self) -> Content:
        """What is under the accelerators, and what is not."""
        groups = {container.node for container in self.containers[1:]}
        references = [child.index() for _, child in self.containers[0].children if isinstance(child, Reference)]
        return Content(
            triangles=sum(container.triangles for container in self.containers),
            meshes=sum(len(container.meshes) for container in self.containers),
            others=self._sum(container.others for container in self.containers),
            bounded=self._sum(container.bounded for container in self.containers),
            several=self._sum(container.several for container in self.containers),
            shape_groups=len(groups),
            instances=sum(node not in groups for node in references),
            grouped=sum(container.triangles for container in self.containers[1:]),
        )

    @staticmethod
    def _sum(counts: Iterable[Counter[str]]) -> dict[str, int]:
        return dict(sum(counts, Counter()))

    def regrouped(self, spec: Spec, options: GroupOptions | None = None) -> mi.parser.ParserState:
        """The scene description with its meshes under `spec`, ready for `construct`.

        Recorded are the rays of the scene itself, not those that instances turn into their own space. ValueError if
        `spec` is `brute` and the scene is too large for it.
        """
        triangles = self.content.triangles
        if spec.name == "brute" and triangles > BRUTE_MAX_TRIANGLES:
            raise ValueError(
                f"brute tests every triangle for every ray and takes at most {BRUTE_MAX_TRIANGLES:,} triangles, "
                f"but this scene has {triangles:,}"
            )
        options = options or GroupOptions()
        state = mi.parser.ParserState(self.state)
        for container in self.containers:
            regroup(state, container, spec, options)
            options = replace(options, count=options.count and not options.record, record=None, replay=None)
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
    spec: str = AUTO,
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
    spec: str = AUTO,
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
    spec: str = AUTO,
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
        f"{found}, but mitsuba_bsp works in {choices(VARIANTS)} only, which have no gradients: "
        "call mitsuba.set_variant() with one of them"
    )


def threads_for_exr() -> AbstractContextManager[None]:
    """Inside the context Mitsuba has the threads that it needs for EXR files, also on a machine with one processor."""
    return thread_count(max(dr.thread_count(), MIN_EXR_THREADS))


@contextmanager
def thread_count(count: int) -> Iterator[None]:
    """Inside the context Mitsuba has so many threads."""
    before = dr.thread_count()
    dr.set_thread_count(count)
    try:
        yield
    finally:
        dr.set_thread_count(before)


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
        raise NotASceneError(f'this describes a "{state.nodes[0].props.plugin_name()}", not a scene')
    mi.parser.transform_all(config, state)
    if edit is not None:
        edit(state)
    dissolve(state)
    groups, instances = nodes_of(state, SHAPE_GROUP), nodes_of(state, INSTANCE)
    with threads_for_exr():
        containers = make_objects(config, state, [0, *groups], {*groups, *instances})
    return LoadedScene(state, config, containers, source)


def _finish(loaded: LoadedScene, spec: Spec, cache: str | Path | None) -> mi.Scene:
    """Say what stays outside the accelerator, and construct the scene."""
    if spec.plugin:
        for note in notes(loaded.content, [spec.name]):
            mi.Log(mi.LogLevel.Warn, note)
    spec = with_expected_rays(spec, loaded.sensor, None)
    return loaded.construct(loaded.regrouped(spec, GroupOptions(cache=cache)))
