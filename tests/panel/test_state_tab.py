"""The numbers of the tab State that no counter knows: what the shafts of a virtual device have made."""

from __future__ import annotations

from pathlib import Path

from schemas.device import ShaftPositions
from schemas.joints import JointState
from schemas.topics import DEVICE_SHAFT, JOINT_COMMANDS
from tests.panel.memory_page import memory_page
from tests.runtime.support import until


def test_the_shafts_of_a_virtual_device_stand_beside_its_counters_and_a_real_one_has_no_such_column(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        names, node = page.panel.operator.arm.joint_names, page.gateway.node
        [shown] = page.panel.pages()
        node.publisher(JOINT_COMMANDS).put(JointState(stamp=node.now(), name=names, position=(0.0,) * len(names)))
        assert until(lambda: bool(page.panel.operator.bus.read().commanded))
        page.draw(5)
        assert "executed" in shown.state.joints.content
        assert "true shaft" not in shown.state.joints.content
        node.publisher(DEVICE_SHAFT).put(
            ShaftPositions(stamp=node.now(), name=names, steps=(0, 0, 0), shaft=(0, 10, 0), position=(0.0, 0.1, 0.0))
        )
        assert until(lambda: page.panel.operator.bus.read().shaft.get(names[1]) == 10)
        page.draw(5)
        assert "true shaft" in shown.state.joints.content
        assert ">10<" in shown.state.joints.content
