"""The tab State: the shafts of a virtual device beside its counters, and a disk that refuses."""

from __future__ import annotations

import errno
from pathlib import Path

from gemelo.schemas.device import ShaftPositions
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DEVICE_SHAFT, JOINT_COMMANDS
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


def test_a_disk_that_refuses_stands_on_the_page_until_it_takes_files_again(tmp_path: Path):
    with memory_page("rm1", tmp_path) as page:
        unwritten = page.panel.operator.arm.node.unwritten
        [shown] = page.panel.pages()
        page.draw(5)
        assert ">Disk<" not in shown.state.tool.content
        unwritten.failed("the readiness of panel", OSError(errno.ENOSPC, "No space left on device"))
        page.draw(5)
        assert "the readiness of panel cannot be written (No space left on device)" in shown.state.tool.content
        unwritten.written("the readiness of panel")
        page.draw(5)
        assert ">Disk<" not in shown.state.tool.content
