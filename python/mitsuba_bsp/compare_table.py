"""Tables of a comparison, three a scene: times, trees, and what happened to the image."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from .comparison import Options, SceneInfo
from .records import Record, ResultsFolder, of
from .spec import Spec
from .speeds import BASELINES, NONE, ratios, speed, spread
from .text_table import TextTable

_SPEEDS = tuple(f"x {baseline}" for baseline in BASELINES)
_TIMES = ("spec", "build s", "render s", "spread", *_SPEEDS)
_TREES = ("spec", "steps/ray", "tests/ray", "nodes", "refs", "MB")
_IMAGES = ("spec", "our trees", "against native", "against embree")

LEGEND = (
    "Times are medians; `loaded`: the tree was not built in that time but found in the cache; the spread is half the "
    "range of all repeats; `x native` is native's render time over this one, the median of the repeats with its 95 % "
    "bootstrap interval; `x embree` likewise. "
    "Steps are interior nodes visited, tests are triangles tested, refs are references of leaves to triangles. "
    "An image is identical to another or differs: the share of pixels off by more than 0.1 %, the largest difference, "
    "and whether the mean signed difference looks like rounding or like bias (paired test, probability p)."
)


def make_tables(scenes: Sequence[SceneInfo], options: Options, folder: ResultsFolder) -> list[TextTable]:
    """Tables of what is recorded so far, which may be less than everything if the run was interrupted."""
    records = folder.records()
    return [table for scene in scenes for table in _scene_tables(scene, options.specs, records)]


def _scene_tables(scene: SceneInfo, specs: Sequence[Spec], records: Sequence[Record]) -> list[TextTable]:
    rows = of(records, scene=scene.name)
    runs = {spec.text: of(rows, spec=spec.text) for spec in specs}
    width, height = scene.resolution
    return [
        TextTable(
            f"{scene.name}: {scene.triangles:,} triangles, {width}x{height}, {scene.spp} spp",
            _TIMES,
            tuple((spec.text, *_time_cells(runs[spec.text], rows)) for spec in specs),
        ),
        TextTable(f"{scene.name}: trees", _TREES, tuple((spec.text, *_tree_cells(runs[spec.text])) for spec in specs)),
        TextTable(
            f"{scene.name}: images",
            _IMAGES,
            tuple((spec.text, *_image_cells(scene, spec, runs[spec.text])) for spec in specs),
            words=True,
        ),
    ]


def _time_cells(runs: Sequence[Record], rows: Sequence[Record]) -> tuple[str, ...]:
    if not runs:
        return (NONE,) * (len(_TIMES) - 1)
    seconds = [run["render_s"] for run in runs]
    loaded = any(run["statistics"].get("loaded") for run in runs)
    return (
        f"{median(run['build_s'] for run in runs):.3f}{' loaded' * loaded}",
        f"{median(seconds):.3f}",
        spread(seconds),
        *(speed(ratios(runs, rows, baseline, "render_s")) for baseline in BASELINES),
    )


def _tree_cells(runs: Sequence[Record]) -> tuple[str, ...]:
    if not runs:
        return (NONE,) * (len(_TREES) - 1)
    stats = runs[0]["statistics"]
    return (
        _number(runs[0]["interior_steps_per_ray"], ".1f"),
        _number(runs[0]["triangle_tests_per_ray"], ".1f"),
        _thousands(stats.get("nodes")),
        _thousands(stats.get("references")),
        _number(stats["bytes"] / 1e6 if "bytes" in stats else None, ".1f"),
    )


def _image_cells(scene: SceneInfo, spec: Spec, runs: Sequence[Record]) -> tuple[str, ...]:
    if not runs or not scene.comparable:
        return ("not comparable" if runs else NONE,) * (len(_IMAGES) - 1)
    found = runs[0]["image_difference"]
    trees = "(the reference)" if spec.is_tree and "trees" not in found else _difference(found.get("trees"))
    if any(run["image_repeats"] is False for run in runs):
        trees += ", NOT REPEATABLE"
    if found.get("trees", {}).get("verdict") == "identical":
        return (
            trees,
            *(f"as {found['trees']['reference']}" if name in found else NONE for name in ("native", "embree")),
        )
    return (trees, _difference(found.get("native")), _difference(found.get("embree")))


def _difference(found: Mapping[str, Any] | None) -> str:
    """One image comparison in a cell."""
    if not found:
        return NONE
    if found["verdict"] == "identical":
        return f"identical to {found['reference']}"
    if found["verdict"] == "not comparable":
        return "not comparable"
    verdict = "BIAS" if found["verdict"] == "bias" else "rounding"
    bad = f", {found['non_finite_pixels']} not finite" if found["non_finite_pixels"] else ""
    return f"{found['share']:.2%} off, largest {found['largest']:.2g}, {verdict} (p {found['p_value']:.2g}){bad}"


def _number(value: float | None, form: str) -> str:
    return NONE if value is None else format(value, form)


def _thousands(count: int | None) -> str:
    return NONE if count is None else f"{count / 1e3:.1f}k" if count < 1e6 else f"{count / 1e6:.2f}M"
