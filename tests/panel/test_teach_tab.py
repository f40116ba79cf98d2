"""Taught points are shown at once, also the first one of all; those from before are only offered."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import gemelo
from gemelo.services.panel.view.page import Page
from tests.panel.memory_page import MemoryPage, memory_page
from tests.runtime.support import until


def is_built_anew(page: MemoryPage, shown: Page) -> None:
    """As when somebody changes its colours."""
    before = shown.teach
    shown.wanted = replace(shown.wanted, is_dark=not shown.wanted.is_dark)
    page.draw(2)
    assert shown.teach is not before


def test_every_point_that_is_taught_is_the_one_that_is_shown_also_the_first(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        teaching = page.panel.operator.teaching
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel.pages()
        tab = shown.teach
        assert tab.chosen.value == "none"
        for name in ('"one" <b>', "two"):
            teaching.remember(name)
            page.draw(2)
            assert tab.chosen.value == name
            assert page.panel.operator.arm.joint_names[0] in tab.facts.content
        is_built_anew(page, shown)
        assert shown.teach.chosen.value == "none"
        assert set(shown.teach.chosen.options) == {"none", '"one" <b>', "two"}


def test_a_broken_file_of_points_is_told_with_its_line_and_neither_hides_the_page_nor_is_written_over(tmp_path: Path):
    file = tmp_path / "programs" / "rm1.points.toml"
    file.parent.mkdir()
    file.write_text('version = 1\nrobot = "rm1"\n[points.P0]\njoints = {brazo_joint = 99.0}\n')
    with memory_page("rm1", tmp_path) as page:
        teaching = page.panel.operator.teaching
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel.pages()
        assert "rm1.points.toml, line 4: " in shown.teach.facts.content
        with pytest.raises(gemelo.Error, match="line 4"):
            teaching.remember("two")
        assert "99.0" in file.read_text()
        file.unlink()  # as whoever mends it
        teaching.remember("two")
        page.draw(2)
        assert shown.teach.chosen.value == "two"
        assert "line 4" not in shown.teach.facts.content


def test_the_name_that_is_offered_is_one_that_no_point_has(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel.pages()
        assert shown.teach.name.value == "point 1"
        for name in ("point 1", "point 3"):
            page.panel.operator.teaching.remember(name)
        is_built_anew(page, shown)
        assert shown.teach.name.value == "point 2"


def test_a_point_is_where_the_arm_was_when_it_was_asked_for_however_long_its_picture_takes(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        operator = page.panel.operator
        name = operator.arm.joint_names[0]
        assert until(lambda: operator.arm.joints == page.gateway.joints)
        before = operator.arm.joints[name]

        def draw() -> None:
            page.gateway.joints |= {name: before + 0.3}
            assert until(lambda: operator.arm.joints[name] > before + 0.2)

        operator.teaching.remember("here", draw)
        assert operator.teaching.points["here"].joints[name] == before
