"""Which image of a comparison is held against which, and what came out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from typing import Any

from .exr import read_exr
from .images import compare_images
from .records import ResultsFolder
from .spec import Spec

#: What images are compared with: our first tree with the same triangle test, and the two accelerators of Mitsuba.
REFERENCES = ("trees", "native", "embree")


class Differences:
    """The image comparisons of a finished counting phase, each made once."""

    def __init__(self, folder: ResultsFolder, specs: Sequence[Spec]) -> None:
        self._folder, self._specs = folder, specs
        self._between = cache(self._compare)

    def of(self, scene: str, spec: Spec) -> dict[str, dict[str, Any]]:
        """For each of REFERENCES: `reference` (a spec text) and the fields of ImageDifference.

        There is no entry for a reference that is the spec itself, or is not part of this run, or whose job failed.
        """
        found = {name: self._between(scene, spec.text, other.text) for name, other in self._references(spec).items()}
        return {name: difference for name, difference in found.items() if difference}

    def _references(self, spec: Spec) -> dict[str, Spec]:
        candidates = {
            "trees": [s for s in self._specs if spec.is_tree and s.is_tree and _rules(s) == _rules(spec)],
            "native": [s for s in self._specs if s.name == "native"],
            "embree": [s for s in self._specs if s.name == "embree"],
        }
        return {name: found[0] for name, found in candidates.items() if found and found[0].text != spec.text}

    def _compare(self, scene: str, spec: str, reference: str) -> dict[str, Any]:
        counted = self._folder.counted()
        if (scene, spec) not in counted or (scene, reference) not in counted:
            return {}
        first, second = (read_exr(self._folder.path / str(counted[scene, s]["image"])) for s in (spec, reference))
        return {"reference": reference, **asdict(compare_images(first, second))}


def _rules(spec: Spec) -> object:
    """Trees are only expected to make identical images if they test triangles and meet rounding errors alike."""
    known = spec.settings
    return known.get("triangle_test"), known.get("precision", "safe"), known.get("early_exit", "bound")
