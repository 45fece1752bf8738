"""How many rays a picture will take, which is what the tree `auto` chooses for."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi

from .spec import Spec, make_spec, parse_spec

AUTO, KEY = "auto", "expected_rays"

#: Rays of a sample that is traced as a path: from 2 (a scan under a lamp) to 11 (a room) in our scenes, depth 5.
RAYS_PER_SAMPLE = 6


def with_default_rays(text: str) -> str:
    """A spec's text that keeps `auto` to its own number of rays, for measurements to which building does not count."""
    spec = parse_spec(text)
    if spec.name != AUTO or KEY in spec.options:
        return text
    return f"{text}{',' if spec.options else ':'}{KEY}={spec.settings[KEY]}"


def with_expected_rays(spec: Spec, sensor: mi.Sensor | None, spp: int | None) -> Spec:
    """`spec`, and if it is `auto` with the rays of the sensor's picture, unless it names a number itself.

    `spp` samples per pixel; None: as many as the sensor says.
    """
    if spec.name != AUTO or KEY in spec.options or sensor is None:
        return spec
    width, height = sensor.film().crop_size()
    rays = int(width) * int(height) * (spp or sensor.sampler().sample_count()) * RAYS_PER_SAMPLE
    return replace(make_spec(AUTO, {**spec.options, KEY: str(rays)}, spec.text), options=spec.options)
