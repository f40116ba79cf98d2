"""Taught points are shown at once, also the first one of all; those from before are only offered."""

from __future__ import annotations

from pathlib import Path

import pytest

import gemelo
from tests.panel.memory_page import memory_page
from tests.runtime.support import until


def test_every_point_that_is_taught_is_the_one_that_is_shown_also_the_first(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        teaching = page.panel.operator.teaching
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel.pages()
        tab = shown._teach
        assert tab._chosen.value == "none"
        for name in ('"one" <b>', "two"):
            teaching.remember(name)
            page.draw(2)
            assert tab._chosen.value == name
            assert page.panel.operator.arm.joint_names[0] in tab._facts.content
        shown._rebuild(shown._built)
        page.draw(2)
        assert shown._teach._chosen.value == "none"
        assert set(shown._teach._chosen.options) == {"none", '"one" <b>', "two"}


def test_a_broken_file_of_points_is_told_with_its_line_and_neither_hides_the_page_nor_is_written_over(tmp_path: Path):
    file = tmp_path / "programs" / "rm1.points.toml"
    file.parent.mkdir()
    file.write_text('version = 1\nrobot = "rm1"\n[points.P0]\njoints = {brazo_joint = 99.0}\n')
    with memory_page("rm1", tmp_path) as page:
        teaching = page.panel.operator.teaching
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel.pages()
        assert "rm1.points.toml, line 4: " in shown._teach._facts.content
        with pytest.raises(gemelo.Error, match="line 4"):
            teaching.remember("two")
        assert "99.0" in file.read_text()
        file.unlink()  # as whoever mends it
        teaching.remember("two")
        page.draw(2)
        assert shown._teach._chosen.value == "two"
        assert "line 4" not in shown._teach._facts.content


def test_the_name_that_is_offered_is_one_that_no_point_has(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel.pages()
        assert shown._teach._name.value == "point 1"
        for name in ("point 1", "point 3"):
            page.panel.operator.teaching.remember(name)
        shown._rebuild(shown._built)
        assert shown._teach._name.value == "point 2"


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
