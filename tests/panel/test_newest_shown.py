"""The newest of a run and of the taught points, as the page shows it; and the question before a point is removed."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import pytest

from gemelo.programs.run import RunState, RunStatus
from gemelo.services.panel.view.page import Page
from gemelo.services.panel.words.en import ENGLISH
from tests.panel.memory_page import MemoryPage, memory_page
from tests.runtime.support import until


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MemoryPage]:
    with memory_page("rm1", tmp_path_factory.mktemp("page")) as page:
        page.draw(2)
        yield page


def shown(page: MemoryPage) -> Page:
    [only] = page.panel.pages()
    return only


def test_a_program_that_ends_while_the_page_is_looking_is_not_shown_as_running(
    page: MemoryPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    teaching, tab = page.panel.operator.teaching, shown(page).programs
    monkeypatch.setattr(teaching, "run", SimpleNamespace(state=RunState("one", RunStatus.RUNNING), stop=lambda: None))
    teaching.changed()
    page.draw(2)
    assert ENGLISH["run_running"] in tab.state.content
    folder = teaching.programs

    class Slow:
        """The folder of programs, which takes so long to read that the run ends meanwhile."""

        def __iter__(self) -> Iterator[str]:
            monkeypatch.setattr(teaching, "programs", folder)
            teaching.run.state = RunState("one", RunStatus.DONE)
            teaching.changed()
            return iter(folder)

    monkeypatch.setattr(teaching, "programs", Slow())
    page.draw(2)
    assert ENGLISH["run_done"] in tab.state.content


def test_the_point_that_was_taught_is_chosen_at_once(page: MemoryPage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shown(page).client, "get_render", draws_nothing)
    tab = shown(page).teach
    tab.name.value = "new"
    tab.remember()
    assert tab.chosen.value == "new"


def draws_nothing(*size: int, timeout: float) -> None:
    """As a browser that has not drawn after `timeout` [s]."""
    raise TimeoutError


def test_a_point_is_removed_once_a_person_has_said_so(page: MemoryPage) -> None:
    assert page.browser is not None
    teaching, tab = page.panel.operator.teaching, shown(page).teach
    teaching.remember("old")
    page.draw(2)
    assert tab.chosen.value == "old"
    for answer in ("cancel", "remove_point"):
        tab.remove()
        page.sent()  # the browser has the question
        assert "old" in teaching.points
        page.browser.press(ENGLISH[answer])
    assert until(lambda: "old" not in teaching.points)
