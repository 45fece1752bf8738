"""What became of measurements: the tables and figures of a results folder, made from what is in it alone.

Records of different machines, or of different versions of the software, are never in the same table.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from . import bench_rays_table, bench_render_table, build_table, calibration, compare_table, thesis_table, totals_table
from .asked import asked, options_of, scenes_of
from .builds import BuildOptions
from .comparison import Failure, Options, SceneInfo
from .figures import save_figure
from .growth_plot import growth_figure
from .records import ResultsFolder, machines, read_lines
from .replays import RayOptions, newest_replay
from .studies import STUDIES, heatmap
from .studies.study import Study, StudyOptions
from .text_table import TextTable, text_markdown
from .totals import TotalOptions
from .trade.study import STUDY as TRADE
from .verification import report as verification

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Figures = Iterator[tuple[str, "Figure"]]


@dataclass(frozen=True)
class Outcome:
    """What one command measured on one machine; `folder` gives only that machine's records."""

    options: Options
    scenes: Sequence[SceneInfo]
    folder: ResultsFolder

    @property
    def command(self) -> str:
        """The command, without `mitsuba-bsp`."""
        return self.options.command

    @property
    def machine(self) -> Mapping[str, str]:
        """The machine, and the versions of the software on it."""
        return self.folder.machine or {}

    @property
    def title(self) -> str:
        return _kind(self.command).title(self)

    @property
    def legend(self) -> str:
        """What the tables show."""
        return _kind(self.command).legend(self)

    def tables(self) -> list[TextTable]:
        """Of everything that is recorded."""
        return _kind(self.command).tables(self)

    def figures(self) -> Figures:
        """Each with its name, which is that of its files."""
        return _kind(self.command).figures(self)


def outcomes(folder: ResultsFolder) -> list[Outcome]:
    """One for each command and machine; ValueError if the folder does not say what was asked of it."""
    rows = folder.records()
    if verification.is_verification(rows):
        options = verification.options(folder)
        return [Outcome(options, (), replace(folder, machine=machine)) for machine in machines(rows)]
    lines = asked(folder)
    if not lines and folder.records_file.exists():
        raise ValueError(
            f"{folder.path} has records, but no {folder.asked_file.name}, which says what was measured: run the "
            f"command again with --out {folder.path} to have it written"
        )
    if lines and str(lines[-1]["command"]) in _STUDIES:
        # The records of a study belong together, whenever they were asked for.
        lines = [{**lines[-1], "scenes": [scene for line in lines for scene in line["scenes"]]}]
    return [
        Outcome(options_of(line, _kind(str(line["command"])).options, folder), scenes_of(line), one)
        for line in lines
        for one in (replace(folder, machine=machine) for machine in machines(rows))
    ]


def write_outcomes(folder: ResultsFolder) -> tuple[list[TextTable], list[Path]]:
    """Write `table.md`, and every figure as PNG and SVG; returns the tables and the PNG files."""
    found = outcomes(folder)
    tables = [outcome.tables() for outcome in found]
    failed = failures(folder)
    parts = [
        text_markdown(outcome.title, outcome.legend, own, failed if outcome is found[-1] else [], outcome.machine)
        for outcome, own in zip(found, tables, strict=True)
    ]
    (folder.path / "table.md").write_text("\n".join(parts), encoding="utf-8")
    files, drawn = [], Counter[str]()
    for outcome in found:
        for name, figure in outcome.figures():
            drawn[name] += 1
            number = f"-{drawn[name]}" if drawn[name] > 1 else ""  # the same figure of another machine
            files.append(save_figure(figure, folder.path, name + number)[0])
    return [table for own in tables for table in own], files


def failures(folder: ResultsFolder) -> list[Failure]:
    """The jobs that failed when they were tried last."""
    return [Failure(**row) for row in read_lines(folder.failures_file)]


@dataclass(frozen=True)
class _Kind:
    """How the records of a command are shown."""

    options: type[Options]
    title: Callable[[Outcome], str]
    legend: Callable[[Outcome], str]
    tables: Callable[[Outcome], list[TextTable]]
    figures: Callable[[Outcome], Figures] = lambda _: iter(())


def _kind(command: str) -> _Kind:
    return _KINDS["study" if command in _STUDIES else command]


def _study(outcome: Outcome) -> Study:
    return _STUDIES[outcome.command]


def _plain(title: str, legend: str, tables: Callable[..., list[TextTable]], options: type[Options]) -> _Kind:
    return _Kind(
        options, lambda _: title, lambda _: legend, lambda found: tables(found.scenes, found.options, found.folder)
    )


def _build_tables(found: Outcome) -> list[TextTable]:
    if not found.options.sizes:
        return build_table.make_build_tables(found.scenes, found.options, found.folder)
    (scene,) = found.scenes
    return build_table.make_growth_tables(scene, build_table.growths(scene, found.options, found.folder))


def _growth_figures(found: Outcome) -> Figures:
    for scene in found.scenes if found.options.sizes else ():
        growths = build_table.growths(scene, found.options, found.folder)
        if any(growth.law for growth in growths):
            yield "growth", growth_figure(f"Building a tree over {scene.name}, tessellated", growths)


def _prices(found: Outcome) -> list[TextTable]:
    rows = [row for scene in found.scenes for row in newest_replay(found.folder, found.options, scene)]
    layout = str(found.options.specs[0].settings["layout"])
    fitted = calibration.fit(calibration.measurements(rows), layout) if rows else None
    return calibration.calibration_tables(fitted) if fitted else []


#: By command.
_STUDIES: Mapping[str, Study] = {
    **{f"study {name}": study for name, study in STUDIES.items()},
    heatmap.STUDY.name: heatmap.STUDY,
    TRADE.name: TRADE,
}

_KINDS: Mapping[str, _Kind] = {
    "compare": _plain("Comparison", compare_table.LEGEND, compare_table.make_tables, Options),
    "bench rays": _plain("Replayed rays", bench_rays_table.LEGEND, bench_rays_table.make_ray_tables, RayOptions),
    "bench render": replace(
        _plain("Whole frames", "", bench_render_table.make_frame_tables, Options),
        legend=lambda found: bench_render_table.legend(found.options.threads),
    ),
    "bench auto": _plain(
        "Building and rendering together", totals_table.LEGEND, totals_table.make_total_tables, TotalOptions
    ),
    "bench thesis": _plain("The thesis's counters", thesis_table.LEGEND, thesis_table.make_thesis_tables, Options),
    "bench build": _Kind(
        BuildOptions,
        title=lambda found: "Growth of building" if found.options.sizes else "Builds",
        legend=lambda found: build_table.GROWTH_LEGEND if found.options.sizes else build_table.LEGEND,
        tables=_build_tables,
        figures=_growth_figures,
    ),
    verification.COMMAND: _Kind(
        Options,
        title=lambda _: "Verification",
        legend=lambda found: verification.legend(found.folder.records()),
        tables=lambda found: verification.tables(found.folder.records()),
    ),
    "calibrate": _Kind(RayOptions, lambda _: "Prices", lambda _: calibration.LEGEND, _prices),
    "study": _Kind(
        StudyOptions,
        title=lambda found: _study(found).title,
        legend=lambda found: _study(found).legend,
        tables=lambda found: _study(found).tables(found.folder.records()),
        figures=lambda found: _study(found).figures(found.folder.records(), found.folder),
    ),
}
