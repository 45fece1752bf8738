"""The counters that J. Hoobergs published, and ours of the same trees: one counted frame of each, untimed.

A scene is one of the thesis's if its file is called feet, sponza or conference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .asked import begin
from .attempts import Attempt, Attempts
from .comparison import Failure, Listener, Options, SceneInfo, context
from .preflight import preflight
from .records import Record, ResultsFolder, append
from .scheduling import Local, Scheduler
from .spec import Spec

#: The tree that all counters are percentages of.
BASELINE = "kd:cost=thesis"


@dataclass(frozen=True)
class Counters:
    """Triangle tests (I) and interior steps (T) of closest-hit rays, each, or in percent of another tree's."""

    tests: float
    steps: float


@dataclass(frozen=True)
class Published(Counters):
    """The same, and render time (R) in percent of the kd-tree's, build time (B) as a multiple of it."""

    render: float
    build: float


#: What is in the rows of PUBLISHED.
PUBLISHED_TREES = (
    "normals:k=6,axes=fast",
    "clustered:k=6,axes=fast",
    "random:k=10,axes=fast",
    "rbsp:k=13,axes=fast",
    "rbsp:k=13,axes=plain",
    "ize:axes=fast",
    "ize:axes=plain",
)

#: R, B, I, T of PUBLISHED_TREES: J. Hoobergs, master's thesis, KU Leuven 2019, final text; path tracer of pbrt-v3.
_PUBLISHED = {
    "feet": (
        (68, 113, 19, 83), (68, 117, 19, 83), (80, 178, 35, 96), (84, 257, 42, 95), (83, 251, 44, 91),
        (95, 196, 76, 100), (94, 211, 73, 97),
    ),
    "sponza": (
        (80, 95, 59, 99), (80, 97, 59, 99), (86, 161, 50, 108), (94, 236, 78, 117), (131, 237, 209, 141),
        (109, 353, 157, 117), (165, 359, 390, 130),
    ),
    "conference": (
        (79, 87, 47, 97), (79, 88, 54, 96), (87, 154, 53, 108), (93, 222, 73, 110), (101, 223, 98, 125),
        (93, 256, 83, 107), (105, 268, 128, 117),
    ),
    "museum": (
        (63, 115, 27, 94), (66, 121, 29, 95), (78, 218, 37, 106), (78, 249, 55, 105), (482, 250, 1376, 109),
        (85, 918, 58, 107), (88, 901, 73, 109),
    ),
}  # fmt: skip

#: What was published, by scene and spec.
PUBLISHED: Mapping[str, Mapping[str, Published]] = {
    scene: {
        f"{tree},cost=thesis": Published(tests, steps, render, build)
        for tree, (render, build, tests, steps) in zip(PUBLISHED_TREES, rows, strict=True)
    }
    for scene, rows in _PUBLISHED.items()
}

#: Its render times by number of directions, axes `fast`, in percent of the kd-tree's: feet, sponza, conference.
_PUBLISHED_BY_K = {
    "normals": {
        3: (101.5, 95.2, 97.2), 4: (72.1, 83.3, 79.2), 6: (67.7, 80.4, 78.6), 8: (67.0, 80.0, 80.7),
        10: (67.1, 83.7, 80.2),
    },
    "clustered": {
        3: (101.6, 95.8, 96.5), 4: (78.1, 87.2, 83.6), 6: (67.8, 80.3, 79.3), 8: (67.3, 80.1, 79.7),
        10: (66.9, 83.8, 80.2),
    },
    "random": {
        3: (101.3, 95.1, 97.3), 4: (92.3, 90.9, 92.7), 6: (84.5, 88.4, 90.5), 8: (81.6, 85.5, 90.1),
        10: (80.2, 85.5, 87.1),
    },
}  # fmt: skip

#: Every published render time of a tree with a number of directions, by scene and `name:k=K,axes=POLICY`, in percent of
#: the kd-tree's: to a tenth where its table by k has it, else as in PUBLISHED.
PUBLISHED_RENDER: Mapping[str, Mapping[str, float]] = {
    scene: {
        **{tree: row[0] for tree, row in zip(PUBLISHED_TREES, rows, strict=True) if "k=" in tree},
        **{
            f"{name}:k={k},axes=fast": times[place]
            for name, by_k in _PUBLISHED_BY_K.items()
            for k, times in by_k.items()
            if place < len(times)
        },
    }
    for place, (scene, rows) in enumerate(_PUBLISHED.items())
}

#: Its scenes, in thousands of triangles.
PUBLISHED_TRIANGLES = {"feet": 33, "sponza": 227, "conference": 124, "museum": 1460}

#: Scenes that take the place of one of the thesis's that is not to be had.
STAND_INS = {"sanmiguel": "museum"}

#: Scenes whose triangles differ by more than this share are not the same.
_SAME_SCENE = 0.02

SPECS = (BASELINE, *PUBLISHED["feet"])


def published_scene(scene: str, triangles: int) -> tuple[str, bool] | None:
    """The thesis's scene of this name, or that this one stands in for, and whether it is the same; None without one."""
    name = STAND_INS.get(scene, scene)
    thousands = PUBLISHED_TRIANGLES.get(name)
    if thousands is None:
        return None
    return name, name == scene and abs(triangles / 1e3 - thousands) <= _SAME_SCENE * thousands


def count_frames(
    options: Options, listener: Listener, scheduler: Scheduler | None = None
) -> tuple[list[SceneInfo], list[Failure]]:
    """Render every scene once under every spec, except what is in the folder; returns the scenes and what failed.

    ValueError for anything wrong with the input, raised before the first frame.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener, scheduler or Local())
    scenes = preflight(options, attempts, images=False, meshes_to="count")
    begin(folder, options, scenes)
    done = {(row["scene"], row["spec"]) for row in folder.records()}
    frames = [(scene, spec) for scene in scenes for spec in options.specs]
    todo = [(scene, spec) for scene, spec in frames if (scene.name, spec.text) not in done]
    listener.start(scenes, len(frames), len(frames) - len(todo))

    def attempt(frame: tuple[SceneInfo, Spec]) -> Attempt:
        scene, spec = frame
        job = options.job("count", scene.path, spec=spec.text)
        return Attempt(scene, spec.text, job, f"{scene.name}: {spec.text}")

    for (scene, spec), result in attempts.run(todo, attempt):
        origin = context(options, scene, result.machine)
        append(folder.records_file, {**origin, "spec": spec.text, "spec_full": spec.full, **result.values})
    return scenes, attempts.failures


def per_ray(row: Record) -> Counters:
    """Tests and steps of a frame per closest-hit ray."""
    found = row["statistics"]["counters"]["closest"]
    steps = found["axis_steps"] + found["oblique_steps"]
    return Counters(found["triangle_tests"] / found["rays"], steps / found["rays"])


def percent(row: Record, baseline: Record) -> Counters:
    """Tests and steps of a frame in percent of those of the baseline on the same scene."""
    ours, theirs = per_ray(row), per_ray(baseline)
    return Counters(100 * ours.tests / theirs.tests, 100 * ours.steps / theirs.steps)
