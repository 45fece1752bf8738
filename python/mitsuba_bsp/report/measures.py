"""The times that records hold, whichever command made them: repetitions by scene and accelerator."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from statistics import median

from ..intervals import Interval, median_interval
from ..outcomes import Outcome
from ..records import Record, of
from ..spec import names, parse_spec
from ..studies.runs import BUILD, RENDER, Quantity

_Select = Callable[[Sequence[Record]], dict[str, dict[int, float]]]


@dataclass(frozen=True)
class Measure:
    """What was timed in one scene: seconds (of rays: nanoseconds) of every accelerator, by its repetitions.

    A speed is the median of the ratios of repetitions, as in all tables.
    """

    scene: str
    what: str
    run: str  #: the name of its results folder
    unit: str
    times: Mapping[str, Mapping[int, float]]

    @property
    def is_build(self) -> bool:
        return self.what == "building"

    def median(self, spec: str) -> float:
        """Of all repetitions."""
        return median(self.times[spec].values())

    def time(self, spec: str) -> str:
        """Its median in three digits, with the unit."""
        found = self.median(spec)
        return f"{found:,.0f} {self.unit}" if found >= 100 else f"{found:.3g} {self.unit}"

    def spread(self, spec: str) -> tuple[float, float]:
        """The least and the most of all repetitions."""
        return min(self.times[spec].values()), max(self.times[spec].values())

    def speedup(self, spec: str, over: str) -> Interval | None:
        """The other's time over this one's; None if they have no repetition in common."""
        repeats = self._common(spec, over)
        mine, theirs = ([self.times[name][repeat] for repeat in repeats] for name in (spec, over))
        if not repeats:
            return None
        return median_interval([other / own for own, other in zip(mine, theirs, strict=True)])

    def leads(self, spec: str, over: str) -> bool:
        """Whether it is quicker than the other by more than the noise of their repetitions."""
        found = self.speedup(spec, over)
        return found is not None and len(self._common(spec, over)) > 1 and found.low > 1

    def ranking(self) -> list[str]:
        """Our trees that promise their answers, the quickest first; not brute force."""
        return sorted(filter(_competes, self.times), key=self.median)

    def _common(self, spec: str, other: str) -> list[int]:
        theirs = self.times.get(other, {})
        return [repeat for repeat in self.times.get(spec, {}) if repeat in theirs]


def measures(outcome: Outcome) -> Iterator[Measure]:
    """All that an outcome timed; nothing if it is about something else."""
    rows = outcome.folder.records()
    for what, unit, select in _TIMES.get(outcome.command, ()):
        for scene in outcome.scenes:
            times = select(of(rows, scene=scene.name))
            if times:
                yield Measure(scene.name, what, outcome.folder.path.name, unit, times)


def _competes(text: str) -> bool:
    spec = parse_spec(text)
    return spec.is_exact and spec.name != "brute"


def _times(read: Callable[[Record], float | None]) -> _Select:
    """What `read` finds in the records, by accelerator and repetition; in studies a tree of any seed is one."""

    def select(rows: Sequence[Record]) -> dict[str, dict[int, float]]:
        times: dict[str, dict[int, float]] = {}
        for row in rows:  # of repetitions that were made again the last counts
            spec, found = str(row.get("tree", row["spec"])), read(row)
            if found is not None and _is_accelerator(spec) and not row.get("size"):
                times.setdefault(spec, {})[row["repeat"]] = found
        return times

    return select


def _of_study(quantity: Quantity) -> _Select:
    return lambda rows: _times(quantity.read)(of(rows, measure=quantity.measure))


def _build_s(row: Record) -> float | None:
    return None if row["statistics"].get("loaded") else row["build_s"]


def _rays(rows: Sequence[Record]) -> dict[str, dict[int, float]]:
    """The mean over all rays of a frame, each kind by its share in it."""
    rays: dict[str, int] = {str(row["stream"]): row["recorded_rays"] or row["rays"] for row in rows}
    by_stream = {stream: _times(itemgetter("ns_per_ray"))(of(rows, stream=stream)) for stream in rays}
    return {
        spec: {
            repeat: sum(rays[s] * by_stream[s][spec][repeat] for s in rays) / sum(rays.values())
            for repeat in repeats
            if all(repeat in by_stream[s].get(spec, {}) for s in rays)
        }
        for spec, repeats in next(iter(by_stream.values()), {}).items()
    }


def _is_accelerator(spec: str) -> bool:
    """Not the answers that come for free."""
    return spec.partition(":")[0] in names()


_BUILDING = ("building", "s", _times(_build_s))
_TIMES: Mapping[str, Sequence[tuple[str, str, _Select]]] = {
    "compare": (("rendering", "s", _times(itemgetter("render_s"))), _BUILDING),
    "bench render": (("frame", "s", _times(itemgetter("frame_s"))),),
    "bench rays": (("a ray", "ns", _rays),),
    "bench build": (_BUILDING,),
    "study comparison": (("rendering", "s", _of_study(RENDER)), ("building", "s", _of_study(BUILD))),
}
