"""`mitsuba-bsp report`: one page about any results, looked at in a real browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from conftest import ROOM, error_line

from mitsuba_bsp.exr import read_exr, write_exr
from mitsuba_bsp.intervals import Interval
from mitsuba_bsp.report.measures import Measure
from mitsuba_bsp.report.page import make_page
from mitsuba_bsp.report.summary import sentences, wins
from mitsuba_bsp.tables_cli import results_folders

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

Command = Callable[..., subprocess.CompletedProcess[str]]

SPECS = ["native", "embree", "kd", "normals"]


def measure(what: str, **times: float) -> Measure:
    runs = {spec: {repeat: seconds * (1 + repeat / 1000) for repeat in range(3)} for spec, seconds in times.items()}
    return Measure("room", what, "run", "s", runs)


class TestSummary:
    def test_the_quickest_of_ours_wins_and_is_set_against_the_others(self) -> None:
        building = measure("building", native=4, embree=0.5, kd=1, normals=2)
        (win,) = wins([measure("frame", native=6, embree=1, kd=3, normals=2, brute=0.1), building])
        assert (win.spec, win.second, win.time) == ("normals", "kd", "2 s")
        assert win.others == {"native": Interval(3, 3, 3), "embree": Interval(0.5, 0.5, 0.5)}
        assert win.lead == Interval(1.5, 1.5, 1.5) and win.is_clear
        assert win.build_s == pytest.approx(2, rel=0.01) and win.builds == pytest.approx(0.5)
        assert sentences([win]) == [
            "Whole frames. The best of our trees is 3.00 times as fast as native and 0.50 times as fast as embree "
            "(geometric mean): normals in room."
        ]

    def test_what_nobody_else_was_measured_with(self) -> None:
        (win,) = wins([measure("frame", kd=3)])
        assert win.second == "" and win.lead is win.build_s is win.builds is None and not win.is_clear
        assert sentences([win]) == ["Whole frames. The best trees are kd in room."]
        assert not list(wins([measure("frame", native=1, embree=1)]))

    def test_a_lead_within_the_noise_is_not_clear(self) -> None:
        runs = {"kd": {0: 1.0, 1: 1.2, 2: 1.0}, "normals": {0: 1.1, 1: 1.1, 2: 1.1}}
        (win,) = wins([Measure("room", "frame", "run", "s", runs)])
        assert win.spec == "kd" and not win.is_clear


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small comparison, replayed rays, builds and heat maps of a room, and the page about all of them."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "room.xml").write_text(ROOM)

    def run(*words: str) -> None:
        import sys

        found = subprocess.run(
            [sys.executable, "-m", "mitsuba_bsp", *words], cwd=folder, capture_output=True, text=True, check=False
        )
        assert found.returncode == 0, found.stderr

    run("compare", "room.xml", "--specs", *SPECS, "--out", "all/compare")
    image = folder / "all" / "compare" / "images" / "room--native.exr"
    write_exr(image, np.stack([plane * 0.8 for plane in read_exr(image).values()], axis=2), [], {})  # seen in 8 bits
    run("bench", "rays", "room.xml", "--specs", *SPECS, "--resolution", "16", "--out", "all/rays")
    run("heatmap", "room.xml", "--specs", "kd", "--resolution", "16", "--out", "all/heat")
    run("report", "all", "--title", "A & B")
    return folder / "all"


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
        assert all("aria-label=" in tag for tag in re.findall(r'<div class="chart"[^>]*>', page))

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
        shown = text_of(make_page(results_folders(tmp_path), "Two"))
        assert "machine 1 of 2" in shown and "machine 2 of 2" in shown
        assert shown.count("cpu another processor") == 1
        assert shown.count("Rays alone. The best of our trees") == 2

    def test_images_that_are_gone_are_left_out(self, results: Path, tmp_path: Path) -> None:
        shutil.copytree(results / "compare", tmp_path / "compare", ignore=shutil.ignore_patterns("images"))
        page = make_page(results_folders(tmp_path), "No images")
        assert 'class="comparer"' not in page and "Comparison (compare)" in page

    def test_bad_input(self, results: Path, command: Command, tmp_path: Path) -> None:
        assert "there is no folder gone" in error_line(command("report", "gone"))
        (tmp_path / "empty").mkdir()
        assert "there are no records in empty" in error_line(command("report", "empty"))
        shutil.copytree(results / "rays", tmp_path / "rays")
        (tmp_path / "rays" / "records.jsonl").write_text('{"scene": "room"}\n')
        result = command("report", "rays")
        assert result.returncode == 2
        assert "the records in rays are damaged or of another version" in error_line(result)


@pytest.fixture(scope="module")
def browser(results: Path) -> Iterator[Chrome]:
    """The page in headless Chromium."""
    webdriver = pytest.importorskip("selenium.webdriver")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if not (chromium and driver):
        pytest.skip("there is no chromium with its chromedriver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", "--force-prefers-reduced-motion"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    found = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    found.set_window_size(1200, 900)
    found.get((results / "report.html").as_uri())
    yield found
    found.quit()


def until(condition: Callable[[], object]) -> bool:
    """Whether it becomes true within a few seconds."""
    end = time.monotonic() + 10
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


def press(browser: Chrome, script: str) -> None:
    """Click what `script` finds."""
    browser.execute_script(f"{script}.click()")


class TestInTheBrowser:
    def test_it_loads_without_errors_and_draws_its_charts(self, browser: Chrome) -> None:
        browser.execute_script("document.querySelector('.charts').scrollIntoView()")
        assert until(lambda: browser.execute_script("return document.querySelectorAll('.chart .main-svg').length"))
        assert browser.get_log("browser") == []

    def test_the_pointer_gets_an_answer_from_a_chart(self, browser: Chrome) -> None:
        from selenium.webdriver import ActionChains

        browser.execute_script("document.querySelector('.chart').scrollIntoView({block: 'center'})")
        bar = "document.querySelector('.chart .bars .point path')"
        assert until(lambda: browser.execute_script(f"return {bar}"))
        ActionChains(browser).move_to_element(browser.execute_script(f"return {bar}")).perform()
        assert until(lambda: browser.execute_script("return document.querySelector('.hoverlayer .hovertext')"))

    def test_a_table_sorts_both_ways(self, browser: Chrome) -> None:
        table = "[...document.querySelectorAll('table')].find(t => t.caption.textContent.startsWith('room: '))"
        values = f"return [...{table}.tBodies[0].rows].map(row => parseFloat(row.cells[2].textContent))"
        assert browser.execute_script(f"return {table}.tHead.rows[0].cells[2].textContent") == "render s"
        button = f"{table}.tHead.rows[0].cells[2].firstElementChild"
        for direction in ("ascending", "descending"):
            press(browser, button)
            found = browser.execute_script(values)
            assert len(found) == len(SPECS) and found == sorted(found, reverse=direction == "descending")
            assert browser.execute_script(f"return {button}.parentElement.getAttribute('aria-sort')") == direction

    def test_the_slider_divides_the_images_by_hand_and_by_keys(self, browser: Chrome) -> None:
        from selenium.webdriver.common.keys import Keys

        clip = "return document.querySelector('.comparer .over').style.clipPath"
        assert until(lambda: browser.execute_script(clip) == "inset(0px 50% 0px 0px)")
        slider = browser.find_element("css selector", ".comparer .divide")
        slider.send_keys(Keys.ARROW_RIGHT)
        assert browser.execute_script(clip) == "inset(0px 49% 0px 0px)"
        browser.execute_script(
            "const s = document.querySelector('.comparer .stage'), b = s.getBoundingClientRect();"
            "s.dispatchEvent(new PointerEvent('pointerdown', {clientX: b.left + b.width / 4, clientY: b.top + 5}))"
        )
        assert browser.execute_script(clip) == "inset(0px 75% 0px 0px)"

    def test_flicker_shows_them_in_turns(self, browser: Chrome) -> None:
        press(browser, "document.querySelector('.comparer input[value=flicker]')")
        hidden = "return document.querySelector('.comparer .over').hidden"
        assert until(lambda: browser.execute_script(hidden))
        assert until(lambda: not browser.execute_script(hidden))

    def test_the_difference_is_amplified_and_black_for_equal_images(self, browser: Chrome) -> None:
        choose = (
            "const c = document.querySelector('.comparer'), s = c.querySelector(arguments[0]); s.value = arguments[1];"
            "s.dispatchEvent(new Event('change'))"
        )
        sums = (
            "const c = document.querySelector('.comparer canvas'), d = c.getContext('2d').getImageData(0, 0, c.width, "
            "c.height).data; let sum = 0; for (let i = 0; i < d.length; ++i) if (i % 4 < 3) sum += d[i]; return sum"
        )
        press(browser, "document.querySelector('.comparer input[value=difference]')")
        browser.execute_script(choose, ".left", "native")
        browser.execute_script(choose, ".right", "kd")
        canvas = "return !document.querySelector('.comparer canvas').hidden"
        assert until(lambda: browser.execute_script(canvas) and browser.execute_script(sums) > 0)
        before = browser.execute_script(sums)
        browser.execute_script(
            "const a = document.querySelector('.comparer .amplify'); a.value = 8; a.dispatchEvent(new Event('input'))"
        )
        assert browser.execute_script(sums) > before
        browser.execute_script(choose, ".left", "normals")
        assert until(lambda: browser.execute_script(sums) == 0)
        assert "the same image" in browser.execute_script(
            "return document.querySelector('.comparer .same').textContent"
        )

    def test_it_has_a_light_and_a_dark_face(self, browser: Chrome) -> None:
        paper = "return getComputedStyle(document.body).backgroundColor"
        faces = set()
        for _ in range(2):
            faces.add(browser.execute_script(paper))
            press(browser, "document.getElementById('theme')")
        assert len(faces) == 2

    def test_a_phone_need_not_scroll_sideways(self, browser: Chrome) -> None:
        size = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        try:
            assert until(lambda: browser.execute_script("return document.documentElement.scrollWidth") <= 390)
        finally:
            browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
