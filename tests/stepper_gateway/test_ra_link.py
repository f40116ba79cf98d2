"""Dialect "ra" on a real broker: the gateway's link and the virtual sketch's own process."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from gemelo.libraries.arm.errors import DescriptionError
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind
from gemelo.services.stepper_gateway.main import open_device
from tests.stepper_gateway.dialects import robot_with
from tests.stepper_gateway.harness import move
from tests.stepper_gateway.processes import DEVICE, Processes
from tests.stepper_gateway.wired import WiredGateway


def test_a_sketch_on_a_real_broker_is_met_referenced_moved_and_missed(tmp_path: Path) -> None:
    robot = robot_with(tmp_path, 'dialect = "ra"', "message_time = 1.5", "telemetry_time = 0.3")
    arm = load_arm(robot)
    with closing(Processes("mosquitto", tmp_path, robot=robot)) as processes:
        processes.start_broker()
        with closing(
            WiredGateway(processes.port, lambda wake: open_device(processes.deployment, arm, wake), arm)
        ) as gateway:
            gateway.run(1.0)
            assert "heard" in gateway.reason_not_ready
            processes.start(DEVICE)
            statuses = gateway.published["device/status"]
            assert gateway.run(15.0, lambda: statuses[-1].online)
            gateway.command(DeviceCommandKind.REFERENCE)
            gateway.ready()
            assert gateway.goal(move((0.0, 0.0, 0.0), (0.05, 0.0, 0.0), slower=1.1, arm=arm)).accepted
            status, result = gateway.finish()
            assert (status, result.verified) == (GoalStatusCode.SUCCEEDED, False)
            processes.kill(DEVICE)
            assert gateway.run(5.0, lambda: not statuses[-1].online)
            assert "silent" in statuses[-1].reason


def test_a_dialect_that_is_none_is_refused_with_the_line(tmp_path: Path) -> None:
    with pytest.raises(DescriptionError, match=r"line 1\d.*dialect|dialect.*line 1\d|Invalid enum value"):
        load_arm(robot_with(tmp_path, 'dialect = "rosserial"'))


def test_the_switches_of_robot_toml_are_left_out_where_nobody_would_tell_of_them(tmp_path: Path) -> None:
    arm = load_arm(robot_with(tmp_path, 'dialect = "ra"'))
    assert arm.inputs == ()
    assert all(joint.drive.homing is None for joint in arm.joints)
    plain = load_arm(Path("urdf/rm1").resolve())
    assert all(slow.velocity < joint.velocity for slow, joint in zip(arm.joints, plain.joints, strict=True))
