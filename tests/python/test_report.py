"""`mitsuba-bsp report`: one page about any results, without a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from conftest import error_line

from mitsuba_bsp.exr import read_exr, write_exr
from mitsuba_bsp.outcomes import Outcome
from mitsuba_bsp.report.descriptions import described
from mitsuba_bsp.report.page import make_page
from mitsuba_bsp.studies.work import QUANTITIES
from mitsuba_bsp.tables_cli import results_folders

Command = Callable[..., subprocess.CompletedProcess[str]]


def text_of(page: str) -> str:
    """Without scripts, styles and tags."""
    return re.sub(r"<(script|style).*?</\1>|<[^>]+>", " ", page, flags=re.DOTALL)


class TestPage:
    def test_it_is_one_file_that_needs_nothing_else(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        assert "<h1>A &amp; B</h1>" in page
        outside = re.sub(r"<script>.*?</script>", "", page, flags=re.DOTALL)
        assert not re.findall(r"""(?:src|href)=["']?(?!data:|#)[^"' >]+""", outside)
        assert "url(" not in outside

    def test_everything_in_the_folders_is_on_it(self, results: Path) -> None:
        shown = text_of((results / "report.html").read_text())
        for word in ("Measured on: mitsuba 3.9.1", "Rays alone", "Rendering", "Anatomy of the trees", "cpu"):
            assert word in shown
        for title in ("Comparison (compare)", "Replayed rays (rays)", "(heat)"):
            assert title in shown, title

    def test_every_picture_is_described(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        assert all(re.search(r'alt="[^"]{10,}"', tag) for tag in re.findall(r"<img[^>]*>", page))
        figures = re.findall(r'<figure class="scroll"[^>]*><img src="[^"]*" alt="([^"]*)"', page)
        assert len(set(figures)) == 4
        assert all("every pixel of room" in alt and "column an accelerator" in alt for alt in figures)
        assert all("aria-label=" in tag for tag in re.findall(r'<div class="chart"[^>]*>', page))

    def test_figures_are_beside_their_tables(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        assert "All scenes together" not in page
        assert (
            page.count('<figure class="scroll"') == page.partition("Cost images (heat)")[2].count("<figure class") == 4
        )

    def test_equal_images_are_stored_once(self, results: Path) -> None:
        page = (results / "report.html").read_text()
        specs = json.loads(re.search(r"data-specs='([^']*)'", page).group(1).replace("&#34;", '"'))
        assert specs["kd"] == specs["normals"] != specs["native"]
        pictures = json.loads(re.search(r"const pictures = (\{.*?\});</script>", page).group(1))
        assert set(specs.values()) == set(pictures)

    def test_machines_are_kept_apart(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "rays", tmp_path / "one")
        shutil.copytree(results / "rays", tmp_path / "two")
        lines = (tmp_path / "two" / "records.jsonl").read_text().splitlines()
        rows = [{**json.loads(line), "cpu": "another processor"} for line in lines]
        (tmp_path / "two" / "records.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
        main = make_page(results_folders(tmp_path), "Two").partition("<main>")[2]
        overview, *own = main.split('<details class="all-of"')
        summaries = overview.split('<section class="overview"')[1:]
        for parts in (summaries, own):
            first, second = map(text_of, parts)
            assert "Machine 2" not in first and "machine 2" not in first and "another processor" not in first
            assert "Machine 1" not in second and "machine 1" not in second and "another processor" in second
        assert all("room, machine" in part for part in own)
        assert all(
            part.count(". The best of our trees") == 1 for part in overview.split('<section class="overview"')[1:]
        )

    def test_the_summary_of_all_machines_comes_first(self, results: Path, tmp_path: Path) -> None:
        for name in ("heat", "rays"):
            shutil.copytree(results / name, tmp_path / name)
            file = tmp_path / name / "records.jsonl"
            file.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "of {name}', file.read_text()))
        page = make_page(results_folders(tmp_path), "Two").partition("<main>")[2]
        summary = text_of(page.partition('<details class="all-of"')[0])
        assert "scene hash" not in summary and "Anatomy" not in summary
        assert summary.index("Machine 1: of rays (rays)") < summary.index("Machine 2: of heat (heat)")
        assert summary.count("No tracing was timed here") == 1
        assert re.findall('<details class="all-of" id="machine-(.)"( open)?>', page) == [("1", " open"), ("2", "")]
        assert page.count("When a tree wins") == 1

    def test_what_was_timed_is_not_denied(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        for spec in ("kd", "normals"):
            file = tmp_path / "compare" / "records.jsonl"
            lines = [line for line in file.read_text().splitlines() if json.loads(line)["spec"] != spec]
            file.write_text("".join(f"{line}\n" for line in lines))
        shown = text_of(make_page(results_folders(tmp_path), "Foreign"))
        assert "None of our trees was timed here" in shown and "No tracing was timed" not in shown

    def test_runs_are_named_where_there_are_several(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "rays", tmp_path / "one")
        head = ">timed</button>"
        assert head not in make_page(results_folders(tmp_path), "One")
        shutil.copytree(results / "rays", tmp_path / "two")
        assert head in make_page(results_folders(tmp_path), "Two")

    @pytest.mark.parametrize(
        ("cpu", "count"), [("AMD EPYC (family 25, model 1), 2 logical cores", 1), ("AMD EPYC, 2 logical cores", 2)]
    )
    def test_processors_without_a_family_are_those_of_their_folder(
        self, results: Path, tmp_path: Path, cpu: str, count: int
    ) -> None:
        for name in ("one", "two"):
            shutil.copytree(results / "rays", tmp_path / name)
            file = tmp_path / name / "records.jsonl"
            rows = [{**json.loads(line), "cpu": cpu} for line in file.read_text().splitlines()]
            file.write_text("".join(json.dumps(row) + "\n" for row in rows))
        page = make_page(results_folders(tmp_path), "Two")
        assert page.count("<h2>Summary") == 1
        heads = [f"<h2>Machine {number}: {cpu} ({name})</h2>" for number, name in ((1, "one"), (2, "two"))]
        assert all((head in page) == (count == 2) for head in heads)

    def test_scenes_of_one_name_are_told_apart(self, results: Path, tmp_path: Path) -> None:
        for name, digest in (("one", "1" * 64), ("two", "2" * 64)):
            shutil.copytree(results / "compare", tmp_path / name, ignore=shutil.ignore_patterns("images"))
            for file in (tmp_path / name).glob("*.jsonl"):
                file.write_text(re.sub('"scene_hash": "[0-9a-f]+"', f'"scene_hash": "{digest}"', file.read_text()))
        shown = text_of(make_page(results_folders(tmp_path), "Two"))
        assert "scene hash 111111111111" in shown and "scene hash 222222222222" in shown
        assert "room 111111" in shown and "room 222222" in shown

    def test_folders_of_one_name_are_told_apart(self, results: Path, tmp_path: Path) -> None:
        for name in ("one/rays", "two/rays"):
            shutil.copytree(results / "rays", tmp_path / name)
        shown = text_of(make_page(results_folders(tmp_path), "Two"))
        assert "Replayed rays (one/rays)" in shown and "Replayed rays (two/rays)" in shown

    def test_every_part_says_how_it_was_measured(self, results: Path) -> None:
        shown = " ".join(text_of((results / "report.html").read_text()).split())
        assert re.search(r"mitsuba-bsp compare: scalar_rgb, \d+x\d+, \d+ spp, \d+ threads?\. mitsuba 3\.9\.1, ", shown)
        assert re.search(r"mitsuba-bsp bench rays: scalar_rgb, 16x16, \d+ spp, 1 thread\. mitsuba 3\.9\.1, ", shown)

    def test_images_that_are_gone_are_left_out(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        page = make_page(results_folders(tmp_path), "No images")
        assert 'class="comparer"' not in page and "Comparison (compare)" in page

    def test_images_of_one_scene_in_two_folders_are_told_apart(self, results: Path, tmp_path: Path) -> None:
        for name in ("one", "two"):
            shutil.copytree(results / "compare", tmp_path / name)
        for image in (tmp_path / "two" / "images").glob("*.exr"):
            write_exr(image, np.stack([0.5 * plane for plane in read_exr(image).values()], axis=2), [], {})
        page = make_page(results_folders(tmp_path), "Two")
        one, two = (set(json.loads(specs).values()) for specs in re.findall("data-specs='([^']*)'", page))
        assert one and two and not one & two

    def test_a_scene_is_shown_where_others_rendered_it(self, results: Path, tmp_path: Path) -> None:
        for name in ("heat", "compare"):
            shutil.copytree(results / name, tmp_path / name)
            file = tmp_path / name / "records.jsonl"
            file.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "of {name}', file.read_text()))
            if name == "compare":
                counters = tmp_path / name / "counters.jsonl"
                counters.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "of {name}', counters.read_text()))
        page = make_page(results_folders(tmp_path), "Two")
        (shown,) = re.findall('<img data-picture="([^"]*)" alt="room, rendered under native [(]compare[)]">', page)
        assert shown in json.loads(re.search(r"const pictures = (\{.*?\});</script>", page).group(1))
        shutil.rmtree(tmp_path / "compare" / "images")
        assert "<img data-picture=" not in make_page(results_folders(tmp_path), "Two")

    def test_jobs_that_failed_are_listed(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        failed = [{"scene": scene, "spec": "ize", "message": f"no memory in {scene}"} for scene in ("room", "attic")]
        (tmp_path / "compare" / "failures.jsonl").write_text("".join(json.dumps(row) + "\n" for row in failed))
        page = make_page(results_folders(tmp_path), "Failed")
        shown = text_of(page)
        assert "2 jobs failed in compare" in shown.partition("scene hash")[0]
        assert page.count("<caption>Failed jobs</caption>") == 2
        scene, together = shown.split("All scenes together")[-2:]
        assert "no memory in room" in scene and "no memory in attic" in together
        assert "Failed jobs" not in (results / "report.html").read_text()

    def test_a_folder_that_cannot_be_read_leaves_the_others_alone(
        self, results: Path, command: Command, tmp_path: Path
    ) -> None:
        for name in ("all/good", "all/bad", "all/empty"):
            shutil.copytree(results / "rays", tmp_path / name)
        (tmp_path / "all" / "bad" / "records.jsonl").write_text('{"scene": "room"}\n')
        (tmp_path / "all" / "empty" / "records.jsonl").write_text("")
        result = command("report", "all")
        assert result.returncode == 0
        sentences = ("all/bad are damaged or of another version", "there are no records in all/empty yet")
        shown = text_of((tmp_path / "all" / "report.html").read_text())
        assert all(text in shown and text in " ".join(result.stderr.split()) for text in sentences)
        assert "Replayed rays (good)" in shown
        shutil.rmtree(tmp_path / "all" / "good")
        assert command("report", "all").returncode == 2

    @pytest.mark.parametrize("error", [RuntimeError("no"), ZeroDivisionError("no"), OSError(5, "no")])
    def test_whatever_is_wrong_with_it(
        self, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
    ) -> None:
        def figures(outcome: Outcome) -> list:
            if outcome.command == "heatmap":
                raise error
            return []

        for name in ("heat", "rays"):
            shutil.copytree(results / name, tmp_path / name)
        monkeypatch.setattr(Outcome, "figures", figures)
        begun, left_out = [], []
        page = make_page(results_folders(tmp_path), "Two", begun.append, left_out.append)
        assert begun == ["heat", "rays"] and "Replayed rays (rays)" in page
        (sentence,) = left_out
        assert sentence.startswith(f"the records in {tmp_path / 'heat'} are") and sentence.endswith(f": {error}")
        with pytest.raises(ValueError, match="no"):
            make_page(results_folders(tmp_path / "heat"), "One")

    def test_an_interruption_is_no_damage(self, results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def figures(_: Outcome) -> list:
            raise KeyboardInterrupt

        monkeypatch.setattr(Outcome, "figures", figures)
        with pytest.raises(KeyboardInterrupt):
            make_page(results_folders(results), "All")

    def test_bad_input(self, results: Path, command: Command, tmp_path: Path) -> None:
        assert "there is no folder gone" in error_line(command("report", "gone"))
        (tmp_path / "empty").mkdir()
        assert "there are no records in empty" in error_line(command("report", "empty"))
        shutil.copytree(results / "rays", tmp_path / "rays")
        (tmp_path / "rays" / "records.jsonl").write_text('{"scene": "room"}\n')
        result = command("report", "rays")
        assert result.returncode == 2
        assert "the records in rays are damaged or of another version: a record has no 'mitsuba'" in error_line(result)

    @pytest.mark.parametrize(
        ("change", "sentence"),
        [
            (lambda row: "{", "line 2 of rays/records.jsonl is damaged: it is not a JSON object"),
            (lambda row: "[]", "line 2 of rays/records.jsonl is damaged: it is not a JSON object"),
            (lambda row: json.dumps({k: row[k] for k in row if k != "ns_per_ray"}), "a record has no 'ns_per_ray'"),
            (lambda row: json.dumps(row | {"ns_per_ray": "1"}), "records in rays are damaged or of another version"),
        ],
    )
    def test_a_damaged_record(
        self, results: Path, command: Command, tmp_path: Path, change: Callable[[dict], str], sentence: str
    ) -> None:
        shutil.copytree(results / "rays", tmp_path / "rays")
        lines = (tmp_path / "rays" / "records.jsonl").read_text().splitlines()
        lines[1] = change(json.loads(lines[1]))
        (tmp_path / "rays" / "records.jsonl").write_text("".join(f"{line}\n" for line in lines))
        result = command("report", "rays")
        assert result.returncode == 2
        assert sentence in error_line(result)
        assert not (tmp_path / "rays" / "report.html").exists()


class TestDescriptions:
    def test_every_figure_has_one(self) -> None:
        package = files("mitsuba_bsp")
        sources = [file.read_text() for file in Path(str(package)).rglob("*.py") if "report" not in file.parts]
        names = {name for source in sources for name in re.findall(r'^ +yield f?"([a-z][^"]*)", \w', source, re.M)}
        assert {"claims", "slice-planes-{scene}", "heatmap-{scene}-{quantity}", "growth", "trade-front"} <= names
        for name in names:
            for quantity in QUANTITIES if "{quantity}" in name else ("",):
                drawn = name.format(scene="room", quantity=quantity)
                scene, text = described(drawn, "A study", ["room"])
                assert scene == ("room" if "{scene}" in name else "")
                assert len(text) > 40 and text.endswith(".") and "A study" not in text and "{" not in text, drawn

    def test_names_of_scenes_are_not_words_of_figures(self) -> None:
        scenes = ["planes", "feet", "depth"]
        assert described("slice-planes-feet", "", scenes)[0] == "feet"
        assert described("slice-planes", "", scenes)[0] == "planes"
        assert described("comparison-depth", "", scenes)[0] == ""
        assert described("of-another", "Whole frames", scenes) == ("", "Whole frames: of-another.")


def luminance(colour: str) -> float:
    """WCAG 2.2: of #rrggbb, from 0 to 1."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return float(np.dot(linear, (0.2126, 0.7152, 0.0722)))


@pytest.mark.parametrize("face", [1, 2], ids=["light", "dark"])
@pytest.mark.parametrize("ground", ["paper", "band"])
@pytest.mark.parametrize("ink", ["ink", "soft", "link"])
def test_text_stands_out(ink: str, ground: str, face: int) -> None:
    """WCAG 2.2 AA: 4.5 to 1."""
    style = (files("mitsuba_bsp.report") / "templates" / "style.css").read_text()
    colours = {m[0]: luminance(m[face]) for m in re.findall(r"--(\w+): light-dark\((#\w{6}), (#\w{6})\)", style)}
    low, high = sorted((colours[ink], colours[ground]))
    assert (high + 0.05) / (low + 0.05) >= 4.5
