"""Tables of a comparison, one pair a scene: times and trees, and what happened to the image."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

import rich.box
from rich.console import Console
from rich.table import Table
from tabulate import tabulate

from .comparison import Failure, SceneInfo
from .differences import Differences
from .records import Record, ResultsFolder
from .spec import Spec
from .speeds import NONE, spread

_TIMES = ("spec", "build s", "render s", "spread", "x native", "steps/ray", "tests/ray", "nodes", "refs", "MB")
_IMAGES = ("spec", "our trees", "against native", "against embree")

_LEGEND = (
    "Times are medians; `loaded`: the tree was not built in that time but found in the cache; the spread is half the "
    "range of all repeats; `x native` is native's render time over this one. "
    "Steps are interior nodes visited, tests are triangles tested, refs are references of leaves to triangles. "
    "An image is identical to another or differs: the share of pixels off by more than 0.1 %, the largest difference, "
    "and whether the mean signed difference looks like rounding or like bias (paired test, probability p)."
)


@dataclass(frozen=True)
class SceneTables:
    """The finished text of one scene's tables: rows of cells."""

    title: str
    times: tuple[tuple[str, ...], ...]
    images: tuple[tuple[str, ...], ...]
    failures: tuple[str, ...]


def make_tables(
    scenes: Sequence[SceneInfo], specs: Sequence[Spec], folder: ResultsFolder, failures: Sequence[Failure]
) -> list[SceneTables]:
    """Tables of what is recorded so far, which may be less than everything if the run was interrupted."""
    records, differences = folder.records(), Differences(folder, specs)
    return [_scene_tables(scene, specs, records, differences, failures) for scene in scenes]


def print_tables(console: Console, tables: Sequence[SceneTables]) -> None:
    """Show the tables on a terminal."""
    for scene in tables:
        for head, rows in ((_TIMES, scene.times), (_IMAGES, scene.images)):
            title = scene.title if head is _TIMES else None
            table = Table(*head, title=title, title_justify="left", box=rich.box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
            for column in table.columns[1:] if head is _TIMES else ():
                column.justify, column.no_wrap = "right", True
            for row in rows:
                table.add_row(*row)
            console.print(table)
        for failure in scene.failures:
            console.print(f"failed: {failure}", style="red", markup=False)


def markdown(tables: Sequence[SceneTables], machine: Mapping[str, str]) -> str:
    """The same tables as a Markdown file."""
    return "\n\n".join(_markdown_parts(tables, machine)) + "\n"


def _markdown_parts(tables: Sequence[SceneTables], machine: Mapping[str, str]) -> Iterator[str]:
    yield "# Comparison"
    yield ", ".join(f"{key} {value}" for key, value in machine.items())
    yield _LEGEND
    for scene in tables:
        yield f"## {scene.title}"
        for head, rows in ((_TIMES, scene.times), (_IMAGES, scene.images)):
            yield tabulate(rows, head, tablefmt="github", disable_numparse=True)
        yield from (f"Failed: {failure}" for failure in scene.failures)


def _scene_tables(
    scene: SceneInfo,
    specs: Sequence[Spec],
    records: Sequence[Record],
    differences: Differences,
    failures: Sequence[Failure],
) -> SceneTables:
    runs = {spec.text: [r for r in records if r["scene"] == scene.name and r["spec"] == spec.text] for spec in specs}
    native = next((runs[spec.text] for spec in specs if spec.name == "native" and runs[spec.text]), None)
    width, height = scene.resolution
    return SceneTables(
        title=f"{scene.name}: {scene.triangles:,} triangles, {width}x{height}, {scene.spp} spp",
        times=tuple((spec.text, *_time_cells(runs[spec.text], native)) for spec in specs),
        images=tuple((spec.text, *_image_cells(scene, spec, runs[spec.text], differences)) for spec in specs),
        failures=tuple(dict.fromkeys(f"{f.spec}: {f.message}" for f in failures if f.scene == scene.name)),
    )


def _time_cells(runs: Sequence[Record], native: Sequence[Record] | None) -> tuple[str, ...]:
    if not runs:
        return (NONE,) * (len(_TIMES) - 1)
    seconds = [run["render_s"] for run in runs]
    speed = median(run["render_s"] for run in native) / median(seconds) if native else None
    stats = runs[0]["statistics"]
    loaded = any(run["statistics"].get("loaded") for run in runs)
    return (
        f"{median(run['build_s'] for run in runs):.3f}{' loaded' * loaded}",
        f"{median(seconds):.3f}",
        spread(seconds),
        _number(speed, ".2f"),
        _number(runs[0]["interior_steps_per_ray"], ".1f"),
        _number(runs[0]["triangle_tests_per_ray"], ".1f"),
        _thousands(stats.get("nodes")),
        _thousands(stats.get("references")),
        _number(stats["bytes"] / 1e6 if "bytes" in stats else None, ".1f"),
    )


def _image_cells(scene: SceneInfo, spec: Spec, runs: Sequence[Record], differences: Differences) -> tuple[str, ...]:
    if not runs or not scene.comparable:
        return ("not comparable" if runs else NONE,) * (len(_IMAGES) - 1)
    found = differences.of(scene.name, spec)
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
