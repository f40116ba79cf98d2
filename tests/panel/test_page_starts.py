"""The page is served beside a planner that started a moment ago and has got no joint state yet."""

from __future__ import annotations

from pathlib import Path

import pytest

import gemelo
from gemelo.services.panel.main import require_known
from tests.panel.memory_page import memory_page


def test_the_page_does_not_end_where_the_planner_knows_no_joint_state_yet(tmp_path: Path) -> None:
    with memory_page("rm1", tmp_path) as page:
        arm = page.panel.operator.arm
        with pytest.raises(gemelo.Refused, match="no joint state has come yet"):
            arm.fk()
        require_known(arm)
