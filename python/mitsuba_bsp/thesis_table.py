"""Tables of counters beside those that were published, one a scene."""

from __future__ import annotations

from collections.abc import Sequence

from .comparison import Options, SceneInfo
from .records import Record, ResultsFolder
from .text_table import TextTable
from .thesis import BASELINE, PUBLISHED, PUBLISHED_TRIANGLES, Counters, per_ray, percent, published_scene

#: Points of percentage by which ours may differ from the published number.
TOLERANCE = 10

_OURS = ("spec", "tests/ray", "steps/ray", "I %", "T %")
_THEIRS = ("thesis I", "off", "within", "thesis T", "off", "within")

LEGEND = (
    f"Counters of closest-hit rays of one frame. I: triangle tests, T: interior steps, in percent of `{BASELINE}`; "
    "`thesis`: the same as published by J. Hoobergs (master's thesis, KU Leuven 2019), measured in pbrt-v3 with a "
    f"frame of its own; `off`: ours less the published, in points; `within`: whether by at most {TOLERANCE} points."
)


def make_thesis_tables(scenes: Sequence[SceneInfo], options: Options, folder: ResultsFolder) -> list[TextTable]:
    """Tables of every scene whose baseline is counted."""
    found = {(row["scene"], row["spec"]): row for row in folder.records()}
    return [
        _scene_table(scene, [found[scene.name, s.text] for s in options.specs if (scene.name, s.text) in found])
        for scene in scenes
        if (scene.name, BASELINE) in found
    ]


def _scene_table(scene: SceneInfo, rows: Sequence[Record]) -> TextTable:
    published = PUBLISHED.get(scene.name, {})
    baseline = next(row for row in rows if row["spec"] == BASELINE)
    width, height = scene.resolution
    return TextTable(
        f"{scene.name}, {scene.triangles:,} triangles{_other_scene(scene)}, {width}x{height}, {scene.spp} spp",
        (*_OURS, *_THEIRS) if published else _OURS,
        tuple(
            (
                row["spec"],
                *_ours(row, baseline),
                *(_theirs(row, baseline, published.get(row["spec"])) if published else ()),
            )
            for row in rows
        ),
    )


def _other_scene(scene: SceneInfo) -> str:
    """A warning where the thesis had another scene of this name."""
    published = published_scene(scene.name, scene.triangles)
    if published is None or published[1]:
        return ""
    return f" (not the same scene: the thesis's has {PUBLISHED_TRIANGLES[published[0]]},000)"


def _ours(row: Record, baseline: Record) -> tuple[str, ...]:
    each, share = per_ray(row), percent(row, baseline)
    return (f"{each.tests:.2f}", f"{each.steps:.2f}", f"{share.tests:.1f}", f"{share.steps:.1f}")


def _theirs(row: Record, baseline: Record, published: Counters | None) -> tuple[str, ...]:
    if published is None:
        return ("-",) * len(_THEIRS)
    ours = percent(row, baseline)
    return (*_beside(ours.tests, published.tests), *_beside(ours.steps, published.steps))


def _beside(ours: float, published: float) -> tuple[str, str, str]:
    off = ours - published
    return (f"{published:g}", f"{off:+.1f}", "yes" if abs(off) <= TOLERANCE else "NO")
