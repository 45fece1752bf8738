"""How soon a picture is good: its error against a reference as a function of time, and pictures of equal time."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from ..expected_rays import with_expected_rays
from ..exr import channels
from ..figures import lines_of, new_figure, plain
from ..flip import flip, rgb
from ..jobs import Job
from ..records import Record, ResultsFolder
from ..rendering import construct, load
from ..spec import parse_spec
from ..speeds import NONE
from ..terminal import positive
from ..text_table import TextTable
from ..tree_statistics import statistics
from .runs import Runs
from .study import Cell, Study, StudyOptions, arrays_file
from .work import save_arrays

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.figure import Figure

SPECS = ("native", "embree", "auto", "kd", "normals")

#: What the reference is rendered under: the quickest that is always there. Which it is decides nothing but rounding.
REFERENCE_SPEC, REFERENCE_SEED = "embree", 1_000_000

#: Added to the square of the reference in the denominator of the relative error (Rousselle, Knaus, Zwicker 2011).
EPSILON = 0.01

_LEGEND = (
    "A picture is rendered in passes with different seeds, of --spp samples each, which are averaged. Time is on the "
    "clock, building included, and stands still while errors are measured. The reference has --reference-passes passes "
    "with other seeds. relMSE is the mean over pixels and channels of (x - r)^2 / (r^2 + "
    f"{EPSILON:g}); FLIP is the mean of HDR-FLIP over the pixels (Andersson et al. 2021). The paths are the same under "
    "all accelerators, pass by pass, so that errors differ by rounding only and what differs is when they are reached. "
    "`to reach`: the time to the largest error that any has at its end, interpolated on logarithmic axes; medians over "
    "the repetitions."
)


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which accelerators, and how many passes."""
    group.add_argument("--specs", nargs="+", default=SPECS, metavar="SPEC", help=f"default: {' '.join(SPECS)}")
    group.add_argument("--passes", type=positive, default=32, metavar="N", help="default: %(default)s")
    group.add_argument(
        "--reference-passes", type=positive, default=512, metavar="N", help="of the reference, default: %(default)s"
    )
    return ("specs", "passes", "reference_passes")


def plan(options: StudyOptions) -> list[Cell]:
    """The passes of every accelerator."""
    return [Cell("converge", spec, options.repeats) for spec in dict.fromkeys(options.choices["specs"])]


def measure(job: Job, stage: Callable[[str], None]) -> dict[str, Any]:
    """Build, and render pass after pass; `points` are passes, seconds and errors after 1, 2, 4, ... of them.

    The pictures at these points go into the file `arrays`.
    """
    passes = int(job.choices["passes"])
    loaded = load(job, stage, box=True)
    reference = _reference(job, stage)
    spec = with_expected_rays(parse_spec(job.spec), loaded.sensor, passes * (job.spp or 1))
    scene, build_s = construct(replace(job, spec=spec.full), loaded, stage)
    _pass(job, scene, 0)  # warms up
    total, seconds, points, pictures = None, build_s, [], {}
    for number in range(1, passes + 1):
        stage(f"rendering {job.scene} with {job.spec}, {number / passes:.0%}")
        start = time.perf_counter()
        image = _pass(job, scene, number)
        total = image if total is None else total + image
        seconds += time.perf_counter() - start
        if number & (number - 1) == 0 or number == passes:
            mean = _colours(scene, total / number)
            points.append({"passes": number, "seconds": seconds, **errors(mean, reference)})
            pictures[f"{number}"] = mean
    save_arrays(Path(job.arrays), pictures)
    return {"build_s": build_s, "points": points, "statistics": statistics(scene)}


def errors(image: NDArray[np.float64], reference: NDArray[np.float64]) -> dict[str, float | None]:
    """relMSE and FLIP of an image (height, width, 3); FLIP is None where its package is not installed."""
    relative = float(np.mean(np.square(image - reference) / (np.square(reference) + EPSILON)))
    planes, expected = ({c: p[..., i].astype(np.float32) for i, c in enumerate("RGB")} for p in (image, reference))
    found = flip(planes, expected)
    return {"relmse": relative, "flip": None if found is None else float(found.mean())}


def _pass(job: Job, scene: mi.Scene, seed: int) -> NDArray[np.float64]:
    return np.array(mi.render(scene, spp=job.spp or 1, seed=seed), np.float64)


def _colours(scene: mi.Scene, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
    return rgb(channels(pixels.astype(np.float32), scene.integrator().aov_names())).astype(np.float64)


def _reference(job: Job, stage: Callable[[str], None]) -> NDArray[np.float64]:
    """From the file that the accelerators of a scene share; the first one makes it."""
    passes = int(job.choices["reference_passes"])
    side, made_of = job.resolution or 0, job.header.get("scene_hash", "")[:12]
    name = f"{Path(job.scene).stem}-{job.variant}-{side}-{passes * (job.spp or 1)}-{made_of}.npz"
    file = Path(job.arrays).parent / "reference" / name
    if not file.is_file():
        scene, _ = construct(replace(job, spec=REFERENCE_SPEC), load(job, stage, box=True), stage)
        total = 0.0
        for number in range(passes):
            stage(f"rendering the reference of {job.scene}, {number / passes:.0%}")
            total = total + _pass(job, scene, REFERENCE_SEED + number)
        save_arrays(file, {"reference": _colours(scene, total / passes)})
    with np.load(file) as arrays:
        return arrays["reference"]


def time_to_reach(points: Sequence[Mapping[str, float]], error: float) -> float | None:
    """Seconds until the error is as small, interpolated on logarithmic axes; None if it is not reached."""
    before = None
    for point in points:
        if point["relmse"] <= error:
            if before is None:
                return point["seconds"]
            (x0, y0), (x1, y1) = ((np.log(p["seconds"]), np.log(p["relmse"])) for p in (before, point))
            return float(np.exp(x0 + (x1 - x0) * (y0 - np.log(error)) / (y0 - y1)))
        before = point
    return None


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """The errors at the end, and when native's is reached, a table a scene."""
    runs = Runs(rows)
    return [_scene_table(runs, scene) for scene in runs.scenes]


def _goal(runs: Runs, scene: str) -> float:
    """The largest error that anyone has at the end: all of them reach it."""
    ends = (row["points"][-1] for tree in runs.trees for row in runs.get(scene, "converge", tree).values())
    return max(end["relmse"] for end in ends)


def _scene_table(runs: Runs, scene: str) -> TextTable:
    goal = _goal(runs, scene)

    def reached(tree: str) -> float | None:
        found = [time_to_reach(row["points"], goal) for row in runs.get(scene, "converge", tree).values()]
        times = [seconds for seconds in found if seconds is not None]
        return median(times) if times else None

    slowest = reached("native")

    def cells(tree: str) -> tuple[str, ...]:
        rows = list(runs.get(scene, "converge", tree).values())
        last, seconds = rows[0]["points"][-1], reached(tree)
        return (
            f"{median(row['build_s'] for row in rows):.2f}",
            f"{median(row['points'][-1]['seconds'] for row in rows):.2f}",
            f"{last['relmse']:.3g}",
            NONE if last["flip"] is None else f"{last['flip']:.4f}",
            NONE if seconds is None else f"{seconds:.2f}",
            NONE if seconds is None or slowest is None else f"{slowest / seconds:.2f}",
        )

    title = f"{runs.title(scene)} a pass: error against time"
    head = ("spec", "build s", "all passes s", "relMSE", "FLIP", f"s to reach {goal:.3g}", "x native")
    trees = [tree for tree in runs.ordered(SPECS) if runs.first(scene, "converge", tree)]
    return TextTable(title, head, tuple((tree, *cells(tree)) for tree in trees))


def figures(rows: Sequence[Record], folder: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """Error against time, and for every scene the pictures at the time of a quarter of native's passes."""
    runs = Runs(rows)
    yield "convergence", _curves(runs)
    for scene in runs.scenes:
        if figure := _equal_time(runs, scene, folder):
            yield f"convergence-{scene}", figure


def _curves(runs: Runs) -> Figure:
    from matplotlib.ticker import LogLocator

    measured = [("relmse", "relMSE"), ("flip", "FLIP")]
    figure = new_figure(10.5, 0.8 + 3.4 * len(runs.scenes))
    grid = figure.subplots(len(runs.scenes), len(measured), squeeze=False)
    for line, scene in zip(grid, runs.scenes, strict=True):
        for panel, (key, name) in zip(line, measured, strict=True):
            for tree, style in lines_of(runs.ordered(SPECS)).items():
                row = runs.first(scene, "converge", tree)
                if row and row["points"][0][key] is not None:
                    xs, ys = zip(*((point["seconds"], point[key]) for point in row["points"]), strict=True)
                    panel.plot(xs, ys, marker="o", **style, markersize=3.5, label=tree)
            panel.set_xscale("log")
            panel.set_yscale("log")
            for axis in (panel.xaxis, panel.yaxis):
                axis.set_major_locator(LogLocator(subs=(1, 2, 5)))
                axis.set_major_formatter("{x:g}")
                axis.set_minor_formatter("")
            panel.set_xlabel("seconds, building included")
            panel.set_title(f"{scene}: {name}", fontsize=10)
            plain(panel)
    drawn = {line.get_label(): line for panel in grid[:, 0] for line in panel.lines}  # a scene may lack some
    labels = [tree for tree in runs.ordered(SPECS) if tree in drawn]
    handles = [drawn[tree] for tree in labels]
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    return figure


def _equal_time(runs: Runs, scene: str, folder: ResultsFolder) -> Figure | None:
    """The last picture of each that is there by that time."""
    trees = [tree for tree in runs.ordered(SPECS) if runs.first(scene, "converge", tree)]
    slowest = runs.first(scene, "converge", "native") or runs.first(scene, "converge", trees[0])
    points = slowest["points"]
    limit = next(point["seconds"] for point in points if 4 * point["passes"] >= points[-1]["passes"])
    shown = []
    for tree in trees:
        row = runs.first(scene, "converge", tree)
        file = arrays_file(folder, "converge", scene, str(row["spec"]))
        if not file.is_file():
            return None
        point = max((p for p in row["points"] if p["seconds"] <= limit), key=lambda p: p["passes"], default=None)
        if point:
            with np.load(file) as arrays:
                shown.append((tree, point, arrays[str(point["passes"])]))
    figure = new_figure(3.1 * len(shown), 3.7)
    for panel, (tree, point, picture) in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        panel.imshow(np.clip(picture, 0, 1) ** (1 / 2.2), interpolation="nearest")
        panel.set_title(f"{tree}: {point['passes']} passes, relMSE {point['relmse']:.3g}", fontsize=9)
        panel.set_xticks([])
        panel.set_yticks([])
    figure.suptitle(f"{scene} after {limit:.2f} s", fontsize=11)
    return figure


STUDY = Study(
    name="convergence",
    help="how soon is a picture good: error against time, and pictures of equal time",
    title="Error against time",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
    repeats=1,
    repeated="timed runs of each",
)
