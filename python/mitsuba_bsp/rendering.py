"""What a worker does in every job that renders: load, put under an accelerator, render, all as the job says."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mitsuba as mi
import numpy as np

from .expected_rays import with_expected_rays
from .exr import write_exr
from .jobs import Job
from .loading import LoadedScene, open_file
from .provenance import made_how
from .render_setup import fix_block_size, set_resolution, use_box_filter, watch_costs
from .spec import parse_spec
from .streams import check_recording
from .swap import GroupOptions
from .tree_statistics import statistics
from .turning import turn

Stage = Callable[[str], None]

#: The tree that rays are recorded with: all of ours give the same answers, so it does not matter which.
RECORDING_SPEC = "kd"


@dataclass(frozen=True)
class Frame:
    """A rendered image (height, width, channels) float32, and what `mitsuba.render` alone took.

    `wall_s` is seconds on the clock, `cpu_s` those of all threads on their processors.
    """

    pixels: np.ndarray
    wall_s: float
    cpu_s: float

    @property
    def sha256(self) -> str:
        """Of all bytes of all pixels."""
        return hashlib.sha256(np.ascontiguousarray(self.pixels)).hexdigest()


def load(job: Job, stage: Stage, box: bool = False, costs: bool = False, turned: int | None = None) -> LoadedScene:
    """Make the scene's objects, with the film and integrator that the job asks for.

    `box`: with the box filter. `costs`: every pixel also says what its rays cost. `turned`: everything
    is turned at random, with this seed.
    """

    def edit(state: mi.parser.ParserState) -> None:
        if job.resolution:
            set_resolution(state, job.resolution)
        if box:
            use_box_filter(state)
        if costs:
            watch_costs(state)
        fix_block_size(state)
        if turned is not None:
            turn(state, turned)

    stage(f"loading {job.scene}")
    return open_file(job.scene, params=job.params, edit=edit)


def construct(
    job: Job, loaded: LoadedScene, stage: Stage, options: GroupOptions | None = None
) -> tuple[mi.Scene, float]:
    """The scene under `job.spec`, and the seconds it took to construct it from loaded objects."""
    spec = with_expected_rays(parse_spec(job.spec), loaded.sensor, job.spp)
    state = loaded.regrouped(spec, options or GroupOptions(cache=job.cache))
    stage(f"building {job.spec} for {job.scene}")
    start = time.perf_counter()
    scene = loaded.construct(state)
    return scene, time.perf_counter() - start


def samples(job: Job, scene: mi.Scene) -> int:
    """The samples per pixel that the job asks for, or else the scene, if it was not rendered with others before."""
    return job.spp or scene.sensors()[0].sampler().sample_count()


def render(job: Job, scene: mi.Scene, stage: Stage, spp: int) -> Frame:
    """Render `scene`, which is under `job.spec`."""
    stage(f"rendering {job.scene} with {job.spec}")
    start, busy_start = time.perf_counter(), time.process_time()
    tensor = mi.render(scene, spp=spp, seed=job.seed)
    wall_s, cpu_s = time.perf_counter() - start, time.process_time() - busy_start
    return Frame(np.array(tensor, dtype=np.float32), wall_s, cpu_s)


def record_frame(job: Job, loaded: LoadedScene, file: Path, stage: Stage) -> tuple[mi.Scene, Frame]:
    """Render one frame and write its rays and their answers to `file`; ValueError if there are none.

    They are those that reach the scene's own meshes: an instance asks about its shape group in another space.
    """
    if not loaded.meshes:
        raise ValueError(
            "the scene has no triangle mesh outside its shape groups, so there is nothing to trace rays in"
        )
    job = replace(job, spec=RECORDING_SPEC)
    scene, _ = construct(job, loaded, stage, GroupOptions(record=file))
    frame = render(job, scene, stage, samples(job, scene))
    asked = sum(kind["rays"] for kind in statistics(scene)["counters"].values())
    check_recording(file, asked)
    if not asked:
        raise ValueError(f"rendering {job.scene} sent no ray to its triangle meshes, so there is nothing to measure")
    return scene, frame


def provenance(job: Job, scene: mi.Scene) -> dict[str, str]:
    """The header of an image: what the job says, and how it was rendered here."""
    return {**job.header, **made_how(scene, job.variant, job.seed)}


def write_image(path: Path, pixels: np.ndarray, extra: Sequence[str], header: Mapping[str, str]) -> None:
    """Write an EXR or (tone-mapped to sRGB) PNG file, by the suffix of `path`; `extra` are as for `write_exr`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".png":
        shown = np.ascontiguousarray(pixels[..., : 3 if pixels.shape[2] >= 3 else 1])
        mi.util.write_bitmap(str(path), shown, write_async=False)
    else:
        write_exr(path, pixels, extra, header)
