"""Tables of builds: times and memory of every scene, and how they grow with the number of triangles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log2
from statistics import geometric_mean, median

from .builds import BuildOptions, runs_of, sizes_of
from .comparison import SceneInfo
from .growth import MIN_SIZES, PowerLaw, fit_growth
from .intervals import median_interval
from .records import Record, ResultsFolder
from .speeds import NONE, spread
from .text_table import TextTable

#: The accelerator that the others are measured against.
BASELINE = "native"

#: What a build should keep to.
MAX_EXPONENT, MAX_PEAK_BYTES = 1.15, 1500

_PHASES = ("directions", "estimates", "sweeps", "partition", "pack")

_COLUMNS = ("peak B/tri", "tree B/tri", "refs/tri", "capped leaves")

LEGEND = (
    "Building takes from loaded meshes to the constructed scene. Times are medians; the spread is half the range of "
    "all runs; `times native` is this time over native's, the median of the rounds with its 95 % bootstrap interval. "
    "Peak is the largest amount of memory while building beyond that before it, tree that of the finished tree, both "
    "in bytes per input triangle; refs are references of leaves to triangles; capped leaves would have been split, but "
    "for a limit on depth or references. Phases are seconds summed over all threads."
)

GROWTH_LEGEND = (
    "A tree over one scene's meshes, tessellated further and further. Times are medians of building alone; the spread "
    "is half the range of all runs. The exponent is that of a power of the number of triangles, fitted to the medians "
    "on logarithmic axes, with its 95 % interval; that of n log n over the same sizes is beside it. Memory as measured "
    "by `bench build`."
)

NO_PEAK = "peak memory is not measured: this system does not let a process reset its peak"


@dataclass(frozen=True)
class Growth:
    """What one spec took at every size: medians, and the law fitted to them (None if sizes are missing)."""

    spec: str
    triangles: tuple[int, ...]
    seconds: tuple[float, ...]
    runs: tuple[Sequence[Record], ...]
    law: PowerLaw | None


def make_build_tables(scenes: Sequence[SceneInfo], options: BuildOptions, folder: ResultsFolder) -> list[TextTable]:
    """Tables of everything recorded so far."""
    found = {scene.name: runs_of(folder, options, scene) for scene in scenes}
    tables = [table for scene in scenes for table in _scene_tables(scene, found[scene.name])]
    with_baseline = [runs for runs in found.values() if BASELINE in runs]
    return [*tables, _means_table(options, with_baseline)] if len(with_baseline) > 1 else tables


def _scene_tables(scene: SceneInfo, found: Mapping[str, Sequence[Record]]) -> list[TextTable]:
    def speed(runs: Sequence[Record]) -> str:
        times = ratios(runs, found.get(BASELINE, ()))
        return str(median_interval(times)) if times else NONE

    title = f"{scene.name}, {scene.triangles:,} triangles"
    phases = {spec: runs for spec, runs in found.items() if "phases_s" in runs[0]["statistics"]}
    builds = TextTable(
        title,
        ("spec", "build s", "spread", f"times {BASELINE}", *_COLUMNS),
        tuple((spec, *_times(runs), speed(runs), *_sizes(runs)) for spec, runs in found.items()),
    )
    split = TextTable(
        f"{title}: phases, s",
        ("spec", *_PHASES),
        tuple(
            (spec, *(f"{median(run['statistics']['phases_s'][phase] for run in runs):.3f}" for phase in _PHASES))
            for spec, runs in phases.items()
        ),
    )
    return [builds, split] if phases else [builds]


def ratios(runs: Sequence[Record], baseline: Sequence[Record]) -> list[float]:
    """Build times over those of the baseline, round by round."""
    theirs = {run["repeat"]: run["build_s"] for run in baseline}
    return [run["build_s"] / theirs[run["repeat"]] for run in runs if run["repeat"] in theirs]


def _means_table(options: BuildOptions, scenes: Sequence[Mapping[str, Sequence[Record]]]) -> TextTable:
    def mean(spec: str) -> str:
        found = [ratios(runs.get(spec, ()), runs[BASELINE]) for runs in scenes]
        return f"{geometric_mean(median(times) for times in found):.2f}" if all(found) else NONE

    return TextTable(
        f"geometric means over {len(scenes)} scenes",
        ("spec", f"times {BASELINE}"),
        tuple((spec.text, mean(spec.text)) for spec in options.specs),
    )


def growths(scene: SceneInfo, options: BuildOptions, folder: ResultsFolder) -> list[Growth]:
    """What every spec took so far."""
    by_size = [runs_of(folder, options, scene, size) for size in sizes_of(options, scene)]
    found = []
    for spec in options.specs:
        runs = tuple(size[spec.text] for size in by_size if spec.text in size)
        triangles = tuple(size[0]["triangles"] for size in runs)
        seconds = tuple(median(run["build_s"] for run in size) for size in runs)
        complete = len(runs) == len(by_size) >= MIN_SIZES
        found.append(Growth(spec.text, triangles, seconds, runs, fit_growth(triangles, seconds) if complete else None))
    return found


def make_growth_tables(scene: SceneInfo, found: Sequence[Growth]) -> list[TextTable]:
    """The exponents, and what every size took."""
    return [
        TextTable(
            f"{scene.name}: growth of building with the number of triangles",
            ("spec", "exponent", "n log n", f"at most {MAX_EXPONENT}", "peak B/tri", f"at most {MAX_PEAK_BYTES:,}"),
            tuple((growth.spec, *_verdicts(growth)) for growth in found if growth.runs),
        ),
        TextTable(
            f"{scene.name}: every size",
            ("spec", "triangles", "build s", "spread", "ns per n log2 n", *_COLUMNS),
            tuple(
                (
                    growth.spec,
                    f"{n:,}",
                    *_times(runs),
                    f"{1e9 * seconds / (n * log2(n)):.1f}",
                    *_sizes(runs),
                )
                for growth in found
                for n, seconds, runs in zip(growth.triangles, growth.seconds, growth.runs, strict=True)
            ),
        ),
    ]


def _verdicts(growth: Growth) -> tuple[str, ...]:
    peaks = [peak for runs in growth.runs if (peak := _peak(runs)) is not None]
    memory = (f"{max(peaks):,.0f}", _yes(max(peaks) <= MAX_PEAK_BYTES)) if peaks else (NONE, NONE)
    if growth.law is None:
        return (NONE, NONE, NONE, *memory)
    exponent = growth.law.exponent
    return (
        f"{exponent.value:.3f} [{exponent.low:.3f}, {exponent.high:.3f}]",
        f"{growth.law.linearithmic:.3f}",
        _yes(exponent.value <= MAX_EXPONENT),
        *memory,
    )


def _times(runs: Sequence[Record]) -> tuple[str, str]:
    seconds = [run["build_s"] for run in runs]
    return f"{median(seconds):.3f}", spread(seconds)


def _sizes(runs: Sequence[Record]) -> tuple[str, ...]:
    """The cells of _COLUMNS."""
    stats, triangles, peak = runs[0]["statistics"], runs[0]["triangles"], _peak(runs)
    return (
        NONE if peak is None else f"{peak:,.0f}",
        f"{stats['bytes'] / triangles:,.0f}" if "bytes" in stats else NONE,
        f"{stats['references'] / triangles:.2f}" if "references" in stats else NONE,
        f"{stats['capped_leaves']:,}" if "capped_leaves" in stats else NONE,
    )


def _peak(runs: Sequence[Record]) -> float | None:
    """The largest peak in bytes per triangle, None if it was not measured."""
    peaks = [run["peak_build_bytes"] for run in runs]
    return None if None in peaks else max(peaks) / runs[0]["triangles"]


def _yes(kept: bool) -> str:
    return "yes" if kept else "NO"
