"""Put the page together: everything in a set of results folders, one part for each machine."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..comparison import SceneInfo
from ..outcomes import Outcome, outcomes
from ..records import ResultsFolder
from ..speeds import BASELINES
from ..text_table import TextTable
from .anatomy import anatomy_table, trees_of
from .charts import Chart, colour_of, levels_chart, times_chart, trade_chart
from .descriptions import described
from .measures import Measure, measures
from .pictures import Renderings, figure_picture, renderings
from .summary import Win, sentences, wins

#: Trees whose depths are drawn; the others are in the table.
_DRAWN = 3


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
    renderings: list[Renderings] = field(default_factory=list)
    measures: list[Measure] = field(default_factory=list)
    trees: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)

    @property
    def charts(self) -> list[Chart]:
        """Times, what building buys, and the depths of some trees."""
        charts = [times_chart(measure) for measure in self.measures]
        building = next((measure for measure in self.measures if measure.is_build), None)
        traced = next((measure for measure in self.measures if not measure.is_build), None)
        if building and traced and (chart := trade_chart(traced, building)):
            charts.append(chart)
        telling = [spec for spec, tree in self.trees.items() if tree.get("levels")]
        drawn = sorted(telling, key=lambda spec: spec.partition(":")[0] not in ("kd", "normals", "auto"))[:_DRAWN]
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

    `only` is its one results folder, if nothing says whether others of the same name are the same; else empty.
    """

    about: Mapping[str, str]
    only: str
    sentences: Sequence[str]
    wins: Sequence[Win]
    scenes: Sequence[Scene]
    parts: Sequence[Part]


def make_page(folders: Sequence[ResultsFolder], title: str) -> str:
    """The page as HTML. ValueError for a folder whose records cannot be read."""
    from jinja2 import Environment, PackageLoader
    from plotly.offline import get_plotlyjs

    by_machine: dict[tuple[str, str], list[Outcome]] = {}
    runs = _run_names(folders)
    for folder in folders:
        with _reading(folder):
            for outcome in outcomes(folder):
                only = "" if _is_certain(outcome.machine) else runs[folder.path]
                by_machine.setdefault((json.dumps(outcome.machine), only), []).append(outcome)
    machines = [_machine(found, only, runs) for (_, only), found in by_machine.items()]
    images = {
        name: data
        for machine in machines
        for scene in machine.scenes
        for shown in scene.renderings
        for name, data in shown.files.items()
    }
    environment = Environment(
        loader=PackageLoader("mitsuba_bsp.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template("report.html").render(
        title=title,
        machines=machines,
        images=images,
        foreign=BASELINES,
        style=_text("style.css"),
        script=_text("script.js"),
        plotly=get_plotlyjs(),
        kind_of=kind_of,
        colour_of=colour_of,
    )


def kind_of(cell: str) -> str:
    """The class of a table's cell: numbers are aligned to the right."""
    return "number" if cell[:1].isdigit() or cell[:1] in ("-", "+", ".") else "word"


def _text(name: str) -> str:
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


@contextmanager
def _reading(folder: ResultsFolder) -> Iterator[None]:
    """Whatever is wrong with its files becomes a ValueError that names the folder."""
    try:
        yield
    except KeyError as error:
        reason = f"a record has no {error}"
    except (TypeError, AttributeError, IndexError, ArithmeticError) as error:
        reason = str(error)
    except ValueError as error:
        if str(folder.path) in str(error):
            raise
        reason = str(error)
    else:
        return
    raise ValueError(f"the records in {folder.path} are damaged or of another version: {reason}")


def _run_names(folders: Sequence[ResultsFolder]) -> dict[Path, str]:
    """What folders are called: where they are in the folder that has them all."""
    root = os.path.commonpath([folder.path.absolute().parent for folder in folders])
    return {folder.path: str(folder.path.absolute().relative_to(root)) for folder in folders}


def _is_certain(machine: Mapping[str, str]) -> bool:
    """Whether its processor's name is that of one processor: names without a family may be of several."""
    return "(family " in machine["cpu"]


def _machine(found: Sequence[Outcome], only: str, runs: Mapping[Path, str]) -> Machine:
    called = _names(found)
    scenes: dict[str, Scene] = {}
    timed: list[Measure] = []
    together: list[Part] = []
    for outcome in sorted(found, key=lambda one: one.command.startswith("study")):  # they have more trees than others
        with _reading(outcome.folder):
            run = runs[outcome.folder.path]
            parts, timings, pictures = _parts(outcome, run), list(measures(outcome)), renderings(outcome)
            for info in outcome.scenes:
                name = called[info.name, info.scene_hash]
                scene = scenes.setdefault(name, Scene(name, _about(info)))
                own = [replace(timing, scene=name, run=run) for timing in timings if timing.scene == info.name]
                scene.measures += own
                timed += own
                scene.renderings += [shown for shown in pictures if shown.scene == info.name]
                scene.trees = scene.trees or trees_of(outcome, info.name)
                scene.parts += parts.get(info.name, [])
            together += parts.get("", [])
    winners = list(wins(timed))
    shown = [scenes[name] for name in sorted(scenes) if not scenes[name].is_empty]
    return Machine(found[0].machine, only, sentences(winners), winners, shown, together)


def _names(found: Sequence[Outcome]) -> dict[tuple[str, str], str]:
    """What scenes are called, by name and hash: different scenes of one name are told apart."""
    scenes = {(info.name, info.scene_hash) for outcome in found for info in outcome.scenes}
    several = Counter(name for name, _ in scenes)
    return {(name, digest): name if several[name] == 1 else f"{name} {digest[:6]}" for name, digest in scenes}


def _about(info: SceneInfo) -> str:
    return f"{info.triangles:,} triangles, scene hash {info.scene_hash[:12]}"


def _parts(outcome: Outcome, run: str) -> dict[str, list[Part]]:
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
    return {name: [part] for name, part in parts.items() if not part.is_empty}


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
