"""Section 5.3 of the thesis: all trees, Mitsuba's kd-tree and Embree, beside what was published.

Every tree is built three ways: by the thesis's rules, and by ours with nodes of one plane (binary) and of seven (wide).
Percent are always of `kd` built the same way.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from typing import TYPE_CHECKING

from ..inference import Effect, adjusted, finding
from ..intervals import median_interval
from ..records import Record, ResultsFolder
from ..spec import parse_spec, with_setting
from ..speeds import NONE
from ..text_table import TextTable
from ..thesis import PUBLISHED, PUBLISHED_TREES, published_scene
from .runs import (
    ANY_STEPS,
    ANY_TESTS,
    AXIS_STEPS,
    BUILD,
    RENDER,
    SIZE,
    STEPS,
    TESTS,
    Quantity,
    Runs,
    spec_of,
)
from .study import Cell, Study, StudyOptions, timed_and_counted
from .tree_shapes import shape_tables
from .verdicts import Evidence, Verdict, judge, percent

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

    from matplotlib.figure import Figure

#: How trees are built, by what is added to their specs.
WAYS = {"thesis": "cost=thesis", "binary": "layout=binary", "wide": ""}

#: What is compared with what was published, as the thesis abbreviates it.
PUBLISHED_QUANTITIES: dict[str, Quantity] = {
    "R": RENDER,
    "B": BUILD,
    "I": TESTS,
    "T": STEPS,
}

#: Published percentages nearer to 100 than this claim no difference.
_NO_CLAIM = 2

_LEGEND = (
    "Times are medians with 95 % bootstrap intervals; percent are of kd built the same way (cost=thesis; "
    "layout=binary; or by default). I and T are triangle tests and interior steps of closest-hit rays, of camera and "
    "bounces, in one frame; any: those of shadow rays; kd steps: the share of steps in kd nodes. R is render time, B "
    "build time. A verdict on what was published needs the same rules (cost=thesis) and the same scene, and a "
    "difference beyond the noise of the scene: that of as many runs of one and the same tree, at least 5 %; of "
    "counters, which have none, 1 %. It is on the direction alone; the last column says whether the published number "
    "is within what was found. Probabilities are corrected for the number of comparisons on the scene (Benjamini, "
    "Hochberg)."
)


def same_tree(one: str, other: str) -> bool:
    """Whether two specs mean the same, however they are written."""
    return spec_of(one).full == spec_of(other).full


def as_measured(runs: Runs, tree: str) -> str:
    """The tree as it is called in the records, if it is there."""
    return next((known for known in runs.trees if same_tree(known, tree)), tree)


def default_trees() -> list[str]:
    """Every tree, built every way."""
    return [with_setting(tree, added) for added in WAYS.values() for tree in ("kd", *PUBLISHED_TREES)]


def add_options(group: OptionGroup) -> Sequence[str]:
    """Which accelerators."""
    group.add_argument("--specs", nargs="+", metavar="SPEC", help="default: native, embree, every tree built 3 ways")
    return ("specs",)


def plan(options: StudyOptions) -> list[Cell]:
    """Times and work of all; seeded trees with another seed each time."""
    specs = options.choices["specs"] or ["native", "embree", *default_trees()]
    for text in specs:
        if parse_spec(text).name == "brute":
            raise ValueError("brute is no tree to be compared: leave it out of --specs")
    return timed_and_counted(list(dict.fromkeys(specs)), options.repeats)


def way_of(tree: str) -> str:
    """How a tree is built: one of WAYS; Mitsuba's own accelerators count as the last, our default."""
    settings = spec_of(tree).settings
    if settings.get("cost") == "thesis":
        return "thesis"
    return str(settings.get("layout", "wide"))


def baseline_of(runs: Runs, tree: str) -> str | None:
    """The kd that is built the same way, if it is there."""
    return next((t for t in runs.trees if spec_of(t).name == "kd" and way_of(t) == way_of(tree)), None)


def tables(rows: Sequence[Record]) -> list[TextTable]:
    """Per scene: times and counters, published percentages, shapes of trees; and a verdict on every claim."""
    runs = Runs(rows)
    found = [Findings(runs, scene) for scene in runs.scenes]
    published = [table for own in found for table in _published_tables(own)]
    shapes = [table for scene in runs.scenes for table in shape_tables(runs, scene, _ordered(runs))]
    return [*(_scene_table(own) for own in found), *published, *_verdict_tables(found), *shapes]


class Findings:
    """All effects of one scene against kd built the same way, their probabilities corrected together."""

    def __init__(self, runs: Runs, scene: str) -> None:
        self.runs, self.scene = runs, scene
        self.published_scene, self.same_scene = published_scene(scene, runs.triangles(scene)) or ("", False)
        self._effects = {
            (tree, name): effect
            for tree in _ordered(runs)
            for name, quantity in PUBLISHED_QUANTITIES.items()
            if (kd := baseline_of(runs, tree)) and (effect := runs.effect(scene, tree, kd, quantity))
        }
        self._p = dict(zip(self._effects, adjusted(list(self._effects.values())), strict=True))

    def evidence(self, tree: str, name: str) -> Evidence | None:
        """How a quantity of a tree differs from kd's."""
        effect = self._effects.get((tree, name))
        if effect is None:
            return None
        p = self._p[tree, name]
        quantity = PUBLISHED_QUANTITIES[name]
        return Evidence(self.scene, effect, p, finding(effect, p, self.limit(name), quantity.counted))

    def limit(self, name: str) -> float:
        """What a difference of one of PUBLISHED_QUANTITIES must exceed."""
        return self.runs.limit(self.scene, PUBLISHED_QUANTITIES[name])

    def published(self, tree: str) -> dict[str, float]:
        """What the thesis says about a tree on the scene, or on the one that it stands in for, in percent of kd's."""
        trees = PUBLISHED.get(self.published_scene, {})
        found = next((trees[known] for known in trees if same_tree(known, tree)), None)
        return {"R": found.render, "B": 100 * found.build, "I": found.tests, "T": found.steps} if found else {}


def _ordered(runs: Runs) -> list[str]:
    """Mitsuba's own first, then ours as they are listed in the plan."""
    return runs.ordered(["native", "embree", *default_trees()])


def _scene_table(found: Findings) -> TextTable:
    runs, scene = found.runs, found.scene

    def cells(tree: str) -> tuple[str, ...]:
        effect = found.evidence(tree, "R")
        return (
            _median(runs, scene, tree, BUILD, ".3g"),
            _interval(list(runs.values(scene, tree, RENDER).values())),
            percent(effect.effect if effect else None),
            *(_median(runs, scene, tree, quantity, ".2f") for quantity in _COUNTERS),
            _median(runs, scene, tree, SIZE, ".1f", 1e-6),
            _median(runs, scene, tree, AXIS_STEPS, ".0%"),
        )

    return TextTable(
        f"{runs.title(scene)} (noise {runs.noise(scene):.1%})",
        ("spec", "build s", "render s", "R %", "I", "T", "any I", "any T", "MB", "kd steps"),
        tuple((tree, *cells(tree)) for tree in _ordered(runs)),
    )


_COUNTERS: tuple[Quantity, ...] = (TESTS, STEPS, ANY_TESTS, ANY_STEPS)


def _published_tables(found: Findings) -> Iterator[TextTable]:
    """Ours and the thesis's percentages of R, B, I and T."""
    trees = [tree for tree in _ordered(found.runs) if found.published(tree)]
    if not trees:
        return

    def cells(tree: str) -> Iterator[str]:
        for name, value in found.published(tree).items():
            own = found.evidence(tree, name)
            yield f"{100 * own.effect.ratio.value:.0f}" if own else NONE
            yield f"{value:g}"

    head = (f"{name}{suffix}" for name in "RBIT" for suffix in (" %", " thesis"))
    title = f"{found.scene} beside the thesis's {found.published_scene}{'' if found.same_scene else ' (another scene)'}"
    yield TextTable(title, ("spec", *head), tuple((tree, *cells(tree)) for tree in trees))


def _verdict_tables(found: Sequence[Findings]) -> Iterator[TextTable]:
    """A verdict for every published number that claims a difference, and one for each tree over all scenes."""
    rows = []
    for tree in _ordered(found[0].runs):
        for name in PUBLISHED_QUANTITIES:
            rows += _verdict_rows(tree, name, found)
    if rows:
        yield TextTable(
            "what was published, and what is found", ("spec", "", "claim", "verdict", "why", "published"), tuple(rows)
        )


def _verdict_rows(tree: str, name: str, found: Sequence[Findings]) -> Iterator[tuple[str, ...]]:
    """One row for the scenes on which a quantity was published as smaller than kd's, and one for the others."""
    by_claim: dict[str, list[Evidence]] = {"less": [], "more": []}
    sizes: dict[str, list[str]] = {"less": [], "more": []}
    foreign: dict[str, list[str]] = {"less": [], "more": []}
    for own in found:
        value, evidence = own.published(tree).get(name, 100), own.evidence(tree, name)
        if evidence is None or abs(value - 100) < _NO_CLAIM:
            continue
        claim = "less" if value < 100 else "more"
        if own.same_scene:
            by_claim[claim].append(evidence)
            sizes[claim].append(f"{own.scene} {_beside(evidence.effect, value / 100, own.limit(name))}")
        else:
            foreign[claim].append(f"{own.scene} {100 * evidence.effect.ratio.value:.0f} %")
    for claim, evidence in by_claim.items():
        if not evidence and not foreign[claim]:
            continue
        verdict = judge(claim, evidence) if evidence else Verdict("open", "only other scenes were measured")
        also = f"; another scene: {', '.join(foreign[claim])}" if foreign[claim] else ""
        yield tree, name, f"{claim} than kd", verdict.word, verdict.why + also, "; ".join(sizes[claim]) or NONE


def _beside(effect: Effect, published: float, limit: float) -> str:
    """Whether a published ratio is within what was found, widened by the limit."""
    low, high = effect.ratio.low / (1 + limit), effect.ratio.high * (1 + limit)
    place = "as here" if low <= published <= high else "less than here" if published < low else "more than here"
    return f"{100 * published:g} %: {place}"


def _interval(values: Sequence[float]) -> str:
    if not values:
        return NONE
    found = median_interval(values)
    return f"{found.value:.3g} [{found.low:.3g}, {found.high:.3g}]"


def _median(runs: Runs, scene: str, tree: str, quantity: Quantity, form: str, scale: float = 1) -> str:
    values = runs.values(scene, tree, quantity).values()
    return format(scale * median(values), form) if values else NONE


def figures(rows: Sequence[Record], _: ResultsFolder) -> Iterator[tuple[str, Figure]]:
    """Percent of kd beside the thesis's, and what the trees look like by depth."""
    from .comparison_figures import depth_figure, percent_figure

    runs = Runs(rows)
    yield "comparison", percent_figure(runs)
    yield "comparison-depth", depth_figure(runs)


STUDY = Study(
    name="comparison",
    help="all trees, native and embree, beside what the thesis published (section 5.3)",
    title="All trees compared",
    legend=_LEGEND,
    plan=plan,
    tables=tables,
    figures=figures,
    add_options=add_options,
    repeats=5,
    least_repeats=3,
    repeated="runs of each, with other seeds where trees have one",
)
