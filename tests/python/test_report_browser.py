"""The page of `mitsuba-bsp report` in a real browser."""

from __future__ import annotations

import re
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from conftest import REPORTED

from mitsuba_bsp.report.page import make_page
from mitsuba_bsp.tables_cli import results_folders

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

LONG = "normals:layout=binary,k=6,axes=fast,intersection_cost=80,retract=false,bad_refines=60"


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
            assert len(found) == len(REPORTED) and found == sorted(found, reverse=direction == "descending")
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

    def test_keys_do_what_the_pointer_does(self, browser: Chrome) -> None:
        from selenium.webdriver.common.keys import Keys

        head = browser.find_element("css selector", "table.sortable thead button")
        head.send_keys(Keys.ENTER)
        sorted_by = "return document.querySelector('table.sortable thead th').getAttribute('aria-sort')"
        assert browser.execute_script(sorted_by) == "ascending"
        pressed = "return document.getElementById('theme').getAttribute('aria-pressed')"
        before = browser.execute_script(pressed)
        browser.find_element("id", "theme").send_keys(Keys.SPACE)
        assert browser.execute_script(pressed) != before
        chosen = "return document.querySelector('.comparer input[type=radio]:checked').value"
        press(browser, "document.querySelector('.comparer input[value=slider]')")
        browser.find_element("css selector", ".comparer input[value=slider]").send_keys(Keys.ARROW_RIGHT)
        assert browser.execute_script(chosen) == "flicker"
        press(browser, "document.querySelector('.comparer input[value=slider]')")

    def test_everything_that_takes_the_focus_has_a_name(self, browser: Chrome) -> None:
        nameless = browser.execute_script(
            "return [...document.querySelectorAll('a, button, select, input, summary, [tabindex]')].filter(e => "
            "!(e.textContent.trim() || e.getAttribute('aria-label') || (e.labels && e.labels.length)))"
            ".map(e => e.outerHTML)"
        )
        assert nameless == []

    def test_paper_is_white_and_has_all_there_is(self, browser: Chrome) -> None:
        dark = {"media": "print", "features": [{"name": "prefers-color-scheme", "value": "dark"}]}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
        try:
            ink = "return getComputedStyle(document.body).color"
            assert browser.execute_script(ink) == "rgb(29, 33, 38)"
        finally:
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
        browser.execute_script("dispatchEvent(new Event('beforeprint'))")
        left = "return document.querySelectorAll('.chart:not(.drawn), details:not([open])').length"
        assert browser.execute_script(left) == 0
        browser.execute_script("dispatchEvent(new Event('afterprint'))")
        assert browser.get_log("browser") == []

    @pytest.mark.parametrize(
        "rising",
        [
            ["900", "1.2k", "15.4k", "1.72M"],
            ["40 ns", "5 us", "300 ms", "2 s"],
            ["512 B", "30 kB", "2.0 MB", "1 GB"],
            ["-9.5 % [-29.6, +6.2]", "+0.2 %", "35.1%", "100.0%"],
            ["< 1e-9", "1.3e-08", "1,234 scenes", "-"],
            ["fast", "none", "plain", "safe"],
        ],
    )
    def test_columns_sort_by_what_their_cells_mean(self, browser: Chrome, rising: list[str]) -> None:
        fill = (
            "const table = document.querySelectorAll('.part table')[0], rows = [...table.tBodies[0].rows];"
            "rows.forEach((row, i) => { row.cells[1].textContent = arguments[0][i]; });"
            "const head = table.tHead.rows[0].cells[1]; head.setAttribute('aria-sort', 'none');"
            "head.querySelector('button').click(); return [...table.tBodies[0].rows].map(r => r.cells[1].textContent)"
        )
        assert browser.execute_script(fill, [rising[i] for i in (2, 0, 3, 1)]) == rising

    def test_tables_fit_paper(self, browser: Chrome) -> None:
        size = {"width": 794, "height": 1123, "deviceScaleFactor": 1, "mobile": False}
        heads = "document.querySelectorAll('tbody th').forEach(e => {{ {} }})"
        browser.execute_script(heads.format("e.was = e.textContent; e.textContent = arguments[0];"), LONG)
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print", "features": []})
        right = "return Math.max(...[...document.querySelectorAll('table')].map(e => e.getBoundingClientRect().right))"
        try:
            assert until(lambda: browser.execute_script(right) <= 794)
        finally:
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
            browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
            browser.execute_script(heads.format("e.textContent = e.was;"))

    @pytest.fixture
    def phone(self, browser: Chrome) -> Iterator[Chrome]:
        """A narrow screen, and a long spec everywhere."""
        fill = (
            "document.querySelectorAll('figcaption, caption, tbody th, .finding, option').forEach("
            "e => { e.dataset.was = e.textContent; e.textContent = arguments[0]; })"
        )
        size = {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
        browser.execute_script(fill, LONG)
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        yield browser
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        browser.execute_script(
            "document.querySelectorAll('[data-was]').forEach(e => { e.textContent = e.dataset.was; })"
        )

    def test_a_phone_need_not_scroll_sideways(self, phone: Chrome) -> None:
        assert until(lambda: phone.execute_script("return document.documentElement.scrollWidth") <= 390)

    def test_the_first_column_leaves_room_on_a_phone(self, phone: Chrome) -> None:
        wide = "return Math.max(...[...document.querySelectorAll('table:not(.wins) tbody th')].map(e => e.offsetWidth))"
        assert until(lambda: phone.execute_script(wide) <= 0.45 * 390)

    def test_the_winners_are_cards_on_a_phone(self, phone: Chrome) -> None:
        """Each number has its name, and nothing is out of sight."""
        cells = (
            "return [...document.querySelectorAll('.wins td')].map(e => [e.getBoundingClientRect().right, "
            "e.scrollWidth - e.clientWidth, getComputedStyle(e, '::before').content])"
        )
        assert until(lambda: all(right <= 390 and over <= 0 for right, over, _ in phone.execute_script(cells)))
        names = {name.strip('"') for _, _, name in phone.execute_script(cells)}
        assert {"quickest tree", "build s", "time", "× native", "lead"} <= names
        roles = "return [...document.querySelector('.wins').querySelectorAll('tr, th, td')].map(e => e.role)"
        assert set(phone.execute_script(roles)) == {"row", "rowheader", "cell", "columnheader"}

    @pytest.mark.parametrize(("width", "media"), [(1280, "screen"), (1920, "screen"), (794, "print")])
    def test_the_whole_summary_is_in_sight(self, browser: Chrome, width: int, media: str) -> None:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": media, "features": []})
        over = "const s = document.querySelector('.scroll:has(.wins)'); return s.scrollWidth - s.clientWidth"
        try:
            assert until(lambda: browser.execute_script(over) <= 0)
        finally:
            browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "", "features": []})
            browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})

    def test_figures_keep_their_size_on_a_phone_and_scroll(self, phone: Chrome) -> None:
        phone.execute_script("document.querySelector('figure.scroll').scrollIntoView()")
        one = "const f = document.querySelector('figure.scroll'), i = f.querySelector('img');"
        assert until(lambda: phone.execute_script(f"{one} return i.complete && i.width === i.naturalWidth"))
        assert phone.execute_script(f"{one} return f.tabIndex === 0 && f.scrollWidth > f.clientWidth")

    def test_charts_keep_their_height_on_a_phone(self, phone: Chrome) -> None:
        phone.execute_script("document.querySelector('.chart').scrollIntoView()")
        low = (
            "return [...document.querySelectorAll('.chart.drawn')].filter(e => e.querySelector('.main-svg')"
            ".getBoundingClientRect().height > e.offsetHeight + 1).length"
        )
        assert until(lambda: phone.execute_script("return document.querySelectorAll('.chart .main-svg').length"))
        assert phone.execute_script(low) == 0

    def test_long_names_fit_a_desk(self, browser: Chrome) -> None:
        browser.execute_script("document.querySelector('figcaption').textContent = arguments[0]", 4 * LONG)
        assert browser.execute_script("return document.documentElement.scrollWidth <= innerWidth")


class TestMachines:
    """A page about several machines."""

    @pytest.fixture
    def machines(self, browser: Chrome, results: Path, tmp_path: Path) -> Iterator[Chrome]:
        for number in range(3):
            shutil.copytree(results / "rays", tmp_path / f"rays{number}")
            file = tmp_path / f"rays{number}" / "records.jsonl"
            file.write_text(re.sub('"cpu": "[^"]*', f'"cpu": "processor {number}', file.read_text()))
        (tmp_path / "report.html").write_text(make_page(results_folders(tmp_path), "Three"))
        browser.get((tmp_path / "report.html").as_uri())
        yield browser
        browser.get((results / "report.html").as_uri())

    def test_contents_lead_into_closed_machines(self, machines: Chrome) -> None:
        is_open = "return [...document.querySelectorAll('.all-of')].map(e => e.open)"
        assert machines.execute_script(is_open) == [True, False, False]
        assert machines.execute_script("return document.querySelector('nav').offsetHeight") < 100
        press(machines, "document.querySelector('.contents summary')")
        link = "document.querySelector('nav a[href=\"#scene-3-1\"]')"
        machines.execute_script(f"{link}.closest('details').open = true")
        assert machines.execute_script(f"return {link}.offsetHeight") > 0
        press(machines, link)
        assert until(lambda: machines.execute_script(is_open) == [True, False, True])
        top = "return document.getElementById('scene-3-1').getBoundingClientRect().top"
        assert until(lambda: 0 <= machines.execute_script(top) < 400)
        assert not machines.execute_script("return document.querySelector('.contents').open")

    def test_paper_has_all_machines_and_the_screen_stays_as_it_was(self, machines: Chrome) -> None:
        is_open = "return [...document.querySelectorAll('details')].map(e => e.open)"
        before = machines.execute_script(is_open)
        machines.execute_script("dispatchEvent(new Event('beforeprint'))")
        assert all(machines.execute_script(is_open))
        assert machines.execute_script("return document.querySelectorAll('.chart:not(.drawn)').length") == 0
        machines.execute_script("dispatchEvent(new Event('afterprint'))")
        assert machines.execute_script(is_open) == before and not all(before)
        assert machines.get_log("browser") == []
