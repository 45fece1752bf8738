"""The command `mitsuba-bsp diff`: are two EXR images the same rendering?"""

from __future__ import annotations

import argparse
from pathlib import Path

from .flip import flip
from .judging import GATES, Judgement, NotComparableError, Rendering, judge, read_rendering, read_variance
from .terminal import OK, out, positive

#: Exit status of images that differ; what cannot be compared exits like all bad input.
DIFFERENT = 1


def add_command(commands: argparse._SubParsersAction) -> None:
    """Add the command to the parser."""
    sub = commands.add_parser(
        "diff",
        help="judge whether two EXR images are the same rendering",
        description="Exit status: 0 the same, 1 different, 2 not comparable.",
    )
    sub.add_argument("image", type=Path, metavar="A.exr")
    sub.add_argument("reference", type=Path, metavar="B.exr")
    sub.add_argument(
        "--gate",
        choices=GATES,
        default=GATES[0],
        help="identical: every bit; paired: the mean difference of images with the same seed; z: what the known noise "
        "does not explain, in pixels and blocks; auto (default): as strict as seeds, specs and noise allow",
    )
    sub.add_argument(
        "--variance",
        type=Path,
        metavar="V.exr",
        help="variance of one sample of each pixel: the scene rendered with the integrator moment, or plain X Y Z, "
        "R G B or Y; default: what A and B say themselves",
    )
    sub.add_argument(
        "--spp",
        type=positive,
        action="append",
        metavar="N",
        help="samples per pixel of A, and a second time of B (once: of both); default: what the files' headers say",
    )
    sub.add_argument("--same-seed", action="store_true", help="both were rendered with the same seed and samples")
    sub.add_argument("--ignore-header", action="store_true", help="do not look at what the files say about themselves")
    sub.add_argument("-o", "--output", type=Path, metavar="PICTURE.png", help="write a picture of the difference")
    sub.set_defaults(run=_diff)


def _diff(args: argparse.Namespace) -> int:
    if args.output and args.output.suffix != ".png":
        raise ValueError(f"{args.output} does not end in .png")
    if args.output:
        args.output.parent.mkdir(parents=True, exist_ok=True)
    if args.spp and len(args.spp) > 2:
        raise ValueError(f"--spp is given {len(args.spp)} times, but there are only two images")
    one, other = _renderings(args)
    variance = read_variance(args.variance) if args.variance else None
    if args.spp and not (variance or one.variance or other.variance) and args.gate in ("auto", "z"):
        raise NotComparableError(
            "--spp alone tells no noise, the variance of a sample is needed too: "
            "give --variance V.exr (the scene rendered with the integrator moment)"
        )
    judgement = judge(one, other, args.gate, variance, args.same_seed)
    for text in judgement.lines:
        _line(text)
    _print_flip(one, other, judgement, args.output)
    return OK if judgement.same else DIFFERENT


def _renderings(args: argparse.Namespace) -> tuple[Rendering, Rendering]:
    samples = [*args.spp, *args.spp][:2] if args.spp and len(args.spp) == 1 else args.spp or [None, None]
    found = []
    for path, spp in zip((args.image, args.reference), samples, strict=True):
        read = read_rendering(path, spp)
        found.append(Rendering(read.name, read.image, {}, read.samples, read.variance) if args.ignore_header else read)
    return found[0], found[1]


def _print_flip(one: Rendering, other: Rendering, judgement: Judgement, output: Path | None) -> None:
    if output:
        from .diff_picture import draw

        mean = draw(output, one, other, judgement)
    else:
        error = flip(one.image, other.image)
        mean = None if error is None else float(error.mean())
    if mean is None:
        _line("FLIP: not computed, because the package flip-evaluator is not installed")
    else:
        _line(f"FLIP: {mean:.4f} on average (0: looks the same, 1: as different as can be; no gate)")
    if output:
        _line(f"picture: {output}")
    if judgement.hint and not (judgement.same and judgement.gates[0].name == "identical"):
        _line(f"hint: {judgement.hint}")
    _line("same" if judgement.same else f"different: failed {', '.join(gate.name for gate in judgement.failed)}")


def _line(text: str) -> None:
    out.print(text, markup=False, soft_wrap=True)
