"""Image regression tests: a scene under an accelerator against an image of it that was stored before.

A stored reference is an EXR file with the colours (means over all samples), the variance of one sample (channels
`variance.X`, `.Y`, `.Z`), and a header with the number of samples, seed, spec and versions. It is judged by the gates
of `mitsuba-bsp diff`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import mitsuba as mi
import numpy as np

from .exr import channels, write_channels
from .judging import GATES, Judgement, NotComparableError, Rendering, judge, read_rendering
from .loading import VARIANTS, LoadedScene, open_dict, open_file
from .messages import choices, one_sentence
from .noise import VARIANCE, own_variance, rendered_channels
from .provenance import made_by, made_how
from .records import safe_name
from .render_setup import BLOCK_SIZE, set_resolution, use_box_filter
from .scalar import active_variant
from .spec import parse_spec

#: A Mitsuba XML file, or what `mitsuba.load_dict` takes.
Scene = str | Path | Mapping[str, object]

#: Added to the seed where a test has a second try.
FRESH_SEED = 1_000_003


@dataclass(frozen=True)
class Setup:
    """How a scene is rendered; `spp` and `resolution` (longer side, pixels) of None are the scene's own.

    ValueError if one of the numbers is none.
    """

    spp: int | None = None
    resolution: int | None = None
    seed: int = 0
    params: Mapping[str, object] = field(default_factory=dict)
    variant: str = VARIANTS[0]

    def __post_init__(self) -> None:
        for name, least in (("spp", 1), ("resolution", 1), ("seed", 0)):
            value = getattr(self, name)
            if not (isinstance(value, int) and value >= least or (value is None and name != "seed")):
                raise ValueError(f"{name} is {value!r}, but it must be an integer of at least {least}")


@dataclass(frozen=True)
class Regression:
    """What came of one test: the judgement, and the files to look at if it failed."""

    judgement: Judgement
    reference: Path
    rendered: Path
    picture: Path

    def __str__(self) -> str:
        hint = [f"hint: {self.judgement.hint}"] if self.judgement.hint else []
        files = [f"picture: {self.picture}", f"rendered: {self.rendered}", f"reference: {self.reference}"]
        return "\n".join([*self.judgement.lines, *hint, *files])


def render(scene: Scene, spec: str, name: str, setup: Setup) -> Rendering:
    """The image, its variance and provenance; `name` is the scene's in the header.

    With the box filter and a fixed block size, so that an image has the same pixels on any number of threads.
    ValueError or RuntimeError, in one sentence, for what is wrong with the scene or the spec.
    """
    if not isinstance(spec, str):
        raise ValueError(f"the spec is {spec!r}, but it must be text")
    checked = parse_spec(spec)
    if setup.variant not in VARIANTS:
        raise ValueError(f'there is no variant "{setup.variant}" here (valid: {choices(VARIANTS)})')
    with active_variant(setup.variant):
        loaded = _open(scene, setup)
        made = loaded.construct(loaded.regrouped(checked))
        if not made.sensors():
            raise ValueError("the scene has no sensor, so there is nothing to render it with")
        sampler = made.sensors()[0].sampler()
        if setup.spp:
            sampler.set_sample_count(setup.spp)
        samples = sampler.sample_count()  # it may have been rounded up
        integrator = _with_moments(made.integrator())
        pixels = np.array(mi.render(made, integrator=integrator, spp=samples, seed=setup.seed), np.float32)
        image = channels(pixels, integrator.aov_names())
        header = {**made_by(name, checked), **made_how(made, setup.variant, setup.seed)}
    return Rendering(f"{name} under {spec}", rendered_channels(image), header, samples, own_variance(image, samples))


def write(path: Path, rendering: Rendering) -> None:
    """Store a rendering so that `judging.read_rendering` finds all of it again."""
    planes = dict(rendering.image)
    header = dict(rendering.header)
    if rendering.variance is not None:
        values = rendering.variance.values.astype(np.float32)
        planes |= {f"{VARIANCE}.{name}": values[..., i].copy() for i, name in enumerate(rendering.variance.space)}
        header["variance_samples"] = str(rendering.samples)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_channels(path, planes, header)


def against_reference(scene: Scene, spec: str, setup: Setup, reference: Path, results: Path, gate: str) -> Regression:
    """Render and compare; where noise alone would explain a failure once in a hundred times, once more.

    ValueError or RuntimeError, in one sentence, as from `render` and `compare`.
    """
    found = compare(render(scene, spec, reference.stem, setup), reference, results, gate)
    if [failed.name for failed in found.judgement.failed] == ["z"]:
        again = replace(setup, seed=setup.seed + FRESH_SEED)
        found = compare(render(scene, spec, reference.stem, again), reference, results, gate)
    return found


def compare(rendering: Rendering, reference: Path, results: Path, gate: str) -> Regression:
    """Judge a rendering, and if it fails leave it and a picture in the folder `results`.

    ValueError, in one sentence, if there is nothing to compare it with.
    """
    if gate not in GATES:
        raise ValueError(f'there is no gate "{gate}" (valid: {choices(GATES)})')
    stored = read_rendering(reference)
    name = f"{reference.stem}--{safe_name(rendering.header['spec'])}"
    judgement = judge(rendering, stored, gate)
    found = Regression(judgement, reference, results / f"{name}.exr", results / f"{name}.png")
    if not found.judgement.same:
        from .diff_picture import draw

        write(found.rendered, rendering)
        draw(found.picture, rendering, stored, found.judgement)
    return found


def sentence(error: BaseException) -> str:
    """An error of `render` or `compare` for whoever reads the test's report."""
    text = one_sentence(error)
    if isinstance(error, NotComparableError):
        return text.replace(" (--ignore-header looks at the pixels only)", "")
    return text


def _open(scene: Scene, setup: Setup) -> LoadedScene:
    def edit(state: mi.parser.ParserState) -> None:
        if setup.resolution:
            set_resolution(state, setup.resolution)
        use_box_filter(state)

    if isinstance(scene, str | Path):
        return open_file(scene, params=setup.params, edit=edit)
    if setup.params:
        raise ValueError("params are those of an XML file, but the scene is a dictionary: put them into it")
    return open_dict(scene, edit=edit)


def _with_moments(integrator: mi.Integrator | None) -> mi.Integrator:
    """The integrator `moment` around another one: the same image, and the noise of each pixel beside it."""
    if integrator is None:
        raise ValueError("the scene has no integrator, so there is nothing to render it with")
    return mi.load_dict({"type": "moment", "block_size": BLOCK_SIZE, "inner": integrator})
