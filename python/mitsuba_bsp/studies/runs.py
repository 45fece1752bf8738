"""Finds what a study recorded: by scene, measurement, tree and repetition."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from statistics import median
from typing import Literal

from ..inference import Effect, effect_of, noise_limit
from ..records import Record
from ..spec import Spec, parse_spec
from .work import PIXELS


@dataclass(frozen=True)
class Quantity:
    """A number in the records of one measurement, None where an accelerator does not tell."""

    name: str
    measure: Literal["time", "work"]
    read: Callable[[Record], float | None]

    @property
    def counted(self) -> bool:
        """Whether it is the same every time, and not measured."""
        return self.measure == "work"


#: The kinds of rays that ask for the closest hit, and those that ask for any.
CLOSEST, ANY = ("camera", "bounce"), ("shadow",)

#: Counters that differ by no more are called alike: they have no noise, but a difference should matter.
LEAST_DIFFERENCE = 0.01


class Runs:
    """The records of a study; of what was measured twice the newest counts."""

    def __init__(self, rows: Sequence[Record]) -> None:
        self._found: dict[tuple[str, str, str], dict[int, Record]] = {}
        for row in rows:
            key = (str(row["scene"]), str(row["measure"]), str(row["tree"]))
            self._found.setdefault(key, {})[int(row["repeat"])] = row
        size = {str(row["scene"]): int(row["triangles"]) for row in rows}
        self.scenes: tuple[str, ...] = tuple(sorted(size, key=lambda scene: (size[scene], scene)))
        self.trees: tuple[str, ...] = tuple(sorted({str(row["tree"]) for row in rows}))

    def ordered(self, known: Sequence[str]) -> list[str]:
        """The trees: those that are known in that order, then others."""
        place = {tree: number for number, tree in enumerate(known)}
        return sorted(self.trees, key=lambda tree: (place.get(tree, len(place)), tree))

    def get(self, scene: str, measure: str, tree: str) -> Mapping[int, Record]:
        """The records by repetition, in order."""
        found = self._found.get((scene, measure, tree), {})
        return {repeat: found[repeat] for repeat in sorted(found)}

    def first(self, scene: str, measure: str, tree: str) -> Record | None:
        """The record of the first repetition that there is."""
        return next(iter(self.get(scene, measure, tree).values()), None)

    def values(self, scene: str, tree: str, quantity: Quantity) -> dict[int, float]:
        """One quantity, by repetition."""
        found = {repeat: quantity.read(row) for repeat, row in self.get(scene, quantity.measure, tree).items()}
        return {repeat: value for repeat, value in found.items() if value is not None}

    def ratios(self, scene: str, tree: str, other: str | None, quantity: Quantity) -> dict[int, float]:
        """A quantity of one tree over that of another, by repetition; empty if there is no other.

        What is counted once (a tree without a seed has the same counters every time) stands for every repetition.
        """
        ours, theirs = (self.values(scene, name, quantity) if name else {} for name in (tree, other))
        if quantity.counted and len(theirs) == 1:
            theirs = dict.fromkeys(ours, *theirs.values())
        elif quantity.counted and len(ours) == 1:
            ours = dict.fromkeys(theirs, *ours.values())
        pairs = {repeat: (ours[repeat], theirs[repeat]) for repeat in ours if repeat in theirs}
        return {repeat: one / base for repeat, (one, base) in pairs.items() if one > 0 and base > 0}

    def effect(self, scene: str, tree: str, other: str | None, quantity: Quantity) -> Effect | None:
        """What the ratios say."""
        return effect_of(list(self.ratios(scene, tree, other, quantity).values()), quantity.counted)

    def limit(self, scene: str, quantity: Quantity, pairs: int = 1) -> float:
        """What a difference must exceed on a scene: the noise of the medians of a quantity, or what matters of a count.

        The noise is that of trees which are the same every time; `pairs`: of the mean over so many pairs of trees.
        """
        if quantity.counted:
            return LEAST_DIFFERENCE
        timed = [runs for (of, measure, _), runs in self._found.items() if (of, measure) == (scene, quantity.measure)]
        same = [runs for runs in timed if len({run["spec"] for run in runs.values()}) == 1]
        values = [[value for run in runs.values() if (value := quantity.read(run))] for runs in same]
        repeats = round(median(map(len, timed))) if timed else 1
        return noise_limit(values, repeats, pairs)

    def noise(self, scene: str) -> float:
        """That of the times of frames."""
        return self.limit(scene, RENDER)

    def triangles(self, scene: str) -> int:
        """How many a scene has."""
        return int(self._any(scene)["triangles"])

    def title(self, scene: str) -> str:
        """A scene, and how it was rendered."""
        row = self._any(scene)
        width, height = row["resolution"]
        return f"{scene}, {row['triangles']:,} triangles, {width}x{height}, {row['spp']} spp"

    def _any(self, scene: str) -> Record:
        return next(row for (name, _, _), runs in self._found.items() if name == scene for row in runs.values())


@cache
def spec_of(tree: str) -> Spec:
    """The settings of a tree named in a record."""
    return parse_spec(tree)


def per_ray(row: Record, kinds: Sequence[str], *counters: str) -> float | None:
    """The sum of some counters per ray of some kinds; None without such rays."""
    found = [row["counters"][kind] for kind in kinds if kind in row["counters"]]
    rays = sum(kind["rays"] for kind in found)
    return sum(kind[counter] for kind in found for counter in counters) / rays if rays else None


def _hot_spots(row: Record, of: str) -> float:
    pixels = row["pixels"]["cost"][of]
    return float(pixels["quantiles"][99]) / float(pixels["mean"])


def _dearest(row: Record, of: str) -> float:
    return float(row["pixels"]["cost"][of]["quantiles"][99])


def _axis_share(row: Record) -> float | None:
    steps = per_ray(row, CLOSEST, *_STEPS)
    return per_ray(row, CLOSEST, "axis_steps") / steps if steps else None


def _per_filled_leaf(row: Record) -> float | None:
    stats = row["statistics"]
    return stats["references"] / max(1, stats["leaves"] - stats["empty_leaves"]) if stats else None


def _per_triangle(row: Record) -> float | None:
    stats = row["statistics"]
    return stats["references"] / stats["triangles"] if stats else None


_STEPS = ("axis_steps", "oblique_steps")

#: On one thread the processor's time, which others on the machine do not enter; else the time on the clock.
RENDER = Quantity("render time", "time", lambda row: row["render_cpu_s" if row["threads"] == 1 else "render_s"])
BUILD = Quantity("build time", "time", lambda row: row["build_s"])
SIZE = Quantity("bytes", "time", lambda row: row["statistics"].get("bytes"))
TESTS = Quantity("triangle tests", "work", lambda row: per_ray(row, CLOSEST, "triangle_tests"))
STEPS = Quantity("steps", "work", lambda row: per_ray(row, CLOSEST, *_STEPS))
ANY_TESTS = Quantity("triangle tests of shadow rays", "work", lambda row: per_ray(row, ANY, "triangle_tests"))
ANY_STEPS = Quantity("steps of shadow rays", "work", lambda row: per_ray(row, ANY, *_STEPS))
AXIS_STEPS = Quantity("the share of steps in kd nodes", "work", _axis_share)
#: What the dearest percent of the pixels costs at least, and over the mean of all pixels.
DEAREST = {of: Quantity(f"p99 of pixel costs, {PIXELS[of]}", "work", partial(_dearest, of=of)) for of in PIXELS}
HOT_SPOTS = {
    of: Quantity(f"p99 / mean of pixel costs, {PIXELS[of]}", "work", partial(_hot_spots, of=of)) for of in PIXELS
}
LEAF_TRIANGLES = Quantity("triangles of a leaf that is not empty", "work", _per_filled_leaf)
REFERENCES = Quantity("references per triangle", "work", _per_triangle)
