"""The pytest plugin of mitsuba-bsp: the fixture `image_regression`.

A package of its own, so that pytest, which loads it in every run, loads neither Mitsuba nor the trees for tests that
need none.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from mitsuba_bsp.judging import Judgement


@dataclass
class Session:
    """What the fixture did in one run of pytest."""

    written: list[Path] = field(default_factory=list)
    pictures: list[Path] = field(default_factory=list)


_SESSION = pytest.StashKey[Session]()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("image regression (mitsuba-bsp)")
    group.addoption("--update-references", action="store_true", help="store new reference images instead of comparing")
    group.addoption(
        "--image-references", metavar="DIR", help="where they are, default: a folder references beside each test file"
    )
    group.addoption(
        "--image-results", metavar="DIR", help="where images and pictures of failures go, default: a temporary folder"
    )
    parser.addini("image_references", "as --image-references, relative to the folder of this file")


def pytest_configure(config: pytest.Config) -> None:
    config.stash[_SESSION] = Session()


class ImageRegression:
    """Renders scenes and compares them with stored references; a difference fails the test."""

    def __init__(self, request: pytest.FixtureRequest, results: Path) -> None:
        self._request, self._results = request, results

    def __call__(
        self,
        scene: str | Path | Mapping[str, object],
        spec: str,
        *,
        name: str | None = None,
        spp: int | None = None,
        resolution: int | None = None,
        seed: int = 0,
        params: Mapping[str, object] | None = None,
        variant: str = "scalar_rgb",
        reference_spec: str | None = None,
        reference_spp: int | None = None,
        gate: str = "auto",
    ) -> Judgement | None:
        """Render `scene` (an XML file, or what `mitsuba.load_dict` takes) under the accelerator `spec`, and judge it.

        `name` is that of the reference, without .exr; default: the test's. Tests of one scene under several specs may
        share one. `spp` and `resolution` (longer side, pixels) are the scene's own by default, `params` are those of
        the XML file. With --update-references the reference is rendered under `reference_spec` with `reference_spp`
        samples (default: `spec`, `spp`) and stored; a second test that shares it is then compared as usual.

        With the seed and samples of its reference, an image under our trees must have its very bits; other images must
        not differ by more than rounding and noise explain; if noise alone is in doubt, they are rendered once more with
        another seed. `gate` asks for one of the gates of `mitsuba-bsp diff`.
        Returns the judgement, None if a reference was stored. All mistakes fail the test, in one sentence.
        """
        from mitsuba_bsp.image_regression import Setup, against_reference, render, sentence, write

        reference = self._reference(name)
        session = self._request.config.stash[_SESSION]
        try:
            setup = Setup(spp, resolution, seed, params or {}, variant)
            if self._request.config.getoption("--update-references") and reference not in session.written:
                first = replace(setup, spp=reference_spp or spp)
                stored = render(scene, reference_spec or spec, reference.stem, first)
                write(reference, stored)
                session.written.append(reference)
                if reference_spec in (None, spec) and reference_spp in (None, spp):
                    return None
            elif not reference.is_file():
                raise ValueError(f"there is no reference {reference}: make it with pytest --update-references")
            found = against_reference(scene, spec, setup, reference, self._results, gate)
        except (ValueError, RuntimeError, OSError) as error:
            mistake = sentence(error)
        else:
            mistake = ""
        if mistake:  # said here, where the report does not tell it again as the error's context
            pytest.fail(f"image regression: {mistake}", pytrace=False)
        if not found.judgement.same:
            session.pictures.append(found.picture)
            pytest.fail(f"{reference.stem} under {spec} is not what it was\n{found}", pytrace=False)
        return found.judgement

    def _reference(self, name: str | None) -> Path:
        from mitsuba_bsp.records import safe_name

        config = self._request.config
        if folder := config.getoption("--image-references"):
            parent = config.invocation_params.dir / folder
        elif folder := config.getini("image_references"):
            parent = config.rootpath / folder
        else:
            parent = self._request.path.parent / "references"
        return parent / f"{safe_name(name or self._request.node.name)}.exr"


@pytest.fixture
def image_regression(request: pytest.FixtureRequest, tmp_path: Path) -> ImageRegression:
    """Render a scene under an accelerator and compare it with a stored reference image."""
    folder = request.config.getoption("--image-results")
    return ImageRegression(request, request.config.invocation_params.dir / folder if folder else tmp_path)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    session = config.stash[_SESSION]
    for title, files in (("references written", session.written), ("pictures of differences", session.pictures)):
        if files:
            terminalreporter.section(title)
            for file in files:
                terminalreporter.line(str(file))
