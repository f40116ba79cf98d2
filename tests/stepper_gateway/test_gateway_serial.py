"""The gateway and the virtual ESP32's own process over a serial line, without any broker."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.deployment import Deployment, DeviceKind, SerialSection, Wire
from gemelo.schemas.device import DeviceMode, InjectKind, InjectRequest
from gemelo.services.stepper_gateway.main import open_link, serial_device
from tests.stepper_gateway.processes import DEVICE, Processes
from tests.stepper_gateway.wired import WiredGateway

HOME = (0.0, 0.0, 0.0)
NEAR = (0.1, -0.2, 0.01)


@pytest.fixture
def cabled(tmp_path: Path) -> Iterator[Processes]:
    with closing(Processes("mosquitto", tmp_path, Wire.SERIAL)) as found:
        found.start(DEVICE)
        yield found


def gateway_of(processes: Processes) -> WiredGateway:
    return WiredGateway(processes.port, lambda wake: open_link(processes.deployment, "rm1", wake))


def test_a_move_and_everything_that_is_json_over_a_cable(cabled: Processes) -> None:
    with closing(gateway_of(cabled)) as gateway:
        gateway.ready()
        assert gateway.move_to(NEAR).accepted
        assert gateway.finish()[0] == GoalStatusCode.SUCCEEDED
        assert gateway.configure().accepted
        assert gateway.answer_to_press(InjectRequest(kind=InjectKind.SENSOR, target="bateria", value=7.5)).accepted
        assert gateway.run(3.0, lambda: bool(gateway.published["sensors"] and gateway.published["device/shaft"]))
        assert gateway.answer_to_press(InjectRequest(kind=InjectKind.ESTOP)).accepted
        assert gateway.run(2.0, lambda: gateway.state.mode == DeviceMode.ESTOP)
        assert gateway.core.bad_frames == 0
        trips = sorted(ack.round_trip for ack in gateway.published["command_acks"])
        assert trips[len(trips) // 2] < 0.05


def test_a_device_that_dies_on_the_cable_aborts_the_goal_and_is_met_again(cabled: Processes) -> None:
    with closing(gateway_of(cabled)) as gateway:
        gateway.ready()
        assert gateway.move_to((1.0, -1.0, 0.1)).accepted
        gateway.run(1.0)
        cabled.kill(DEVICE)
        assert gateway.finish()[0] == GoalStatusCode.ABORTED
        assert not gateway.published["device/status"][-1].online
        cabled.start(DEVICE)
        gateway.ready()
        assert gateway.published["device/status"][-1].online


def test_a_virtual_device_has_a_line_of_its_own_and_a_board_the_one_that_is_named() -> None:
    board = Deployment(device=DeviceKind.BOARD, serial=SerialSection(device="/dev/ttyACM3"))
    assert serial_device(board) == "/dev/ttyACM3"
    assert serial_device(Deployment()).endswith("virtual_esp32.tty")
