"""Which tree wins where, by how much, and what it costs to build."""

from __future__ import annotations

from collections import Counter
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
        """Whether it leads all others by more than noise and chance."""
        return self.lead is not None and not self.rivals

    @property
    def tied(self) -> str:
        """Those that are as quick for all that is known."""
        more = f" and {len(self.rivals) - 1} more" if len(self.rivals) > 1 else ""
        return f"{self.rivals[0]}{more}" if self.rivals else ""


def wins(measures: Sequence[Measure]) -> Iterator[Win]:
    """One for each scene and measure of tracing that has one of our trees."""
    built = [measure for measure in measures if measure.is_build]
    for measure in measures:
        ranking = measure.ranking()
        if measure.is_build or not ranking:
            continue
        best, second = ranking[0], ranking[1] if len(ranking) > 1 else ""
        led = measure.led(best, ranking[1:])
        buildings = [b for b in built if b.scene == measure.scene and best in b.times]
        building = next((b for b in buildings if b.run == measure.run), next(iter(buildings), None))
        yield Win(
            scene=measure.scene,
            what=measure.what,
            run=measure.run,
            spec=best,
            time=measure.time(best),
            others={name: measure.speedup(best, name) for name in BASELINES},
            second=second,
            lead=measure.speedup(best, second) if second else None,
            rivals=[other for other in ranking[1:] if other not in led],
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
                by_tree.setdefault(win.spec if win.second else f"{win.spec}, our only one,", []).append(win.scene)
        places = [f"{tree} in {', '.join(scenes)}" for tree, scenes in by_tree.items()]
        if tied := [win for win in own if win.rivals]:
            places.append(f"no clear winner in {_tied(tied, len(own))}")
        speed = f" is {' and '.join(parts)} (geometric mean)" if parts else ""
        texts.append(
            f"{_NAMES.get(what) or what.capitalize()} ({run}). The best of our trees{speed}: {'; '.join(places)}."
        )
    return texts


def _tied(found: Sequence[Win], scenes: int) -> str:
    """Where no tree wins, and which are the quickest there for all that is known."""
    if len(found) <= _FEW:
        return ", ".join(f"{win.scene} ({win.spec}, {win.tied})" for win in found)
    where = f"any of the {scenes} scenes" if len(found) == scenes else f"the other {len(found)} scenes"
    counts = Counter(tree for win in found for tree in (win.spec, *win.rivals))
    most = max(counts.values())
    often = [tree for tree, count in counts.items() if count == most]
    more = f" and {len(often) - _FEW} more" if len(often) > _FEW else ""
    return f"{where}; most often among the quickest ({most} of {len(found)}): {', '.join(often[:_FEW])}{more}"


#: Of so many scenes or trees all are named.
_FEW = 3

_NAMES = {"frame": "Whole frames", "a ray": "Rays alone", "a pass": "Passes of a picture"}
