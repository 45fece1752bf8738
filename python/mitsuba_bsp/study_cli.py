"""The commands of the group `mitsuba-bsp study`, one a study, and `heatmap` and `trade`, which work as they do."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from .bench_cli import add_scene_options, frame_options, run_with_bar, show
from .records import ResultsFolder
from .studies import STUDIES, heatmap
from .studies.study import Study, StudyOptions, run_study, specs_of
from .terminal import add_scheduler_option, add_threads_option, chosen_scenes, positive
from .trade.study import STUDY as TRADE

#: Frames of this size and this many samples per pixel are rendered, unless the user says otherwise.
RESOLUTION, SPP = 256, 4


def add_command(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the group and the command."""
    group = commands.add_parser("study", help="the studies of the thesis, completed: records, tables and figures")
    names = group.add_subparsers(title="studies", required=True, metavar="NAME")
    for study in STUDIES.values():
        _add_study(names, study, f"study {study.name}")
    for study in (heatmap.STUDY, TRADE):
        _add_study(commands, study, study.name)


def _add_study(commands: argparse._SubParsersAction[argparse.ArgumentParser], study: Study, command: str) -> None:
    """Add the command of one study."""
    sub = commands.add_parser(study.name, help=study.help, description=study.legend)
    own = sub.add_argument_group("what is studied")
    chosen = study.add_options(own)
    _spell_lists(own)
    if study.repeated:
        own.add_argument(
            "--repeats",
            type=positive,
            default=study.repeats,
            metavar="N",
            help=f"{study.repeated}, {study.least_repeats} or more, default: %(default)s",
        )
    add_scene_options(sub)
    sub.add_argument("--spp", type=positive, default=SPP, metavar="N", help="samples per pixel, %(default)s")
    sub.add_argument(
        "--resolution", type=positive, default=RESOLUTION, metavar="N", help="longer side, default: %(default)s"
    )
    add_threads_option(sub)
    add_scheduler_option(sub)
    sub.set_defaults(run=partial(_study, study, chosen, command), repeats=study.repeats)


def _spell_lists(group: argparse._ArgumentGroup) -> None:
    """Show the defaults of options that take several words as they would be typed."""
    for action in group._group_actions:
        if isinstance(action.default, list | tuple) and action.help:
            action.help = action.help.replace("%(default)s", " ".join(map(str, action.default)))


def _study(study: Study, chosen: Sequence[str], command: str, args: argparse.Namespace) -> int:
    """`mitsuba-bsp study NAME` or `mitsuba-bsp heatmap`."""
    options = StudyOptions(
        **frame_options(args, chosen_scenes(args.scenes), command, study.least_repeats, ()),
        threads=args.threads,
        choices={name: getattr(args, name) for name in chosen},
        command=command,
    )
    options = replace(options, specs=specs_of(study.plan(options)))
    bar, status = run_with_bar(options, partial(run_study, study), args.scheduler)
    if bar.scenes and ResultsFolder(options.out).records():
        show(options.out)
    return status
