"""The counters that J. Hoobergs published, and ours of the same trees: one counted frame of each, untimed.

A scene is one of the thesis's if its file is called feet, sponza or conference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .attempts import Attempts
from .comparison import SEED, Failure, Listener, Options, SceneInfo, context
from .jobs import Job
from .preflight import preflight
from .records import Record, ResultsFolder, append

#: The tree that all counters are percentages of.
BASELINE = "kd:cost=thesis"


@dataclass(frozen=True)
class Counters:
    """Triangle tests (I) and interior steps (T) of closest-hit rays, each, or in percent of another tree's."""

    tests: float
    steps: float


#: J. Hoobergs, master's thesis, KU Leuven 2019, final text: counters of pbrt-v3's path tracer.
PUBLISHED: Mapping[str, Mapping[str, Counters]] = {
    "feet": {
        "normals:k=6,axes=fast,cost=thesis": Counters(19, 83),
        "clustered:k=6,axes=fast,cost=thesis": Counters(19, 83),
        "random:k=10,axes=fast,cost=thesis": Counters(35, 96),
        "rbsp:k=13,axes=fast,cost=thesis": Counters(42, 95),
        "rbsp:k=13,axes=plain,cost=thesis": Counters(44, 91),
        "ize:axes=fast,cost=thesis": Counters(76, 100),
        "ize:axes=plain,cost=thesis": Counters(73, 97),
    },
    "sponza": {
        "normals:k=6,axes=fast,cost=thesis": Counters(59, 99),
        "clustered:k=6,axes=fast,cost=thesis": Counters(59, 99),
        "random:k=10,axes=fast,cost=thesis": Counters(50, 108),
        "rbsp:k=13,axes=fast,cost=thesis": Counters(78, 117),
        "rbsp:k=13,axes=plain,cost=thesis": Counters(209, 141),
        "ize:axes=fast,cost=thesis": Counters(157, 117),
        "ize:axes=plain,cost=thesis": Counters(390, 130),
    },
    "conference": {
        "normals:k=6,axes=fast,cost=thesis": Counters(47, 97),
        "clustered:k=6,axes=fast,cost=thesis": Counters(54, 96),
        "random:k=10,axes=fast,cost=thesis": Counters(53, 108),
        "rbsp:k=13,axes=fast,cost=thesis": Counters(73, 110),
        "rbsp:k=13,axes=plain,cost=thesis": Counters(98, 125),
        "ize:axes=fast,cost=thesis": Counters(83, 107),
        "ize:axes=plain,cost=thesis": Counters(128, 117),
    },
}

#: Its scenes, in thousands of triangles.
PUBLISHED_TRIANGLES = {"feet": 33, "sponza": 227, "conference": 124}

SPECS = (BASELINE, *PUBLISHED["feet"])


def count_frames(options: Options, listener: Listener) -> tuple[list[SceneInfo], list[Failure]]:
    """Render every scene once under every spec, except what is in the folder; returns the scenes and what failed.

    ValueError for anything wrong with the input, raised before the first frame.
    """
    folder = ResultsFolder(options.out)
    attempts = Attempts(folder, listener)
    scenes = preflight(options, folder, attempts.note, images=False, meshes_to="count")
    folder.prepare("")
    done = {(row["scene"], row["spec"]) for row in folder.records()}
    frames = [(scene, spec) for scene in scenes for spec in options.specs]
    todo = [(scene, spec) for scene, spec in frames if (scene.name, spec.text) not in done]
    listener.start(scenes, len(frames), len(frames) - len(todo))
    for scene, spec in todo:
        job = Job(
            kind="count",
            scene=str(scene.path),
            variant=options.variant,
            spec=spec.text,
            params=options.params,
            spp=options.spp,
            resolution=options.resolution,
            seed=SEED,
            threads=options.threads,
        )
        result = attempts.run(scene, spec.text, job, f"{scene.name}: {spec.text}")
        if result:
            row = {**context(options, scene), "spec": spec.text, "spec_full": spec.full, **result.values}
            append(folder.records_file, row)
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
