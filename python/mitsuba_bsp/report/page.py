"""Put the page together: everything in a set of results folders, one part for each machine."""

from __future__ import annotations

import json
import os
import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..comparison import Failure, SceneInfo
from ..messages import amount, one_sentence
from ..outcomes import Outcome, failures, outcomes
from ..records import Record, ResultsFolder
from ..speeds import BASELINES
from ..text_table import TextTable
from .anatomy import anatomy_table, trees_of
from .charts import Chart, colour_of, levels_chart, order_of, times_chart, trade_chart
from .descriptions import described
from .measures import Measure, measures
from .pictures import Picture, Renderings, figure_picture, renderings
from .summary import Win, sentences, wins

if TYPE_CHECKING:
    from markupsafe import Markup

#: Trees whose depths are drawn; the others are in the table.
_DRAWN = 3
_TELLING = ("kd", "normals", "auto")


@dataclass(frozen=True)
class Figure:
    """A picture with what it shows in words."""

    source: str
    alt: str


@dataclass
class Part:
    """Tables and figures of one command, in one scene or of all scenes together; `made` says how they were measured."""

    title: str
    legend: str
    made: str
    tables: list[TextTable] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        return not self.tables and not self.figures


@dataclass
class Scene:
    """All about one scene on one machine."""

    name: str
    about: str
    picture: Picture | None = None  #: where others rendered the same scene, if there are no renderings
    renderings: list[Renderings] = field(default_factory=list)
    measures: list[Measure] = field(default_factory=list)
    trees: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)

    @property
    def charts(self) -> list[Chart]:
        """Times, what building buys in each run, and the depths of some trees."""
        charts = [times_chart(measure) for measure in self.measures]
        building = {measure.run: measure for measure in reversed(self.measures) if measure.is_build}
        traced = {measure.run: measure for measure in reversed(self.measures) if not measure.is_build}
        pairs = [(traced[run], building[run]) for run in traced if run in building]
        if traced and building and not pairs:
            pairs = [(list(traced.values())[-1], list(building.values())[-1])]
        charts += [chart for pair in reversed(pairs) if (chart := trade_chart(*pair))]
        telling = [spec for spec, tree in self.trees.items() if tree.get("levels")]
        drawn = sorted(telling, key=lambda spec: (spec.partition(":")[0] not in _TELLING, order_of(spec)))[:_DRAWN]
        return charts + [levels_chart(spec, self.trees[spec]["levels"]) for spec in drawn]

    @property
    def anatomy(self) -> list[TextTable]:
        return [anatomy_table(self.trees)] if self.trees else []

    @property
    def is_empty(self) -> bool:
        """Whether nothing was measured in it on this machine."""
        return not (self.renderings or self.measures or self.trees or self.parts)


@dataclass(frozen=True)
class Machine:
    """All that was measured on one machine with one version of the software.

    `only` is its one results folder, if nothing says whether others of the same name are the same; else empty. `runs`
    are all its folders, `notes` what went wrong there. `is_timed`: some tracing was.
    """

    about: Mapping[str, str]
    only: str
    runs: Sequence[str]
    notes: Sequence[str]
    is_timed: bool
    wins: Sequence[Win]
    scenes: Sequence[Scene]
    parts: Sequence[Part]

    @property
    def sentences(self) -> list[str]:
        return sentences(self.wins)

    @property
    def is_built(self) -> bool:
        """Whether it is known what a winner takes to build."""
        return any(win.build_s is not None for win in self.wins)

    @property
    def has_several_runs(self) -> bool:
        """Whether the wins are of more than one run, or by more than one measure."""
        return len({(win.what, win.run) for win in self.wins}) > 1


@dataclass(frozen=True)
class _Found:
    """All that an outcome shows; `parts` by scene, `failed` are its jobs that failed."""

    outcome: Outcome
    run: str
    parts: Mapping[str, Part]
    measures: Sequence[Measure]
    renderings: Sequence[Renderings]
    trees: Mapping[str, Mapping[str, Any]]
    failed: Sequence[Failure]


@dataclass(frozen=True)
class _Folder(ResultsFolder):
    """Reads its records once, as tables and figures ask for them again and again."""

    rows: dict[str, list[Record]] = field(default_factory=dict, compare=False)

    def records(self) -> list[Record]:
        key = json.dumps(self.machine)
        if key not in self.rows:
            self.rows[key] = super().records()
        return self.rows[key]


def make_page(
    folders: Sequence[ResultsFolder],
    title: str,
    begin: Callable[[str], None] = lambda _: None,
    note: Callable[[str], None] = lambda _: None,
) -> str:
    """The page as HTML; a folder that cannot be shown is named there instead. ValueError if none can be.

    `begin` is told the name of every folder, `note` what is left out.
    """
    from jinja2 import Environment, PackageLoader
    from plotly.offline import get_plotlyjs

    found, left_out = _all_found(folders, begin)
    if not found:
        raise ValueError(left_out[0])
    for sentence in left_out:
        note(sentence)
    by_machine: dict[tuple[str, str], list[_Found]] = {}
    for one in found:
        only = "" if _is_certain(one.outcome.machine) else one.run
        by_machine.setdefault((json.dumps(one.outcome.machine), only), []).append(one)
    pictures = _pictures(found)
    machines = [_machine(own, only, pictures) for (_, only), own in by_machine.items()]
    machines.sort(key=lambda machine: (-sum(win.is_clear for win in machine.wins), not machine.wins))
    environment = Environment(
        loader=PackageLoader("mitsuba_bsp.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html").render(
        title=title,
        machines=machines,
        left_out=left_out,
        images={name: data for one in found for shown in one.renderings for name, data in shown.files.items()},
        foreign=BASELINES,
        style=_text("style.css"),
        script=_text("script.js"),
        plotly=get_plotlyjs(),
        kind_of=kind_of,
        colour_of=colour_of,
        breakable=breakable,
    )


def kind_of(cell: str) -> str:
    """The class of a table's cell: numbers are aligned to the right."""
    return "number" if cell[:1].isdigit() or cell[:1] in ("-", "+", ".") else "word"


def breakable(text: str) -> Markup:
    """A spec that may be broken before its settings."""
    from markupsafe import Markup

    return Markup("<wbr>").join(re.split("(?<=[:,])", text))


def _text(name: str) -> str:
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


def _all_found(folders: Sequence[ResultsFolder], begin: Callable[[str], None]) -> tuple[list[_Found], list[str]]:
    """What is in the folders, and a sentence for each that cannot be shown."""
    found: list[_Found] = []
    left_out = []
    names = _run_names(folders)
    for folder in folders:
        begin(names[folder.path])
        try:
            with _reading(folder):
                found += _found(folder, names[folder.path])
        except ValueError as error:
            left_out.append(one_sentence(error))
    return found, left_out


@contextmanager
def _reading(folder: ResultsFolder) -> Iterator[None]:
    """Whatever is wrong with its files becomes a ValueError that names the folder."""
    try:
        yield
    except ImportError:
        raise
    except Exception as error:
        if isinstance(error, (ValueError, OSError)) and str(folder.path) in str(error):
            raise ValueError(str(error)) from None
        reason = f"a record has no {error}" if isinstance(error, KeyError) else one_sentence(error)
        raise ValueError(f"the records in {folder.path} are damaged or of another version: {reason}") from error


def _found(folder: ResultsFolder, run: str) -> list[_Found]:
    """One for every outcome; the jobs that failed are with the last."""
    known = outcomes(_Folder(folder.path))
    if not known:
        raise ValueError(f"there are no records in {folder.path} yet")
    failed = list(dict.fromkeys(failures(folder)))
    return [
        _Found(
            outcome,
            run,
            _parts(outcome, run, failed if outcome is known[-1] else ()),
            list(measures(outcome)),
            renderings(outcome),
            trees_of(outcome),
            failed if outcome is known[-1] else (),
        )
        for outcome in known
    ]


def _pictures(found: Sequence[_Found]) -> dict[str, Picture]:
    """One of every scene that was rendered, by its hash."""
    pictures: dict[str, Picture] = {}
    for one in found:
        digests = {info.name: info.scene_hash for info in one.outcome.scenes}
        for shown in one.renderings:
            spec, name = next(iter(shown.specs.items()))
            about = f"{shown.scene}, rendered under {spec} ({one.run})"
            pictures.setdefault(digests[shown.scene], Picture(name, about))
    return pictures


def _run_names(folders: Sequence[ResultsFolder]) -> dict[Path, str]:
    """What folders are called: where they are in the folder that has them all."""
    root = os.path.commonpath([folder.path.absolute().parent for folder in folders])
    return {folder.path: str(folder.path.absolute().relative_to(root)) for folder in folders}


def _is_certain(machine: Mapping[str, str]) -> bool:
    """Whether its processor's name is that of one processor: names without a family may be of several."""
    return "(family " in machine["cpu"]


def _machine(found: Sequence[_Found], only: str, pictures: Mapping[str, Picture]) -> Machine:
    called = _names([one.outcome for one in found])
    scenes: dict[str, Scene] = {}
    timed: list[Measure] = []
    together: list[Part] = []
    for one in sorted(found, key=lambda one: one.outcome.command.startswith("study")):  # they have more trees
        for info in one.outcome.scenes:
            name = called[info.name, info.scene_hash]
            scene = scenes.setdefault(name, Scene(name, _about(info), pictures.get(info.scene_hash)))
            own = [replace(timing, scene=name, run=one.run) for timing in one.measures if timing.scene == info.name]
            scene.measures += own
            timed += own
            scene.renderings += [shown for shown in one.renderings if shown.scene == info.name]
            scene.trees = scene.trees or one.trees.get(info.name, {})
            scene.parts += [one.parts[info.name]] if info.name in one.parts else []
        together += [one.parts[""]] if "" in one.parts else []
    return Machine(
        about=found[0].outcome.machine,
        only=only,
        runs=list(dict.fromkeys(one.run for one in found)),
        notes=[f"{amount(len(one.failed), 'job')} failed in {one.run}" for one in found if one.failed],
        is_timed=any(not timing.is_build for timing in timed),
        wins=list(wins(timed)),
        scenes=[scenes[name] for name in sorted(scenes) if not scenes[name].is_empty],
        parts=together,
    )


def _names(found: Sequence[Outcome]) -> dict[tuple[str, str], str]:
    """What scenes are called, by name and hash: different scenes of one name are told apart."""
    scenes = {(info.name, info.scene_hash) for outcome in found for info in outcome.scenes}
    several = Counter(name for name, _ in scenes)
    return {(name, digest): name if several[name] == 1 else f"{name} {digest[:6]}" for name, digest in scenes}


def _about(info: SceneInfo) -> str:
    return f"{info.triangles:,} triangles, scene hash {info.scene_hash[:12]}"


def _parts(outcome: Outcome, run: str, failed: Sequence[Failure]) -> dict[str, Part]:
    """What an outcome shows, by the scene that it is about; an empty name for all together."""
    names = sorted((scene.name for scene in outcome.scenes), key=len, reverse=True)
    title = f"{outcome.title} ({run})"
    parts = {name: Part(title, outcome.legend, _made(outcome, name)) for name in ("", *names)}
    tables = [(_subject(table.title, names), table) for table in outcome.tables()]
    for scene, table in tables:
        parts[scene].tables.append(table)
    subjects = {scene for scene, _ in tables}
    home = subjects.pop() if len(subjects) == 1 else ""  # figures that name no scene are beside their tables
    for name, figure in outcome.figures():
        scene, shown = described(name, outcome.title, names)
        parts[scene or home].figures.append(Figure(figure_picture(figure), shown))
    for name, part in parts.items():
        rows = [(f.scene, f.spec, f.message) for f in failed if (f.scene if f.scene in names else "") == name]
        if rows:
            part.tables.append(TextTable("Failed jobs", ("scene", "spec", "reason"), tuple(rows), words=True))
    return {name: part for name, part in parts.items() if not part.is_empty}


def _made(outcome: Outcome, name: str) -> str:
    """How it was measured: the command and what it was given, the machine and the versions on it."""
    options = outcome.options
    sizes = [f"{'x'.join(map(str, s.resolution))}, {s.spp} spp" for s in outcome.scenes if s.name == name]
    given = [
        options.variant,
        *sizes,
        f"{options.threads} {'threads' if options.threads > 1 else 'thread'}" if options.threads else "",
        *(f"{key}={value}" for key, value in options.params.items()),
    ]
    about = ", ".join(f"{key} {value}" for key, value in outcome.machine.items())
    return f"mitsuba-bsp {outcome.command}: {', '.join(filter(None, given))}. {about}."


def _subject(text: str, names: Sequence[str]) -> str:
    """The scene that a table's title begins with; empty if none."""
    return next((n for n in names if text == n or text.startswith((f"{n},", f"{n}:", f"{n} "))), "")
