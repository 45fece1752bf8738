"""Tables of replayed rays: one a scene and stream, and the geometric means over all scenes."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean, median

from .comparison import SceneInfo
from .records import Record, ResultsFolder, of
from .replays import RayOptions, newest_replay
from .speeds import BASELINES, NONE, mean_speed, ratios, speed, spread
from .streams import KINDS
from .text_table import TextTable

_TIME = "ns_per_ray"

#: Of camera and bounce rays together.
_CLOSEST = "closest-hit"

_HEAD = (
    "spec",
    "ns/ray",
    "spread",
    "Mrays/s",
    "steps/ray",
    "tests/ray",
    "misses/ray",
    "x native",
    "x embree",
    "differ",
)

LEGEND = (
    "Times are medians of the processor time of one thread; the spread is half the range of all repetitions. Steps are "
    "interior nodes visited, tests are triangles tested, misses are cache misses as the processor's own event counts "
    "them, where users may: of the last level on Intel, of the second on AMD. `x native` is native's time over this "
    "one, the median of the repetitions with its 95 % bootstrap interval; `x embree` likewise. `differ` counts the "
    "rays that hit where the first of our trees misses or the other way round, or hit at a t that differs by more than "
    "1e-4 of it. Closest-hit rays are camera and bounce rays as the frame has them. Geometric means have the interval "
    "that repeating all scenes anew would give."
)

NO_MISSES = "cache misses are not counted: this machine does not let its users count them"


def make_ray_tables(scenes: Sequence[SceneInfo], options: RayOptions, folder: ResultsFolder) -> list[TextTable]:
    """Tables of every finished scene."""
    replays = {scene.name: newest_replay(folder, options, scene) for scene in scenes}
    tables = [
        _stream_table(scene, options, rows)
        for scene in scenes
        for kind in KINDS
        if (rows := of(replays[scene.name], stream=kind))
    ]
    finished = [rows for rows in replays.values() if rows]
    asked = {spec.name for spec in options.specs}
    means = [_means_table(options, finished, baseline) for baseline in BASELINES if baseline in asked]
    return [*tables, *means] if len(finished) > 1 else tables


def _stream_table(scene: SceneInfo, options: RayOptions, rows: Sequence[Record]) -> TextTable:
    first = rows[0]
    sample = f" (of {first['recorded_rays']:,})" if first["recorded_rays"] > first["rays"] else ""
    digest = first["stream_sha256"][:12]
    triangles = first.get("triangles", scene.triangles)  # older records do not say what was replayed
    return TextTable(
        f"{scene.name}, {triangles:,} triangles: {first['rays']:,}{sample} {first['stream']} rays, {digest}",
        _HEAD,
        tuple((spec.text, *_cells(of(rows, spec=spec.text), rows)) for spec in options.specs),
    )


def _cells(runs: Sequence[Record], rows: Sequence[Record]) -> tuple[str, ...]:
    times = [run[_TIME] for run in runs]
    counters, rays = runs[0]["counters"], runs[0]["rays"]
    steps = counters["axis_steps"] + counters["oblique_steps"] if counters else None
    misses = [run["cache_misses"] for run in runs]
    return (
        f"{median(times):.1f}",
        spread(times),
        f"{1e3 / median(times):.2f}",
        _per_ray(steps, rays, ".1f"),
        _per_ray(counters.get("triangle_tests"), rays, ".1f"),
        _per_ray(None if None in misses else median(misses), rays, ".2f"),
        *(speed(ratios(runs, rows, name, _TIME)) for name in BASELINES),
        str(sum(runs[0]["differences"].values())),
    )


def _per_ray(total: float | None, rays: int, form: str) -> str:
    return NONE if total is None else format(total / rays, form)


def _means_table(options: RayOptions, replays: Sequence[Sequence[Record]], baseline: str) -> TextTable:
    """Speed against a baseline, geometric means over scenes, one column a stream and one of all closest-hit rays."""

    def mean(spec: str, kind: str) -> str:
        found = [closest_hits(rows) if kind == _CLOSEST else of(rows, stream=kind) for rows in replays]
        return mean_speed([ratios(of(rows, spec=spec), rows, baseline, _TIME) for rows in found])

    kinds = (_CLOSEST, *KINDS)
    return TextTable(
        f"geometric means over {len(replays)} scenes, x {baseline}",
        ("spec", *kinds),
        tuple((spec.text, *(mean(spec.text, kind) for kind in kinds)) for spec in options.specs),
    )


def closest_hits(rows: Sequence[Record]) -> list[Record]:
    """Runs of camera and bounce rays as one: nanoseconds of the mean ray, in the proportion that the frame has."""
    parts: dict[tuple[str, int], list[Record]] = {}
    for row in rows:
        if row["stream"] != "shadow":
            parts.setdefault((row["spec"], row["repeat"]), []).append(row)
    return [
        {
            "spec": spec,
            "repeat": repeat,
            _TIME: fmean([run[_TIME] for run in runs], [run["recorded_rays"] for run in runs]),
        }
        for (spec, repeat), runs in parts.items()
    ]
