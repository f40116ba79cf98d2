"""robot.toml is changed while the device works with the old one: nothing moves until a person has pushed it."""

from __future__ import annotations

import shutil

import pytest

from gemelo.tools.cli.common.errors import ExitCode
from gemelo.tools.stack.stack import Stack
from tests.optional import need
from tests.stack.gemelo import gemelo


@pytest.fixture(scope="module")
def own_arm(tmp_path_factory, rm1_folder):
    folder = tmp_path_factory.mktemp("robots") / "rm1"
    shutil.copytree(rm1_folder, folder)
    return folder


@pytest.fixture(scope="module")
def stack(tmp_path_factory, own_arm):
    need("mosquitto")
    environment = {"GEMELO_ROBOT": str(own_arm)}
    processes = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner")
    out = tmp_path_factory.mktemp("out")
    with Stack(broker="mosquitto", out=out, processes=processes, environment=environment) as running:
        yield running


def test_a_changed_robot_file_moves_nothing_until_it_is_pushed(stack, own_arm):
    robot = own_arm / "robot.toml"
    robot.write_text(robot.read_text().replace("max_speed_rpm = 15.0", "max_speed_rpm = 12.0", 1))
    stack.kill("stepper_gateway")
    stack.kill("planner")
    stack.wait_ready(120.0, ("router", "broker", "virtual_esp32", "planner"))
    assert "NOT in force" in gemelo(stack, "device", "status")
    assert "gemelo device config --push" in gemelo(stack, "move", "--named", "ready", code=ExitCode.FAILED)
    assert "--yes" in gemelo(stack, "device", "config", "--push", code=ExitCode.USAGE)
    assert "armed again; no joint is referenced" in gemelo(stack, "device", "config", "--push", "--yes")
    assert "config   in force" in gemelo(stack, "device", "status")
    assert "`gemelo reference`" in gemelo(stack, "move", "--named", "ready", code=ExitCode.FAILED)
    gemelo(stack, "reference")
    gemelo(stack, "move", "--named", "ready")
