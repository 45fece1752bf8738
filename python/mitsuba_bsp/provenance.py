"""What made an image, as the header of its file says it."""

from __future__ import annotations

import mitsuba as mi

from .machine import c_library, describe
from .render_setup import filter_name
from .spec import Spec


def made_by(scene: str, spec: Spec) -> dict[str, str]:
    """Which scene, under which accelerator."""
    return {"scene": scene, "spec": spec.text, "spec_full": spec.full}


def made_how(scene: mi.Scene, variant: str, seed: int) -> dict[str, str]:
    """What decides which paths were traced, and with which arithmetic: this machine's."""
    return {
        **{f"version_{key}": value for key, value in describe().items()},
        "variant": variant,
        "spp": str(scene.sensors()[0].sampler().sample_count()),  # a sampler may have rounded it up
        "seed": str(seed),
        "filter": filter_name(scene),
        "version_libc": c_library(),
    }
