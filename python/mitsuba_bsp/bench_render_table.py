"""Tables of whole frames: one a scene, and the geometric means over all scenes."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median

from .comparison import Options, SceneInfo
from .frames import contenders, newest_frames
from .jobs import FREE
from .records import Record, ResultsFolder, of
from .speeds import BASELINES, NONE, mean_ratio, mean_speed, ratios, speed, spread
from .text_table import TextTable

_TIME = "frame_s"

_LEGEND = (
    "Times are medians of {time}, shading included; the spread is half the range of all repetitions. `x native` is "
    "native's time over this one, the median of the repetitions with its 95 % bootstrap interval; `x embree` likewise. "
    "`image` says whether the image is that of the first of our trees (`reference`) bit for bit, or as different as "
    "rounding makes it, or biased. Geometric means have the interval that repeating all scenes anew would "
    "give."
)

_FREE_LEGEND = (
    f" `{FREE}` gives the answers of a recorded frame in their order, without a tree: what is left is shading, Embree "
    "with its user-geometry callback, our wrapper around it (the hit triangle's barycentrics included) and reading the "
    "answers. So its `x native` is the most that any accelerator behind that callback could reach; Embree itself works "
    f"without it. `traversal` is the share of the frame that `{FREE}` saves, with its interval: for trees and native "
    "the part that is traversal, for Embree less than that part, by what the callback costs."
)


def legend(threads: int) -> str:
    """What the tables show."""
    if threads > 1:
        return _LEGEND.format(time=f"seconds on the clock, on {threads} threads")
    return _LEGEND.format(time="the processor time of one thread") + _FREE_LEGEND


def make_frame_tables(scenes: Sequence[SceneInfo], options: Options, folder: ResultsFolder) -> list[TextTable]:
    """Tables of every finished scene."""
    found = {scene.name: newest_frames(folder, options, scene) for scene in scenes}
    tables = [_scene_table(scene, options, found[scene.name]) for scene in scenes if found[scene.name]]
    finished = [rows for rows in found.values() if rows]
    return [*tables, _means_table(options, finished)] if len(finished) > 1 else tables


def _scene_table(scene: SceneInfo, options: Options, rows: Sequence[Record]) -> TextTable:
    width, height = scene.resolution
    return TextTable(
        f"{scene.name}, {scene.triangles:,} triangles: {width}x{height}, {scene.spp} spp",
        ("spec", "s/frame", "spread", *_heads(options), "image"),
        tuple((name, *_cells(of(rows, spec=name), rows, options)) for name in contenders(options)),
    )


def _heads(options: Options) -> tuple[str, ...]:
    """Of the columns that both kinds of tables have."""
    return (*(f"x {name}" for name in BASELINES), *["traversal"] * (options.threads == 1))


def _cells(runs: Sequence[Record], rows: Sequence[Record], options: Options) -> tuple[str, ...]:
    times, image = [run[_TIME] for run in runs], runs[0]["image_difference"]
    name = runs[0]["spec"]
    shares = [1 - saved for saved in ratios(runs, rows, FREE, _TIME)]
    verdict = "BIAS" if image["verdict"] == "bias" else image["verdict"]
    return (
        f"{median(times):.3f}",
        spread(times),
        *(speed(ratios(runs, rows, baseline, _TIME)) for baseline in BASELINES),
        *[NONE if name == FREE else speed(shares)] * (options.threads == 1),
        "reference" if name == image["reference"] else verdict,
    )


def _means_table(options: Options, scenes: Sequence[Sequence[Record]]) -> TextTable:
    """Speed against the baselines, and on one thread the share of traversal."""

    def found(name: str, baseline: str) -> list[list[float]]:
        return [ratios(of(rows, spec=name), rows, baseline, _TIME) for rows in scenes]

    def share(name: str) -> str:
        saved = None if name == FREE else mean_ratio(found(name, FREE))
        return NONE if saved is None else f"{1 - saved:.2f}"

    return TextTable(
        f"geometric means over {len(scenes)} scenes",
        ("spec", *_heads(options)),
        tuple(
            (name, *(mean_speed(found(name, b)) for b in BASELINES), *[share(name)] * (options.threads == 1))
            for name in contenders(options)
        ),
    )
