"""Which tree wins where, by how much, and what it costs to build."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from statistics import geometric_mean

from ..intervals import Interval
from ..speeds import BASELINES
from .measures import Measure


@dataclass(frozen=True)
class Win:
    """The best of our trees in one scene, by one measure.

    `others` are its speeds over the foreign accelerators, `second` the next of our trees and `lead` the winner's speed
    over it; `rivals` are all that it does not clearly lead. `build_s` is what the winner takes to build, `builds` that
    over what native takes.
    """

    scene: str
    what: str
    run: str
    spec: str
    time: str
    others: Mapping[str, Interval | None]
    second: str
    lead: Interval | None
    rivals: Sequence[str]
    build_s: float | None
    builds: float | None

    @property
    def is_clear(self) -> bool:
        """Whether the lead over the second is more than the noise of the runs."""
        return self.lead is not None and self.second not in self.rivals


def wins(measures: Sequence[Measure]) -> Iterator[Win]:
    """One for each scene and measure of tracing that has one of our trees."""
    built = [measure for measure in measures if measure.is_build]
    for measure in measures:
        ranking = measure.ranking()
        if measure.is_build or not ranking:
            continue
        best, second = ranking[0], ranking[1] if len(ranking) > 1 else ""
        building = next((b for b in built if b.scene == measure.scene and best in b.times), None)
        yield Win(
            scene=measure.scene,
            what=measure.what,
            run=measure.run,
            spec=best,
            time=measure.time(best),
            others={name: measure.speedup(best, name) for name in BASELINES},
            second=second,
            lead=measure.speedup(best, second) if second else None,
            rivals=[other for other in ranking[1:] if not measure.leads(best, other)],
            build_s=building.median(best) if building else None,
            builds=building.median(best) / building.median("native")
            if building and "native" in building.times
            else None,
        )


def sentences(found: Sequence[Win]) -> list[str]:
    """What the wins of each run say together."""
    texts = []
    for what, run in dict.fromkeys((win.what, win.run) for win in found):
        own = [win for win in found if (win.what, win.run) == (what, run)]
        parts = []
        for name in BASELINES:
            speeds = [speed.value for win in own if (speed := win.others[name])]
            if len(speeds) == len(own):
                parts.append(f"{geometric_mean(speeds):.2f} times as fast as {name}")
        by_tree: dict[str, list[str]] = {}
        for win in own:
            if not win.rivals:
                by_tree.setdefault(win.spec, []).append(win.scene)
        places = [f"{tree} in {', '.join(scenes)}" for tree, scenes in by_tree.items()]
        if tied := [f"{win.scene} ({_tied(win)})" for win in own if win.rivals]:
            places.append(f"no clear winner in {', '.join(tied)}")
        speed = f" is {' and '.join(parts)} (geometric mean)" if parts else ""
        texts.append(f"{_NAMES.get(what, what)} ({run}). The best of our trees{speed}: {'; '.join(places)}.")
    return texts


def _tied(win: Win) -> str:
    """The quickest, and those that are as quick for all that is known."""
    more = f" and {len(win.rivals) - 1} more" if len(win.rivals) > 1 else ""
    return f"{win.spec}, {win.rivals[0]}{more}"


_NAMES = {"rendering": "Rendering", "frame": "Whole frames", "a ray": "Rays alone"}
