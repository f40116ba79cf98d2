"""Opening or beginning another program never loses steps that are not saved without a word."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.programs import Wait
from services.panel.view.tabs.programs import ProgramsTab
from services.panel.words.en import ENGLISH
from tests.panel.memory_page import MemoryPage, memory_page
from tests.runtime.support import until


@pytest.fixture
def page(tmp_path: Path) -> Iterator[MemoryPage]:
    """With a saved program "old", and another one, "fresh", that has a step and is not saved."""
    with memory_page("rm1", tmp_path) as page:
        teaching = page.panel.operator.teaching
        teaching.insert(Wait(time=1.0), ())
        teaching.save("old")
        teaching.new("fresh")
        teaching.insert(Wait(time=2.0), ())
        page.draw(5)
        yield page


def tab(page: MemoryPage) -> ProgramsTab:
    [shown] = page.panel._present()
    return shown._programs


def chooses_old(page: MemoryPage) -> None:
    tab(page)._file.value = "old"
    tab(page)._open()


def test_the_open_program_stays_until_a_person_says_what_becomes_of_its_steps(page: MemoryPage):
    teaching = page.panel.operator.teaching
    chooses_old(page)
    assert (teaching.program.name, len(teaching.program.steps)) == ("fresh", 1)
    assert tab(page)._file.value == "none"


@pytest.mark.parametrize(("answer", "kept"), [("save_first", {"fresh", "old"}), ("discard", {"old"})])
def test_it_is_saved_or_left_as_the_person_says(page: MemoryPage, answer: str, kept: set[str]):
    teaching = page.panel.operator.teaching
    chooses_old(page)
    page.browser.press(ENGLISH[answer])
    assert until(lambda: teaching.program.name == "old")
    assert teaching.program.steps == (Wait(time=1.0),)
    assert set(teaching.programs) == kept
    assert until(lambda: tab(page)._name.value == "old")


def test_a_new_one_asks_too_and_where_all_is_saved_nothing_is_asked(page: MemoryPage):
    teaching = page.panel.operator.teaching
    tab(page)._name.value = "third"
    tab(page)._new()
    assert teaching.program.name == "fresh"
    page.browser.press(ENGLISH["save_first"])
    assert until(lambda: teaching.program.name == "third")
    assert set(teaching.programs) == {"fresh", "old"}
    chooses_old(page)
    assert teaching.program.name == "old"
