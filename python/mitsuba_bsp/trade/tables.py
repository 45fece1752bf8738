"""The tables of the command `trade`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..inference import Effect, pooled_effect
from ..records import Record
from ..speeds import NONE
from ..streams import KINDS
from ..studies.runs import Quantity, Runs, spec_of
from ..text_table import TextTable
from ..verification.subjects import INCUMBENTS
from .axes import AXES, TREES, UNCAPPED, all_specs
from .failures import DISTANCES
from .found import (
    BUILD,
    BYTES,
    FRAME,
    MILLION,
    RANDOM,
    REFERENCES,
    VERTEX,
    families,
    front,
    mrays,
    points,
    time_of,
    typical,
    work_per_ray,
    worst,
)
from .speeds import RAYS


@dataclass(frozen=True)
class Guarantee:
    """Something that is promised, and the settings that give it up."""

    name: str
    without: str


GUARANTEES = (
    Guarantee("no hit lost: bounds on all errors, over none", "precision=fast"),
    Guarantee("the same, over a fixed epsilon", "precision=epsilon"),
    Guarantee(
        "the closest hit: the search ends where nothing closer can be, over where planes are computed",
        "early_exit=plane",
    ),
    Guarantee("watertight edges: Woop's test, over Moeller and Trumbore's", "triangle_test=mt"),
    Guarantee("all answers those of a loop: both, over neither", "precision=fast,triangle_test=mt"),
    Guarantee("memory: at most 8 references per triangle, over no cap", f"max_references={UNCAPPED:g}"),
    Guarantee("memory: at most 8 references per triangle, over 2", "max_references=2"),
)


def make_tables(rows: Sequence[Record]) -> list[TextTable]:
    """What each guarantee costs, and for every scene speeds, failures, distances and the Pareto front."""
    runs = Runs(rows)
    own = [
        make(runs, scene)
        for scene in runs.scenes
        for make in (_speed_table, _failure_table, _front_table, _distance_table)
    ]
    return [table for table in [_guarantee_table(runs), *own] if table.rows]


def ordered(runs: Runs) -> list[str]:
    """The specs that were measured, in the order of the plan."""
    return runs.ordered(all_specs(TREES, list(AXES), True))


def _guarantee_table(runs: Runs) -> TextTable:
    quantities = (FRAME, VERTEX, RANDOM, BUILD, BYTES)
    lines = []
    for guarantee in GUARANTEES:
        for tree in sorted({spec_of(name).name for name in runs.trees if spec_of(name).is_tree}):
            other = f"{tree}:{guarantee.without}"
            if other in runs.trees and tree in runs.trees:
                costs = (_cost(runs, tree, other, quantity) for quantity in quantities)
                lines.append((guarantee.name, tree, *costs, _failures(runs, tree), _failures(runs, other)))
    return TextTable(
        "What each guarantee costs: percent of the time (or bytes) without it, and failures per million rays",
        ("guarantee", "tree", *(quantity.name for quantity in quantities), "failures with it", "without"),
        tuple(lines),
    )


def _cost(runs: Runs, tree: str, other: str, quantity: Quantity) -> str:
    """What the first costs more than the second, over all scenes and repetitions, with its interval."""
    ratios = [ratio for scene in runs.scenes for ratio in runs.ratios(scene, tree, other, quantity).values()]
    return more(pooled_effect(ratios))


def more(effect: Effect | None) -> str:
    """A ratio as percent more or less, with its interval."""
    if effect is None:
        return NONE
    value, low, high = (100 * (x - 1) for x in (effect.ratio.value, effect.ratio.low, effect.ratio.high))
    return f"{value:+.1f} % [{low:+.1f}, {high:+.1f}]"


def _failures(runs: Runs, tree: str) -> str:
    """Confirmed failures per million rays of the worst family of the worst scene."""
    rates = [rate for scene in runs.scenes if (rate := worst(families(runs, scene, tree)))]
    return per_million(max(rate.confirmed for rate in rates)) if rates else NONE


def per_million(rate: float) -> str:
    """A rate as a number of rays of a million."""
    return f"{MILLION * rate:,.0f}"


def _speed_table(runs: Runs, scene: str) -> TextTable:
    def cells(tree: str) -> tuple[str, ...]:
        row = runs.first(scene, "speed", tree)
        size, references = (typical(runs, scene, tree, quantity) for quantity in (BYTES, REFERENCES))
        count = runs.triangles(scene)
        return (
            *(_number(mrays(runs, scene, tree, time_of((kind,), kind)), ".2f") for kind in RAYS),
            _number(typical(runs, scene, tree, BUILD), ".3f"),
            _number(size and size / count, ".0f"),
            _number(references and references / count, ".2f"),
            _number(row and work_per_ray(row, KINDS, "axis_steps", "oblique_steps"), ".1f"),
            _number(row and work_per_ray(row, KINDS, "triangle_tests"), ".1f"),
        )

    return TextTable(
        f"{runs.title(scene)}: Mrays/s of one thread by kind of ray, and sizes",
        ("spec", *RAYS, "build s", "bytes/tri", "refs/tri", "steps/ray", "tests/ray"),
        tuple((tree, *cells(tree)) for tree in ordered(runs) if runs.first(scene, "speed", tree)),
    )


def _failure_table(runs: Runs, scene: str) -> TextTable:
    lines = []
    for tree in ordered(runs):
        found = families(runs, scene, tree)
        rate = worst(found)
        if rate is None:
            continue
        own = found[rate.family]
        counted = [per_million(own[key] / own["rays"]) for key in ("wrong", "hit_or_miss", "t")]
        bits = [
            per_million(max(f[key] / f["rays"] for f in found.values())) if key in own else NONE
            for key in ("triangle", "bits")
        ]
        lines.append((tree, rate.family, *counted, per_million(rate.confirmed), f"{own['rays']:,}", *bits))
    return TextTable(
        f"{runs.title(scene)}: failures per million rays of the worst family",
        ("spec", "family", "wrong", "hit or miss", "t", "confirmed", "rays", "other triangle", "other bits"),
        tuple(lines),
    )


def _front_table(runs: Runs, scene: str) -> TextTable:
    found = points(runs, scene)
    best = front(found)
    ours = front({tree: point for tree, point in found.items() if tree not in INCUMBENTS})
    return TextTable(
        f"{runs.title(scene)}: the Pareto front, nothing is both faster and less often wrong",
        ("spec", "Mrays/s", "failures per million", "of"),
        tuple(
            (tree, f"{found[tree][1]:.2f}", per_million(found[tree][0]), whose)
            for names, whose in ((best, "all"), (ours, "our trees"))
            for tree in names
        ),
    )


def _distance_table(runs: Runs, scene: str) -> TextTable:
    lines = []
    for tree in ordered(runs):
        row = runs.first(scene, "far", tree)
        if row:
            rates = [worst(place["families"]) for place in row["distances"]]
            lines.append((tree, *(per_million(rate.confirmed) for rate in rates if rate)))
    return TextTable(
        f"{runs.title(scene)}: failures per million rays of the worst family, the scene moved by so many of its sizes",
        ("spec", *(f"{sizes:g}" for sizes in DISTANCES)),
        tuple(lines),
    )


def _number(value: float | None, form: str) -> str:
    return NONE if value is None else format(value, form)
