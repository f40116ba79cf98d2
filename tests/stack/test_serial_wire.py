"""The stack over a serial line: the virtual board's own, instead of MQTT."""

from __future__ import annotations

import json

import pytest

from gemelo.tools.stack.stack import Stack
from tests.stack.gemelo import gemelo

PROCESSES = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner")


@pytest.fixture
def stack():
    running = Stack(processes=PROCESSES)
    running.deployment |= {
        "GEMELO_WIRE": "serial",
        "GEMELO_SERIAL_DEVICE": str(running.run / "virtual_esp32.tty"),
    }
    with running:
        yield running


def test_an_arm_on_a_serial_line_moves_and_is_pressed_without_a_bad_frame(stack):
    gemelo(stack, "move", "--named", "ready")
    before = json.loads(gemelo(stack, "state", "--json"))
    gemelo(stack, "device", "press", "slip", "brazo_joint", "40")
    gemelo(stack, "move", "--named", "home")
    assert before != json.loads(gemelo(stack, "state", "--json"))
    status = json.loads(gemelo(stack, "device", "status", "--json"))
    assert status["state"]["bad_frames"] == 0
    assert status["state"]["underruns"] == 0
