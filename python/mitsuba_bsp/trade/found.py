"""Reads the records of the command `trade`: times, sizes and failures of a scene under a spec."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Any

from ..records import Record
from ..streams import KINDS
from ..studies.runs import Quantity, Runs

MILLION = 1e6


@dataclass(frozen=True)
class Rate:
    """Failures of the worst family, per ray; `rays` of that family were tried."""

    family: str
    rays: int
    wrong: float  #: other answers than brute force with the watertight test
    confirmed: float  #: those that the exact oracle does not allow either

    @property
    def shown(self) -> float:
        """Where it is drawn: what is zero, at the rate that this many rays exclude (95 %)."""
        return self.confirmed or 3 / self.rays


def per_ray(row: Record, kinds: Sequence[str]) -> float | None:
    """Seconds of one ray of these kinds; None without such rays."""
    found = [row["streams"][kind] for kind in kinds if kind in row["streams"]]
    rays = sum(kind["rays"] for kind in found)
    return sum(kind["cpu_s"] for kind in found) / rays if rays else None


def work_per_ray(row: Record, kinds: Sequence[str], *counters: str) -> float | None:
    """Steps or tests of one ray of these kinds; None without such rays, or where they are not counted."""
    found = [row["streams"][kind] for kind in kinds if row["streams"].get(kind, {}).get("counters")]
    rays = sum(kind["rays"] for kind in found)
    return sum(kind["counters"][counter] for kind in found for counter in counters) / rays if rays else None


def time_of(kinds: Sequence[str], name: str) -> Quantity:
    """Seconds of one ray as a quantity of `Runs`."""
    return Quantity(name, "speed", lambda row: per_ray(row, kinds))


FRAME = time_of(KINDS, "rays of the frame")
VERTEX = time_of(("vertex",), "aimed at vertices")
RANDOM = time_of(("random",), "random")
BUILD = Quantity("build", "speed", lambda row: row["build_s"])
BYTES = Quantity("bytes", "speed", lambda row: row["bytes"])
REFERENCES = Quantity("references", "speed", lambda row: row["statistics"].get("references"))


def typical(runs: Runs, scene: str, tree: str, quantity: Quantity) -> float | None:
    """The median over the repetitions; None if there are none."""
    values = list(runs.values(scene, tree, quantity).values())
    return median(values) if values else None


def mrays(runs: Runs, scene: str, tree: str, quantity: Quantity = FRAME) -> float | None:
    """Millions of rays a second."""
    time = typical(runs, scene, tree, quantity)
    return 1 / (MILLION * time) if time else None


def families(runs: Runs, scene: str, tree: str) -> Mapping[str, Mapping[str, int]]:
    """The counts of every family in the scene as it is; empty if it was not asked."""
    row = runs.first(scene, "failures", tree)
    return row["families"] if row else {}


def worst(found: Mapping[str, Mapping[str, Any]]) -> Rate | None:
    """The family with most confirmed failures, of equal ones that with most wrong rays; None without any."""
    rates = [
        Rate(family, own["rays"], own["wrong"] / own["rays"], _confirmed(own) / own["rays"])
        for family, own in found.items()
    ]
    return max(rates, key=lambda rate: (rate.confirmed, rate.wrong), default=None)


def _confirmed(own: Mapping[str, int]) -> float:
    """Of all wrong rays of a family, if those that were not checked are like those that were."""
    return own["wrong"] * own["confirmed"] / own["checked"] if own["checked"] else 0.0


def front(points: Mapping[str, tuple[float, float]]) -> list[str]:
    """Names of the points (failures, speed) that no other beats in both, from the fewest failures on."""
    best: list[str] = []
    for name, (_, speed) in sorted(points.items(), key=lambda item: (item[1][0], -item[1][1])):
        if not best or speed > points[best[-1]][1]:
            best.append(name)
    return best


def points(runs: Runs, scene: str) -> dict[str, tuple[float, float]]:
    """Confirmed failures of the worst family, and Mrays/s of the frame's rays, of every spec that has both."""
    found = {}
    for tree in runs.trees:
        rate, speed = worst(families(runs, scene, tree)), mrays(runs, scene, tree)
        if rate and speed:
            found[tree] = (rate.confirmed, speed)
    return found
