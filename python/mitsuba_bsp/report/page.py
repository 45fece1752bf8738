"""Put the page together: everything in a set of results folders, one part for each machine."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..outcomes import Outcome, outcomes
from ..records import ResultsFolder
from ..text_table import TextTable
from .anatomy import anatomy_table, trees_of
from .charts import Chart, colour_of, levels_chart, times_chart, trade_chart
from .measures import FOREIGN, Measure, measures
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
    """Tables, charts and figures of one command, in one scene or of all scenes together."""

    title: str
    legend: str
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
    charts: list[Chart] = field(default_factory=list)
    trees: list[TextTable] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)


@dataclass
class Machine:
    """All that was measured on one machine with one version of the software."""

    about: Mapping[str, str]
    sentences: list[str]
    wins: list[Win]
    scenes: list[Scene]
    parts: list[Part]


def make_page(folders: Sequence[ResultsFolder], title: str) -> str:
    """The page as HTML. ValueError for a folder whose records cannot be read."""
    from jinja2 import Environment, PackageLoader
    from plotly.offline import get_plotlyjs

    found = [outcome for folder in folders for outcome in _outcomes(folder)]
    by_machine: dict[str, list[Outcome]] = {}
    for outcome in found:
        by_machine.setdefault(json.dumps(outcome.machine), []).append(outcome)
    parts = [_machine(own) for own in by_machine.values()]
    environment = Environment(
        loader=PackageLoader("mitsuba_bsp.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    images = {
        name: data
        for machine in parts
        for scene in machine.scenes
        for shown in scene.renderings
        for name, data in shown.files.items()
    }
    return environment.get_template("report.html").render(
        title=title,
        machines=parts,
        images=images,
        foreign=FOREIGN,
        style=_text("style.css"),
        script=_text("script.js"),
        plotly=get_plotlyjs(),
        kind_of=kind_of,
        colour_of=colour_of,
    )


def kind_of(cell: str) -> str:
    """The class of a table's cell: numbers are aligned to the right."""
    return "number" if cell[:1].isdigit() or cell[:1] in "-+." else "word"


def _text(name: str) -> str:
    return (Path(__file__).parent / "templates" / name).read_text(encoding="utf-8")


def _outcomes(folder: ResultsFolder) -> list[Outcome]:
    try:
        return outcomes(folder)
    except (json.JSONDecodeError, KeyError, TypeError) as error:
        raise ValueError(f"the records in {folder.path} are damaged or of another version: {error!r}") from None


def _machine(found: Sequence[Outcome]) -> Machine:
    timed = [measure for outcome in found for measure in measures(outcome)]
    winners = list(wins(timed))
    names = list(dict.fromkeys(scene.name for outcome in found for scene in outcome.scenes))
    scenes = {name: _scene(name, found, timed) for name in sorted(names)}
    together = []
    for outcome in found:
        for name, part in _parts(outcome):
            (scenes[name].parts if name else together).append(part)
    return Machine(found[0].machine, sentences(winners), winners, list(scenes.values()), together)


def _scene(name: str, found: Sequence[Outcome], timed: Sequence[Measure]) -> Scene:
    info = next(scene for outcome in found for scene in outcome.scenes if scene.name == name)
    own = [measure for measure in timed if measure.scene == name]
    charts = [times_chart(measure) for measure in own]
    building = next((measure for measure in own if measure.is_build), None)
    traced = next((measure for measure in own if not measure.is_build), None)
    if building and traced and (chart := trade_chart(traced, building)):
        charts.append(chart)
    trees = next((trees for outcome in found if (trees := trees_of(outcome, name))), {})
    oblique_first = sorted(trees, key=lambda spec: spec.partition(":")[0] not in ("kd", "normals", "auto"))
    charts += [
        levels_chart(spec, trees[spec]["levels"]) for spec in oblique_first[:_DRAWN] if trees[spec].get("levels")
    ]
    return Scene(
        name,
        f"{info.triangles:,} triangles, scene hash {info.scene_hash[:12]}",
        [shown for outcome in found for shown in renderings(outcome) if shown.scene == name],
        charts,
        [anatomy_table(trees)] if trees else [],
    )


def _parts(outcome: Outcome) -> Iterator[tuple[str, Part]]:
    """What an outcome shows, each with the scene that it is about; an empty name for all together."""
    names = sorted((scene.name for scene in outcome.scenes), key=len, reverse=True)
    parts = {name: Part(f"{outcome.title} ({outcome.folder.path.name})", outcome.legend) for name in ("", *names)}
    for table in outcome.tables():
        parts[_about(table.title, names)].tables.append(table)
    for name, figure in outcome.figures():
        alt = f"Figure “{name}” of {outcome.title}; its numbers are in the tables beside it."
        parts[_about(name, names)].figures.append(Figure(figure_picture(figure), alt))
    yield from ((name, part) for name, part in parts.items() if not part.is_empty)


def _about(text: str, names: Sequence[str]) -> str:
    """The scene that a title or a file's name begins or ends with; empty if none."""
    return next(
        (
            n
            for n in names
            if text == n or text.startswith((f"{n},", f"{n}:", f"{n} ", f"{n}-")) or text.endswith(f"-{n}")
        ),
        "",
    )
