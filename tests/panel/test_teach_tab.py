"""Taught points are shown at once, also the first one of all; those from before are only offered."""

from __future__ import annotations

from pathlib import Path

from tests.panel.memory_page import memory_page
from tests.runtime.support import until


def test_every_point_that_is_taught_is_the_one_that_is_shown_also_the_first(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        teaching = page.panel.operator.teaching
        assert until(lambda: len(page.panel.operator.arm.joints) == 3)
        page.draw(2)
        [shown] = page.panel._present()
        tab = shown._teach
        assert tab._chosen.value == "none"
        for name in ('"one" <b>', "two"):
            teaching.remember(name, None)
            page.draw(2)
            assert tab._chosen.value == name
            assert page.panel.operator.arm.joint_names[0] in tab._facts.content
        shown._rebuild(shown._built)
        page.draw(2)
        assert shown._teach._chosen.value == "none"
        assert set(shown._teach._chosen.options) == {"none", '"one" <b>', "two"}
