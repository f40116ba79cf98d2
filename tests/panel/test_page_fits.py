"""The page in the sizes, languages and colours of its users: in a real browser nothing of its controls is cut."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.services.panel.words.words import LANGUAGES
from tests.panel.memory_page import MemoryPage, memory_page
from tests.panel.person import PATIENCE, Person, until

TABS = ("move", "jog", "device", "teach", "programs", "scene", "state")
CUT = """() => [...document.querySelectorAll('button, button *, label, [role=tab]')]
  .filter((each) => each.offsetParent && each.textContent.trim()
    && (each.scrollWidth > each.clientWidth + 1 || each.getBoundingClientRect().right > innerWidth))
  .map((each) => each.textContent.trim())"""
BRIGHTNESS = "() => getComputedStyle(document.body).backgroundColor.match(/\\d+/g).slice(0, 3).map(Number)"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MemoryPage]:
    """The page of the arm with the most controls, drawn all the time."""
    with memory_page("parol6", tmp_path_factory.mktemp("page")) as page:
        stop = ShutdownRequest()
        thread = threading.Thread(target=page.panel.run, args=(stop,), daemon=True)
        thread.start()
        yield page
        stop.set()
        thread.join(60.0)


@pytest.mark.parametrize(("width", "height", "language"), [(1280, 720, "en"), (768, 1024, "es")])
def test_nothing_is_cut_in_either_language_and_colours_and_language_change_by_their_switches(
    served: MemoryPage, chromium: Browser, width: int, height: int, language: str
) -> None:
    words = LANGUAGES[language].table
    with Person(chromium, str(served.port), language, {"width": width, "height": height}) as person:
        expect(person.page.get_by_role("tab", name=words["tab_move"], exact=True)).to_be_visible(timeout=PATIENCE)
        for is_dark in (False, True):
            for name in TABS:
                person.tab(words[f"tab_{name}"])
                assert person.page.evaluate(CUT) == [], name
            tabs = [each.bounding_box() for each in person.page.get_by_role("tab").filter(visible=True).all()]
            assert len({box["y"] for box in tabs if box is not None}) == 1  # all of them in one row
            until(lambda: brightness(person.page), lambda now, dark=is_dark: (now < 100) is dark)
            if not is_dark:
                person.ticks(words["dark"])
                until(lambda: brightness(person.page), lambda now: now < 100)
        other = next(name for name in LANGUAGES if name != language)
        person.tab(words["tab_state"])
        person.chooses("Language / Idioma", LANGUAGES[other].name)
        for name in TABS:
            expect(
                person.page.get_by_role("tab", name=LANGUAGES[other].table[f"tab_{name}"], exact=True)
            ).to_be_visible(timeout=PATIENCE)
        assert brightness(person.page) < 100
        person.require_no_errors()


def brightness(page: Page) -> float:
    """Of what is behind everything, 0 to 255."""
    return float(sum(page.evaluate(BRIGHTNESS)) / 3.0)
