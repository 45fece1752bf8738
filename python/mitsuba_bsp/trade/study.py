"""The command `trade` as a plan of measurements."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..messages import choices, hint
from ..studies.study import Cell, Study, StudyOptions
from ..terminal import positive
from ..verification.subjects import INCUMBENTS
from ..verification.subjects import trees as all_trees
from .axes import AXES, TREES, all_specs, moved
from .figures import make_figures
from .tables import make_tables

if TYPE_CHECKING:
    from argparse import _ArgumentGroup as OptionGroup

LEGEND = (
    "One setting at a time is changed from the default, then (--grid) precision, triangle test, leaf size and "
    "directions all together. Speeds are those of one thread, processor time, median of all repetitions in shuffled "
    "order: rays of a frame (camera, shadow, bounce), rays aimed at vertices and random ones. Failures: rays of nine "
    "families aimed where trees fail, of which the worst is shown. wrong: an answer that differs from a loop over all "
    "triangles with the watertight test by a hit or by more of t than rounding explains; confirmed: the exact oracle "
    "in whole numbers does not allow it either (of many wrong rays a sample is held against it); other triangle, other "
    "bits: against the loop with the same triangle test, of our own trees. With no failure of n rays, rates above 3/n "
    "are excluded (95 %)."
)


def add_options(group: OptionGroup) -> Sequence[str]:
    """What is varied, and how much is measured."""
    group.add_argument("--trees", nargs="+", default=TREES, metavar="NAME", help=f"default: {' '.join(TREES)}")
    group.add_argument("--axes", nargs="+", default=tuple(AXES), metavar="AXIS", help=f"default: {' '.join(AXES)}")
    group.add_argument("--grid", action="store_true", help="also every combination of the settings that decide most")
    group.add_argument("--rays", type=positive, default=1000, metavar="N", help="aimed, of a family; %(default)s")
    group.add_argument("--max-rays", type=positive, default=50_000, metavar="N", help="timed, of a kind; %(default)s")
    return ("trees", "axes", "grid", "rays", "max_rays")


def plan(options: StudyOptions) -> list[Cell]:
    """Speeds and failures of everything; failures far from the origin of some. ValueError for an unknown name."""
    trees, axes = options.choices["trees"], options.choices["axes"]
    _check("tree", trees, all_trees())
    _check("axis", axes, list(AXES))
    specs = all_specs(trees, axes, options.choices["grid"])
    far = [*INCUMBENTS, *(spec for tree in trees for spec in moved(tree))]
    return [
        *(Cell("speed", spec, options.repeats) for spec in specs),
        *(Cell("failures", spec) for spec in specs),
        *(Cell("far", spec) for spec in far),
    ]


def _check(what: str, names: Sequence[str], valid: Sequence[str]) -> None:
    for name in names:
        if name not in valid:
            raise ValueError(f'there is no {what} "{name}"{hint(name, valid)} (valid: {choices(valid)})')


STUDY = Study(
    name="trade",
    help="what speed costs in accuracy: one setting at a time and the grid, speeds, failures, figures",
    title="Speed against accuracy",
    legend=LEGEND,
    plan=plan,
    tables=make_tables,
    figures=lambda rows, _: make_figures(rows),
    add_options=add_options,
    repeats=3,
    least_repeats=1,
    repeated="timed runs of each",
)
