"""A person's work with the device by the command line, on the whole stack: homing, faults, outputs, speed."""

from __future__ import annotations

import json
import signal
import subprocess
from functools import partial

import pytest

from schemas.actions import GoalStatusCode
from schemas.device import DeviceMode
from schemas.topics import DEVICE_SHAFT
from services.cli.errors import ExitCode
from tests.stack import gemelo as command

pytestmark = pytest.mark.stands_at(  # a homing is short from there
    brazo_joint=-2.9, antebrazo_joint=-2.9, efector_joint=0.19
)


@pytest.fixture
def gemelo(stack):
    return partial(command.gemelo, stack)


@pytest.fixture
def ready(operator):
    """A person before an arm that stands in Idle, near its switches."""
    assert operator.wait_for(lambda: operator.device.message is not None, 5.0)
    assert operator.wait_for(lambda: operator.device.message.mode is DeviceMode.IDLE, 5.0)
    return operator


def mode_becomes(operator, mode, timeout=5.0):
    return operator.wait_for(lambda: operator.device.message.mode is mode, timeout)


def test_a_whole_arm_homes_by_its_switches_and_moves(ready, gemelo):
    said = gemelo("home")
    for name in ready.arm.joint_names:
        assert f"{name}: home" in said
    assert "homed 3 of 3 joints" in said
    assert mode_becomes(ready, DeviceMode.IDLE)
    assert all(ready.device.message.referenced)
    gemelo("move", "--named", "ready")


def test_an_emergency_stop_ends_the_move_and_a_person_leads_out_of_it(ready, gemelo):
    handle = ready.send(ready.plan(0.5))
    assert ready.wait_for(ready.is_moving, 10.0)
    gemelo("device", "press", "estop")
    assert mode_becomes(ready, DeviceMode.ESTOP)
    outcome = handle.wait(10.0)
    assert outcome.status is GoalStatusCode.ABORTED
    assert "stop" in outcome.result.error_string.lower()
    assert not ready.device.message.armed
    assert not any(ready.device.message.referenced)
    assert "EMERGENCY_STOP" in gemelo("device", "status")
    assert "release it, `gemelo reset`" in gemelo("home", code=ExitCode.FAILED)
    gemelo("reset", code=ExitCode.FAILED)
    gemelo("device", "press", "release")
    gemelo("reset")
    assert "`gemelo device arm`" in gemelo("home", code=ExitCode.FAILED)
    gemelo("device", "arm")
    assert "homed 3 of 3 joints" in gemelo("home")
    gemelo("move", "--named", "ready")


def test_lost_steps_are_seen_beside_the_counter_and_proven_by_homing(ready, gemelo):
    joint, index = "efector_joint", 2
    shaft = ready.node.latest(DEVICE_SHAFT)
    gemelo("home", joint)
    assert ready.wait_for(lambda: shaft.message is not None, 5.0)

    def off():
        return shaft.message.shaft[index] - shaft.message.steps[index]

    before = off()
    gemelo("device", "press", "slip", joint, "-40")
    assert ready.wait_for(lambda: off() == before - 40, 5.0)
    report = json.loads(gemelo("home", joint, "--json"))
    assert abs(report["steps_off"][joint]) == pytest.approx(40, abs=1)
    assert ready.wait_for(lambda: abs(off() - before) <= 1, 5.0)


def test_ctrl_c_stops_a_homing_and_the_joint_is_unreferenced(ready, stack):
    words = [*command.COMMAND, "home", "efector_joint"]
    with subprocess.Popen(words, cwd=stack.root, env=stack.environment, stderr=subprocess.PIPE, text=True) as homing:
        assert mode_becomes(ready, DeviceMode.HOMING, 15.0)
        homing.send_signal(signal.SIGINT)
        said = homing.communicate(timeout=15.0)[1]
    assert homing.returncode == ExitCode.CANCELLED
    assert "stopped" in said
    assert mode_becomes(ready, DeviceMode.UNREFERENCED)
    assert ready.device.message.referenced == (True, True, False)


def test_an_output_is_switched_and_a_sensor_is_read(operator, gemelo):
    assert operator.wait_for(lambda: operator.device.message is not None, 5.0)
    gemelo("output", "avanzar", "on")
    assert operator.wait_for(lambda: operator.device.message.outputs == ("avanzar",), 2.0)
    gemelo("output", "avanzar", "off")
    assert operator.wait_for(lambda: operator.device.message.outputs == (), 2.0)
    gemelo("device", "press", "sensor", "bateria", "6.9")
    operator.node.wait(0.5)
    read = {each["name"]: each["value"] for each in json.loads(gemelo("sensors", "--json"))}
    assert read["bateria"] == pytest.approx(6.9, abs=0.02)


def test_half_the_speed_takes_twice_the_time(ready, gemelo):
    there, back = ("--joints", "brazo_joint=-1.5rad"), ("--joints", "brazo_joint=-2.9rad")
    try:
        whole = json.loads(gemelo("move", *there, "--json"))
        gemelo("speed", "50%")
        half = json.loads(gemelo("move", *back, "--json"))
    finally:
        gemelo("speed", "100%")
    assert half["duration_s"] == pytest.approx(whole["duration_s"], rel=0.05)
    assert 1.7 < half["took_s"] / whole["took_s"] < 2.4
    assert max(map(abs, half["final_error_steps"].values())) <= 0.5


def test_a_configuration_in_force_is_said_and_not_pushed_twice(stack, gemelo):
    assert "in force" in gemelo("device", "status")
    assert "nothing to do" in gemelo("device", "config", "--push")
