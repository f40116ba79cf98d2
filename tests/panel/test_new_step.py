"""A step that is added as the form stands does what a person expects of it: nothing at 1 mm/s or at 1 per cent."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from gemelo.programs import Grip, Line, Repeat, Speed, Wait
from gemelo.services.panel.view.tabs.new_step import NewStep
from tests.panel.memory_page import MemoryPage, memory_page


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MemoryPage]:
    folder: Path = tmp_path_factory.mktemp("page")
    with memory_page("rm1", folder) as page:
        page.draw(5)
        yield page


@pytest.fixture
def form(page: MemoryPage) -> NewStep:
    [shown] = page.panel.pages()
    return shown.programs.form


def chooses(form: NewStep, kind: str) -> None:
    form.kind.value = next(title for title, each in form.titles.items() if each == kind)
    form.refresh()


@pytest.mark.parametrize(
    ("kind", "step"),
    [
        ("line", Line(state="home", tool_speed=0.0)),
        ("wait", Wait(time=1.0)),
        ("speed", Speed(share=0.5)),
        ("repeat", Repeat(count=2, steps=())),
        ("grip", Grip(to=0.02)),
    ],
)
def test_the_number_that_a_kind_of_step_begins_with_is_a_usual_one(form: NewStep, kind: str, step: object):
    chooses(form, "wait")
    chooses(form, kind)
    assert form.make() == step


def test_a_number_that_was_typed_stays_while_the_lists_of_names_change(form: NewStep, page: MemoryPage):
    chooses(form, "wait")
    form.number.value = 7.5
    page.panel.operator.teaching.remember("one more")
    form.refresh()
    assert "one more" in form.target.options
    assert form.make() == Wait(time=7.5)
