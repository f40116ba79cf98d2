"""Opening or beginning another program never loses steps without a word, and what cannot be opened says why."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.programs import Wait
from gemelo.services.panel.view.tabs.programs import ProgramsTab
from gemelo.services.panel.words.en import ENGLISH
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
    [shown] = page.panel.pages()
    return shown.programs


def chooses_old(page: MemoryPage) -> None:
    tab(page).file.value = "old"
    tab(page).open()


def test_the_open_program_stays_until_a_person_says_what_becomes_of_its_steps(page: MemoryPage):
    teaching = page.panel.operator.teaching
    chooses_old(page)
    assert (teaching.program.name, len(teaching.program.steps)) == ("fresh", 1)
    assert tab(page).file.value == "none"


@pytest.mark.parametrize(("answer", "kept"), [("save_first", {"fresh", "old"}), ("discard", {"old"})])
def test_it_is_saved_or_left_as_the_person_says(page: MemoryPage, answer: str, kept: set[str]):
    teaching = page.panel.operator.teaching
    chooses_old(page)
    page.browser.press(ENGLISH[answer])
    assert until(lambda: teaching.program.name == "old")
    assert teaching.program.steps == (Wait(time=1.0),)
    assert set(teaching.programs) == kept
    assert until(lambda: tab(page).name.value == "old")


def test_a_new_one_asks_too_and_where_all_is_saved_nothing_is_asked(page: MemoryPage):
    teaching = page.panel.operator.teaching
    tab(page).name.value = "third"
    tab(page).new()
    assert teaching.program.name == "fresh"
    page.browser.press(ENGLISH["save_first"])
    assert until(lambda: teaching.program.name == "third")
    assert set(teaching.programs) == {"fresh", "old"}
    chooses_old(page)
    assert teaching.program.name == "old"


def test_a_program_that_is_written_beside_the_page_is_offered_and_a_broken_one_says_its_line(page: MemoryPage):
    teaching = page.panel.operator.teaching
    teaching.save("fresh")
    file = teaching.programs.file("broken")
    file.write_text('version = 1\nsteps = [\n  {do = "wait", time = -2.0},\n  {do = "fly"},\n]\n')
    page.draw(2)
    assert "broken" in tab(page).file.options
    tab(page).file.value = "broken"
    tab(page).open()
    assert tab(page).file.value == teaching.program.name == "fresh"
    [shown] = page.panel.pages()
    page.draw(2)
    lines = shown.problem.content.partition("<br>")[2].splitlines()
    assert [line.partition("broken.toml, ")[2][:7] for line in lines] == ["line 3:", "line 4:"]
    file.unlink()
    page.draw(2)
    assert "broken" not in tab(page).file.options


def test_a_refusal_is_gone_once_the_next_press_has_done_its_work(page: MemoryPage):
    operator = page.panel.operator
    page.browser.press(ENGLISH["delete_step"])  # none is chosen
    assert until(lambda: operator.newest_problem is not None)
    page.browser.press(ENGLISH["delete_step"])
    assert until(lambda: operator.newest_problem.number == 2)
    page.browser.press(ENGLISH["add_step"])
    assert until(lambda: operator.newest_problem is None)
    assert len(operator.teaching.program.steps) == 2
