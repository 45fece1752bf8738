"""The command `mitsuba-bsp`: the only part of the package that prints and exits."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from . import (
    bench_auto_cli,
    bench_build_cli,
    bench_rays_cli,
    bench_render_cli,
    bench_thesis_cli,
    calibrate_cli,
    diff_cli,
    plugin_dir,
    report_cli,
    specs,
    study_cli,
    tables_cli,
    verify_cli,
)
from .bench_cli import add_spec_option, frame_options, run_with_bar, show
from .compare import compare
from .comparison import MIN_REPEATS, Options
from .jobs import Job, JobError, JobResult, run_job
from .messages import one_sentence
from .passes import PASSES, render_in_passes
from .provenance import made_by
from .records import ResultsFolder
from .scene_content import Content, notes
from .scheduling import image_scheduler_at
from .spec import parse_spec, value_text
from .terminal import (
    BAD_INPUT,
    INTERRUPTED,
    OK,
    ProgressBar,
    add_loading_options,
    add_scheduler_option,
    add_threads_option,
    chosen_scenes,
    err,
    out,
    positive,
    say,
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    args = _parser().parse_args(arguments)
    try:
        status = args.run(args)
    except (ValueError, OSError) as error:
        say("error", one_sentence(error), "red")
        status = BAD_INPUT
    except KeyboardInterrupt:
        say("interrupted", "no image was written", "red")
        status = INTERRUPTED
    sys.exit(status)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="mitsuba-bsp", description=__doc__.partition(":")[0])
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    sub = commands.add_parser("compare", help="render scenes under several accelerators and compare images and times")
    sub.add_argument("scenes", nargs="*", type=Path, metavar="SCENE.xml", help="default: the built-in scenes")
    add_spec_option(sub)
    sub.add_argument("--repeats", type=positive, default=MIN_REPEATS, metavar="N", help="timed runs of each, 3 or more")
    sub.add_argument("--out", type=Path, metavar="DIR", help="results folder; if it has results, go on from there")
    _add_render_options(sub)
    sub.set_defaults(run=_compare)

    sub = commands.add_parser("render", help="render one scene under one accelerator")
    sub.add_argument("scene", type=Path, metavar="SCENE.xml")
    sub.add_argument("--spec", default="auto", metavar="SPEC", help="default: %(default)s")
    sub.add_argument("-o", "--output", type=Path, required=True, metavar="IMAGE", help="an .exr or .png file")
    sub.add_argument("--seed", type=_seed, default=0, metavar="N", help="default: %(default)s")
    sub.add_argument(
        "--passes",
        type=positive,
        metavar="N",
        help="split the samples into passes with seeds of their own, each on one thread, for the same pixels here and "
        f"on any cluster; default: none, all threads; with --scheduler {PASSES}",
    )
    _add_render_options(sub)
    sub.set_defaults(run=_render)

    bench = commands.add_parser("bench", help="measure one part of rendering at a time")
    kinds = bench.add_subparsers(title="what is measured", required=True, metavar="WHAT")
    for kind in (bench_rays_cli, bench_render_cli, bench_build_cli, bench_auto_cli, bench_thesis_cli):
        kind.add_command(kinds)
    calibrate_cli.add_command(commands)
    study_cli.add_command(commands)
    tables_cli.add_command(commands)
    report_cli.add_command(commands)
    diff_cli.add_command(commands)
    verify_cli.add_command(commands)

    sub = commands.add_parser("specs", help="list the accelerators and their settings")
    sub.set_defaults(run=_list_specs)
    sub = commands.add_parser("plugin-dir", help="print the folder for the stock command: mitsuba -a DIR scene.xml")
    sub.set_defaults(run=_print_plugin_dir)
    return parser


def _add_render_options(sub: argparse.ArgumentParser) -> None:
    add_loading_options(sub)
    sub.add_argument("--spp", type=positive, metavar="N", help="samples per pixel, default: the scene's")
    sub.add_argument("--resolution", type=positive, metavar="N", help="longer side in pixels, default: the scene's")
    add_threads_option(sub)
    add_scheduler_option(sub)
    sub.add_argument(
        "--cache", type=Path, metavar="DIR", help="keep built trees there and load them; default: build every time"
    )


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text} is not an integer from 0 to 2^32 - 1")
    return int(text)


def _compare(args: argparse.Namespace) -> int:
    """`mitsuba-bsp compare`."""
    options = Options(
        **frame_options(args, chosen_scenes(args.scenes), "compare", MIN_REPEATS, args.specs),
        threads=args.threads,
        cache=args.cache,
    )
    bar, status = run_with_bar(options, compare, args.scheduler)
    if bar.scenes:
        show(options.out)
    return status


def _render(args: argparse.Namespace) -> int:
    """`mitsuba-bsp render`."""
    spec = parse_spec(args.spec)
    if args.output.suffix not in (".exr", ".png"):
        raise ValueError(f"{args.output} ends neither in .exr nor in .png")
    if not args.scene.is_file():
        raise ValueError(f"there is no scene file {args.scene}")
    ResultsFolder(args.output.parent).check_writable()
    job = Job(
        kind="render",
        scene=str(args.scene.absolute()),
        variant=args.variant,
        spec=spec.text,
        params=dict(args.params),
        spp=args.spp,
        resolution=args.resolution,
        seed=args.seed,
        threads=args.threads,
        image=str(args.output.absolute()),
        header=made_by(args.scene.stem, spec),
        cache=str(args.cache or ""),
    )
    try:
        result = _rendered(job, args)
    except JobError as error:
        raise ValueError(str(error)) from None
    said = notes(Content(**result.values["content"]), [spec.name]) if spec.plugin else []
    for note in [*said, *result.warnings]:
        say("note", note, "yellow")
    how = "loaded" if result.values["statistics"].get("loaded") else "built"
    if "passes" in result.values:
        how = f"{result.values['passes']} passes, {how}"
    out.print(
        f"{args.output}: {how} in {result.values['build_s']:.3f} s, rendered in {result.values['render_s']:.3f} s",
        markup=False,
        soft_wrap=True,
    )
    for tree in result.values["statistics"].get("trees", [result.values["statistics"]]):
        if tree.get("choice"):
            out.print(f"auto: {tree['choice']}", markup=False, soft_wrap=True)
    return OK


def _rendered(job: Job, args: argparse.Namespace) -> JobResult:
    """The job done at once, or in passes."""
    if not (args.passes or args.scheduler):
        with err.status(f"rendering {args.scene} with {job.spec}"):
            return run_job(job)
    with ProgressBar(f"looking at {args.scene}") as bar, image_scheduler_at(args.scheduler, args.threads) as scheduler:
        return render_in_passes(job, args.passes, scheduler, bar)


def _list_specs(_: argparse.Namespace) -> int:
    """`mitsuba-bsp specs`."""
    out.print("A spec is NAME or NAME:key=value,key=value,... with these names and keys:")
    for name, settings in specs().items():
        table = Table("key", "default", "valid values", "meaning", title=name, title_justify="left", expand=True)
        for setting in settings:
            table.add_row(setting.name, value_text(setting.default), setting.values, setting.meaning)
        out.print(table if settings else f"{name}: no settings")
    return OK


def _print_plugin_dir(_: argparse.Namespace) -> int:
    """`mitsuba-bsp plugin-dir`."""
    print(plugin_dir())
    return OK
