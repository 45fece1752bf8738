"""Everything that can be checked before a comparison starts, so that no typo surfaces after ten minutes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from .attempts import Attempts
from .comparison import Options, SceneInfo, context
from .jobs import JobError, run_job
from .messages import choices
from .records import check_context
from .scene_content import Content, left_out, notes
from .spec import BRUTE_MAX_TRIANGLES, Spec


def preflight(
    options: Options,
    attempts: Attempts,
    images: bool = True,
    meshes_to: str | None = None,
    only_meshes: bool = False,
) -> list[SceneInfo]:
    """Load every scene in a child process and check it against the options and what the folder already holds.

    The user is told what he should know, also about `images` if they matter. `meshes_to` is what triangle meshes are
    needed for, if they are; `only_meshes`: nothing but the scene's own will be in trees. ValueError, in one sentence,
    for anything wrong.
    """
    folder, note, machine = attempts.folder, attempts.note, attempts.scheduler.machine
    named = list(_named(options.scenes))
    folder.check_writable()
    scenes = [_inspect(options, name, path, note, only_meshes) for name, path in named]
    spec_full = {spec.text: spec.full for spec in options.specs}
    for scene in scenes:
        if images:
            _note_images(scene, note)
        _check_brute(options.specs, scene)
        if meshes_to and not scene.triangles:
            raise ValueError(f"{scene.path} has no triangle mesh, so there is nothing to {meshes_to}")
        if only_meshes and scene.triangles == scene.content.grouped:
            raise ValueError(
                f"all triangle meshes of {scene.path} are in shape groups, so there is nothing to {meshes_to}"
            )
        earlier = [*folder.records(), *folder.counted().values()]
        check_context(earlier, scene.name, spec_full, context(options, scene, machine))
    return scenes


def _named(paths: Sequence[Path]) -> Iterator[tuple[str, Path]]:
    """Each scene with its name; ValueError if a file is missing or two scenes have the same name."""
    seen: dict[str, Path] = {}
    for path in paths:
        if not path.is_file():
            raise ValueError(f"there is no scene file {path}")
        if path.stem in seen:
            raise ValueError(f"two scenes are called {path.stem} ({seen[path.stem]} and {path}): rename one of them")
        seen[path.stem] = path
    yield from seen.items()


def _inspect(options: Options, name: str, path: Path, note: Callable[[str], None], only_meshes: bool) -> SceneInfo:
    """Load a scene in a child process; ValueError if that fails."""
    try:
        result = run_job(options.job("inspect", path))
    except JobError as error:
        raise ValueError(str(error)) from None
    scene = SceneInfo(name, path, **{**result.values, "content": Content(**result.values["content"])})
    names = [spec.name for spec in options.specs]
    for text in [*(left_out(scene.content) if only_meshes else notes(scene.content, names)), *result.warnings]:
        note(f"{name}: {text}")
    return scene


def _note_images(scene: SceneInfo, note: Callable[[str], None]) -> None:
    if not scene.comparable:
        note(f"{scene.name}: its integrator has no fixed block size, so its images are not compared")
    elif not scene.box_filter:
        note(f"{scene.name}: timed with its own pixel filter, images compared with the box filter")


def _check_brute(specs: Sequence[Spec], scene: SceneInfo) -> None:
    if scene.triangles > BRUTE_MAX_TRIANGLES and any(spec.name == "brute" for spec in specs):
        raise ValueError(
            f"brute takes at most {BRUTE_MAX_TRIANGLES:,} triangles, but {scene.path} has {scene.triangles:,}: "
            f"leave brute out of --specs ({choices(s.text for s in specs)})"
        )
