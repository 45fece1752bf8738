"""The times that records hold, whichever command made them: repetitions by scene and accelerator."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from operator import itemgetter
from statistics import median

from ..expected_rays import AUTO
from ..inference import adjusted, effect_of, finding, noise_limit
from ..intervals import Interval, median_interval
from ..outcomes import Outcome
from ..records import Record, of
from ..spec import names
from ..studies.runs import BUILD, RENDER, Quantity, spec_of
from ..totals import TotalOptions
from ..trade import found as trade

_Select = Callable[[Sequence[Record]], dict[str, dict[int, float]]]
_Timed = tuple[str, str, _Select]  #: what is timed, in which unit, and how it is found in the records


@dataclass(frozen=True)
class Measure:
    """What was timed in one scene: seconds (of rays: nanoseconds) of every accelerator, by its repetitions.

    A speed is the median of the ratios of repetitions, as in all tables. `varied` are trees that are not the same in
    all repetitions, for they have seeds.
    """

    scene: str
    what: str
    run: str  #: the name of its results folder
    unit: str
    times: Mapping[str, Mapping[int, float]]
    varied: Collection[str] = ()

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
        ratios = self._ratios(over, spec)
        return _median_interval(tuple(ratios)) if ratios else None

    def speed(self, spec: str, over: str) -> float | None:
        """The same without its interval."""
        ratios = self._ratios(over, spec)
        return median(ratios) if ratios else None

    def led(self, spec: str, others: Sequence[str]) -> list[str]:
        """Those of the others that it is quicker than: by more than the noise, and not by chance.

        Chance is corrected for the number of others.
        """
        ratios = [self._ratios(spec, other) for other in others]
        effects = [effect_of(found) for found in ratios]
        noise = {count: self._noise(count) for count in {len(found) for found in ratios if found}}
        return [
            other
            for other, found, effect, p in zip(others, ratios, effects, adjusted(effects), strict=True)
            if effect and finding(effect, p, noise[len(found)]) == "less"
        ]

    def ranking(self) -> list[str]:
        """Our trees that promise their answers, the quickest first; not brute force."""
        return sorted(filter(_competes, self.times), key=self.median)

    def _ratios(self, spec: str, over: str) -> list[float]:
        """One's time over the other's, repetition by repetition of those that both have."""
        ours, theirs = self.times.get(spec, {}), self.times.get(over, {})
        return [ours[repeat] / theirs[repeat] for repeat in ours if repeat in theirs]

    def _noise(self, repeats: int) -> float:
        """By how much medians of so many ratios differ from 1 where nothing differs."""
        same = [list(runs.values()) for spec, runs in self.times.items() if spec not in self.varied]
        return noise_limit(same, repeats)


def measures(outcome: Outcome) -> Iterator[Measure]:
    """All that an outcome timed; nothing if it is about something else."""
    rows = outcome.folder.records()
    for scene in outcome.scenes:
        own = of(rows, scene=scene.name)
        specs: dict[str, set[str]] = {}
        for row in own:
            specs.setdefault(str(row.get("tree", row["spec"])), set()).add(str(row["spec"]))
        varied = [tree for tree, found in specs.items() if len(found) > 1]
        for what, unit, select in _timed(outcome):
            if times := select(own):
                yield Measure(scene.name, what, outcome.folder.path.name, unit, times, varied)


@cache
def _median_interval(values: tuple[float, ...]) -> Interval:
    return median_interval(values)


def _competes(text: str) -> bool:
    spec = spec_of(text)
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


def _pass_s(row: Record) -> float:
    last = row["points"][-1]
    return (last["seconds"] - row["build_s"]) / last["passes"]


def _ray_ns(row: Record) -> float | None:
    seconds = trade.FRAME.read(row)
    return None if seconds is None else 1e9 * seconds


def _totals(options: TotalOptions) -> Iterator[_Timed]:
    """Frames and pictures of scenes that are not turned; a tree that `auto` chose is another for every picture."""

    def frame_s(row: Record, spp: int) -> float:
        measured = min(spp, options.spp or spp)
        return row["frames_s"][str(measured)] * spp / measured

    def fixed(read: Callable[[Record], float | None]) -> _Select:
        return lambda rows: _times(read)(of(rows, turned=False, for_spp=0))

    def picture(spp: int) -> _Select:
        def is_its(row: Record) -> bool:
            return not row["turned"] and row["for_spp"] == (spp if spec_of(row["spec"]).name == AUTO else 0)

        read = _times(lambda row: row["build_s"] + frame_s(row, spp))
        return lambda rows: read([row for row in rows if is_its(row)])

    largest = max(options.samples)
    yield "rendering", "s", fixed(lambda row: frame_s(row, min(largest, options.spp or largest)))
    yield "building", "s", fixed(itemgetter("build_s"))
    for spp in options.samples:
        yield f"building and {spp} spp", "s", picture(spp)


def _timed(outcome: Outcome) -> Sequence[_Timed]:
    """What the command times."""
    if isinstance(outcome.options, TotalOptions):
        return list(_totals(outcome.options))
    studied = _STUDIED if outcome.command.startswith("study ") else ()
    return _TIMES.get(outcome.command, studied)


_BUILDING: _Timed = ("building", "s", _times(_build_s))
_RAYS: _Timed = ("a ray", "ns", _rays)
_STUDIED: Sequence[_Timed] = (("rendering", "s", _of_study(RENDER)), ("building", "s", _of_study(BUILD)))
_TIMES: Mapping[str, Sequence[_Timed]] = {
    "compare": (("rendering", "s", _times(itemgetter("render_s"))), _BUILDING),
    "bench render": (("frame", "s", _times(itemgetter("frame_s"))),),
    "bench rays": (_RAYS,),
    "calibrate": (_RAYS,),
    "bench build": (_BUILDING,),
    "study convergence": (("a pass", "s", _times(_pass_s)), ("building", "s", _times(itemgetter("build_s")))),
    "trade": (
        ("a ray", "ns", _of_study(Quantity("a ray", "speed", _ray_ns))),
        ("building", "s", _of_study(trade.BUILD)),
    ),
}
