"""The study's page, filled in by a real browser that a script moves."""

from __future__ import annotations

import csv
import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from objectmorpher_research.evaluation.subjects.folders import read_subjects
from objectmorpher_research.study.pages import Pages, study_of
from objectmorpher_research.study.server import StudyServer
from objectmorpher_research.study.store import StudyStore, read_participants
from tests.research.study.study_set import METHODS, write_set

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
PATIENCE = 60.0  # s
LATE = 0.05  # s between two looks

pytestmark = pytest.mark.slow


def open_browser() -> Any:
    """A headless Chromium, or the test is skipped with the reason."""
    selenium = pytest.importorskip("selenium", reason="selenium is not installed")
    program = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    driver = shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("there is no Chromium with its driver (packages chromium, chromium-driver)")
    del selenium
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = program
    for word in ("--headless=new", "--window-size=1440,900", "--disable-dev-shm-usage"):
        options.add_argument(word)
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        options.add_argument("--no-sandbox")  # Chromium runs as root in no other way
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    browser = webdriver.Chrome(options, webdriver.ChromeService(driver))
    browser.set_page_load_timeout(PATIENCE)
    return browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    found = open_browser()
    yield found
    found.quit()


class Served:
    """A study and its server, which can go away and come back."""

    def __init__(self, folder: Path) -> None:
        self.folder = write_set(folder)
        self._port = 0
        self.start()

    def start(self) -> None:
        subjects = read_subjects(self.folder)
        store = StudyStore(self.folder / "study", study_of(subjects, seed=0, checks=1))
        self._server = StudyServer(("127.0.0.1", self._port), Pages(store, subjects))
        self._server.start()
        self._port = self._server.address[1]
        self.url = f"http://127.0.0.1:{self._port}/"

    def close(self) -> None:
        self._server.close()

    def people(self):
        return read_participants(self.folder / "study")


@pytest.fixture
def served(tmp_path) -> Iterator[Served]:
    found = Served(tmp_path / "set")
    yield found
    found.close()


class Page:
    """What a hand and an eye do with the page."""

    def __init__(self, browser: Any, url: str) -> None:
        self.browser, self._url = browser, url
        browser.get(url)
        browser.execute_script("localStorage.clear()")
        self.reload()

    def reload(self) -> None:
        self.browser.get(self._url)
        self.wait(lambda: self.sees("welcome") or self.sees("study") or self.sees("thanks"))

    def find(self, name: str) -> Any:
        return self.browser.find_element("id", name)

    def sees(self, name: str) -> bool:
        return self.find(name).is_displayed()

    def wait(self, is_so: Callable[[], bool]) -> None:
        end = time.monotonic() + PATIENCE
        while not is_so():
            assert time.monotonic() < end, self.browser.find_element("tag name", "body").text
            time.sleep(LATE)

    def begin(self) -> None:
        assert not self.find("begin").is_enabled()
        self.find("agreed").click()
        self.find("begin").click()
        self.wait(lambda: self.sees("study"))

    @property
    def place(self) -> str:
        return self.find("where").text

    def type(self, *keys: str) -> None:
        for key in keys:
            self.browser.switch_to.active_element.send_keys(key)

    def press_enter(self) -> None:
        self.type("\ue007")

    def click_marks(self, marks: list[int]) -> None:
        for q, mark in enumerate(marks):
            self.browser.find_element(
                "css selector", f"fieldset:nth-of-type({q + 1}) label:nth-of-type({mark}) input"
            ).click()

    def checked(self) -> list[int]:
        found = self.browser.find_elements("css selector", "input[type=radio]:checked")
        return [int(each.get_attribute("value")) for each in found]

    def asked(self) -> list[int] | None:
        """What a check of attention asks for."""
        if not self.sees("check"):
            return None
        return [int(e.text) for e in self.browser.find_elements("css selector", "#asked strong")]

    def go_on(self, act: Callable[[], None]) -> None:
        """Until another page is there."""
        before = self.place
        self.wait(lambda: self.find("next").is_enabled())
        act()
        self.wait(lambda: self.sees("thanks") or self.place != before)


def test_a_study_filled_in_by_keyboard_and_by_mouse(browser, served):
    """Two people; the first one reloads in between and thinks better of an answer."""
    given: dict[int, list[list[int]]] = {1: [], 2: []}
    for number in (1, 2):
        page = Page(browser, served.url)
        assert page.find("count").text == "4" and "voluntary" in page.find("consent").text
        page.begin()
        for k in range(5):
            assert page.place == f"{k + 1} of 5"
            marks = page.asked() or [1 + (k + number) % 5, 1 + k % 5, 5 - k]
            if number == 1:
                page.type(*map(str, marks))
                assert page.checked() == marks
                page.go_on(page.press_enter)
            else:
                page.click_marks(marks)
                page.go_on(page.find("next").click)
            given[number].append(marks)
            if number == 1 and k == 1:
                page.reload()
                assert page.place == "3 of 5", "the page goes on where it was"
                page.type("4")
                page.reload()
                assert page.place == "3 of 5" and page.checked() == [4], "half a page is kept"
                page.find("back").click()
                assert page.place == "2 of 5" and page.checked() == given[1][1]
                if page.asked() is None:
                    page.type("2")
                    given[1][1] = [2, *given[1][1][1:]]
                page.go_on(page.find("next").click)
        assert page.sees("thanks") and page.find("number").text == str(number)
        page.reload()
        assert page.sees("thanks"), "who is through stays through"
    people = served.people()
    assert [p.number for p in people] == [1, 2]
    for person in people:
        assert [list(person.answers[k].ratings) for k in range(5)] == given[person.number]
        assert all(0 < answer.seconds < PATIENCE for answer in person.answers.values())
    with (served.folder / "study" / "answers.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 10
    for row in rows:
        item = people[int(row["participant"]) - 1].items[int(row["position"]) - 1]
        marks = given[int(row["participant"])][int(row["position"]) - 1]
        assert [row["guidance"], row["realism"], row["identity"]] == [str(m) for m in marks]
        assert row["subject"] == item.subject and row["method"] == (item.method or "(check)")
    assert {row["method"] for row in rows} == {*METHODS, "(check)"}


def test_nothing_comes_from_elsewhere_and_nothing_tells_the_methods(browser, served):
    page = Page(browser, served.url)
    page.begin()
    page.wait(lambda: page.sees("pictures") or page.asked() is not None)
    loaded = browser.execute_script(
        "return performance.getEntriesByType('resource').map((entry) => entry.name)"
    )
    assert loaded and all(name.startswith((served.url, "data:")) for name in loaded)
    kept = browser.execute_script("return JSON.stringify(localStorage) + JSON.stringify(state)")
    text = browser.page_source + kept + "".join(loaded)
    assert not any(name in text for name in METHODS)
    severe = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not severe, severe


def test_arrows_lie_where_the_guidance_says(browser, served):
    page = Page(browser, served.url)
    page.begin()
    if page.asked() is not None:
        page.type(*map(str, page.asked() or ()))
        page.go_on(page.find("next").click)
    expected = {(70.0, 50.0), (40.0, 20.0)}  # of the two subjects, in px of the photo
    dot = browser.find_element("css selector", "#original circle")
    found = (float(dot.get_attribute("cx")), float(dot.get_attribute("cy")))
    assert found in expected
    assert page.find("words").text in ("Move the object along the arrow.", "An ear.")


def test_the_result_gives_way_to_the_original_while_o_is_held(browser, served):
    page = Page(browser, served.url)
    page.begin()
    while page.asked() is not None:
        page.type(*map(str, page.asked() or ()))
        page.go_on(page.find("next").click)
    shown = "return document.querySelector('#result image').getAttribute('href')"
    result = browser.execute_script(shown)
    page.find("compare").click()
    original = browser.execute_script(shown)
    assert original != result and page.find("shown").text == "Original"
    assert original == browser.execute_script(shown.replace("result", "original"))
    page.find("compare").click()
    assert browser.execute_script(shown) == result and page.find("shown").text == "Result"


def test_a_server_that_goes_away_loses_no_answer(browser, served):
    page = Page(browser, served.url)
    page.begin()
    marks = page.asked() or [1, 2, 3]
    page.type(*map(str, marks))
    page.wait(lambda: page.find("next").is_enabled())
    served.close()
    page.find("next").click()
    page.wait(lambda: page.sees("trouble"))
    assert "cannot be reached" in page.find("trouble").text and page.place == "1 of 5"
    served.start()
    page.go_on(page.browser.find_element("css selector", "#trouble button").click)
    assert list(served.people()[0].answers[0].ratings) == marks
    page.type(*map(str, page.asked() or [3, 3, 3]))
    page.go_on(page.find("next").click)  # its pictures have other names now
    assert len(served.people()[0].answers) == 2 and not page.sees("trouble")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1440, 900), (1024, 768), (420, 900)])
def test_everything_is_in_view_and_readable(browser, served, scheme, size):
    """No sideways scrolling; on a desktop no scrolling at all; text stands out, 4.5 to 1."""
    told = {"features": [{"name": "prefers-color-scheme", "value": scheme}]}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", told)
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        page = Page(browser, served.url)
        page.begin()
        wide, high = browser.execute_script(
            "const e = document.documentElement; return [e.scrollWidth, e.scrollHeight]"
        )
        assert wide <= size[0]
        assert high <= size[1] or size[0] < 860
        for name in ("--soft", "--ink"):
            for ground in ("--paper", "--card"):
                assert contrast(browser, name, ground) >= 4.5, (name, ground)
        assert contrast(browser, "--on-accent", "--accent") >= 4.5
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def contrast(browser: Any, ink: str, ground: str) -> float:
    """Of two of the page's colours (WCAG 2.1, relative luminance)."""

    def luminance(name: str) -> float:
        code = browser.execute_script(
            "return getComputedStyle(document.documentElement).getPropertyValue(arguments[0])", name
        ).strip()
        parts = [int(code[k : k + 2], 16) / 255 for k in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    low, high = sorted((luminance(ink), luminance(ground)))
    return (high + 0.05) / (low + 0.05)
