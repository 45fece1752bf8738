"""Tables of building and rendering together: every accelerator, `auto` against the best, scenes turned."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import geometric_mean, median

from .comparison import SceneInfo
from .expected_rays import AUTO
from .records import Record, ResultsFolder, of
from .spec import parse_spec, shortest
from .speeds import BASELINES, NONE
from .text_table import TextTable
from .totals import TotalOptions, newest_totals

#: Within how much of the best fixed tree, of our kd-tree, and of itself in the turned scene `auto` should stay.
ON_AVERAGE, ANYWHERE, OF_KD, TURNED, TURNED_AXES = 1.05, 1.15, 1.03, 1.10, 1.30

LEGEND = (
    "Seconds on the clock, from loaded meshes to the picture: building and rendering, medians of the repetitions. A "
    "picture of more samples than were measured takes as much longer as it has more samples. `auto` is told how many "
    "samples there will be and builds another tree for each. `best` is the fixed tree of ours with the least total "
    "time, found by trying all; ratios are medians over the repetitions of this one's time over the other's. "
    "`choosing` is the part of building that `auto` takes to look at the scene. A turned scene is turned as a whole, "
    "camera and lights too; its frame's time is set against that of the scene as it is."
)


@dataclass(frozen=True)
class _Scene:
    """The runs of one scene."""

    info: SceneInfo
    options: TotalOptions
    rows: Sequence[Record]

    def runs(self, spec: str, spp: int, turned: bool = False) -> list[Record]:
        """In the order of their repetitions."""
        found = of(self.rows, spec=spec, for_spp=spp if parse_spec(spec).name == AUTO else 0, turned=turned)
        return sorted(found, key=lambda run: run["repeat"])

    def frames(self, spec: str, spp: int, turned: bool = False) -> list[float]:
        """Seconds of a frame of `spp` samples, reckoned from the largest one measured."""
        measured = min(spp, self.options.spp)
        return [run["frames_s"][str(measured)] * spp / measured for run in self.runs(spec, spp, turned)]

    def totals(self, spec: str, spp: int) -> list[float]:
        """Seconds of building and rendering."""
        runs = self.runs(spec, spp)
        return [run["build_s"] + frame for run, frame in zip(runs, self.frames(spec, spp), strict=True)]

    def ratio(self, spec: str, other: str, spp: int) -> float | None:
        """The median of this one's total time over the other's; None if one of them was not measured."""
        if other not in self.specs or spec not in self.specs:
            return None
        return median(a / b for a, b in zip(self.totals(spec, spp), self.totals(other, spp), strict=True))

    @property
    def specs(self) -> list[str]:
        return [spec.text for spec in self.options.specs]

    def best(self, spp: int) -> str | None:
        """The fixed tree of ours that takes the least time."""
        fixed = [spec for spec in self.specs if parse_spec(spec).name not in (AUTO, *BASELINES)]
        return min(fixed, key=lambda spec: median(self.totals(spec, spp)), default=None)


def make_total_tables(scenes: Sequence[SceneInfo], options: TotalOptions, folder: ResultsFolder) -> list[TextTable]:
    """Tables of every finished scene, and what they say together."""
    found = [_Scene(scene, options, rows) for scene in scenes if (rows := newest_totals(folder, options, scene))]
    tables = [_scene_table(scene) for scene in found]
    if found and AUTO in found[0].specs:
        tables += [_verdicts(found, spp) for spp in options.samples]
        tables += [_choosing(found)]
    if found and options.turned is not None:
        tables += [_turned(found)]
    return tables


def _scene_table(scene: _Scene) -> TextTable:
    width, height = scene.info.resolution
    samples = scene.options.samples
    return TextTable(
        f"{scene.info.name}, {scene.info.triangles:,} triangles, {width}x{height}: seconds in all",
        ("spec", "build s", *(f"{spp} spp" for spp in samples)),
        tuple(
            (
                spec,
                f"{median(run['build_s'] for run in scene.runs(spec, samples[-1])):.3f}",
                *(f"{median(scene.totals(spec, spp)):.2f}" for spp in samples),
            )
            for spec in scene.specs
        ),
    )


def _verdicts(scenes: Sequence[_Scene], spp: int) -> TextTable:
    others = [other for other in ("kd", *BASELINES) if other in scenes[0].specs]
    rows, found = [], []
    for scene in scenes:
        best = scene.best(spp)
        ratios = [scene.ratio(AUTO, best, spp) if best else None, *(scene.ratio(AUTO, o, spp) for o in others)]
        found.append(ratios)
        chosen = scene.runs(AUTO, spp)[0]["chosen"]  # None where several accelerators have chosen
        rows.append((scene.info.name, shortest(chosen) if chosen else NONE, best or NONE, *map(_number, ratios)))
    columns = list(zip(*found, strict=True))
    means = [geometric_mean(column) if None not in column else None for column in columns]
    worst = [max(column) if None not in column else None for column in columns]
    rows += [("geometric mean", "", "", *map(_number, means)), ("worst", "", "", *map(_number, worst))]
    rows += [("to be at most, mean", "", "", f"{ON_AVERAGE:.2f}", *[""] * len(others))]
    limits = {"kd": f"{OF_KD:.2f}", "native": "1.00" if spp >= 16 else "", "embree": ""}
    rows += [("to be at most, each", "", "", f"{ANYWHERE:.2f}", *(limits[other] for other in others))]
    return TextTable(
        f"auto at {spp} samples per pixel: its time over that of others",
        ("scene", "chosen", "best", "/ best", *(f"/ {other}" for other in others)),
        tuple(rows),
    )


def _choosing(scenes: Sequence[_Scene]) -> TextTable:
    def rows() -> Iterator[tuple[str, ...]]:
        for scene in scenes:
            for spp in scene.options.samples:
                runs = scene.runs(AUTO, spp)
                share = median(run["choose_s"] / run["tree_s"] for run in runs)
                yield (
                    scene.info.name,
                    str(spp),
                    shortest(runs[0]["chosen"]),
                    f"{1000 * median(run['choose_s'] for run in runs):.1f}",
                    f"{share:.1%}",
                    f"{median(run['build_s'] for run in runs):.2f}",
                    f"{runs[0]['predicted_build_s']:.2f}",
                    f"{median(scene.frames(AUTO, spp)):.2f}",
                    f"{runs[0]['predicted_trace_s']:.2f}",
                )

    return TextTable(
        "what auto foresees: seconds predicted (of one thread, rays alone) and taken (of all threads, with shading)",
        ("scene", "spp", "chosen", "choosing ms", "of building", "build s", "predicted", "frame s", "predicted rays s"),
        tuple(rows()),
    )


def _turned(scenes: Sequence[_Scene]) -> TextTable:
    def ratio(scene: _Scene, spec: str) -> float:
        spp = scene.options.samples[-1]
        pairs = zip(scene.frames(spec, spp, True), scene.frames(spec, spp), strict=True)
        return median(turned / plain for turned, plain in pairs)

    specs = scenes[0].specs
    rows = [(scene.info.name, *(f"{ratio(scene, spec):.2f}" for spec in specs)) for scene in scenes]
    means = [f"{geometric_mean(ratio(scene, spec) for scene in scenes):.2f}" for spec in specs]
    return TextTable(
        f"frames of the turned scenes over those of the scenes as they are (auto: at most {TURNED:.2f}, "
        f"{TURNED_AXES:.2f} where all lay along the axes)",
        ("scene", *specs),
        (*rows, ("geometric mean", *means)),
    )


def _number(value: float | None) -> str:
    return NONE if value is None else f"{value:.2f}"
