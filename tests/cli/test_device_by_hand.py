"""A person's work with the device by the command line, on a simulated arm: homing, faults, outputs, speed."""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator

import pytest

import gemelo
from gemelo.schemas.device import DeviceState
from gemelo.schemas.topics import DEVICE_SHAFT, DEVICE_STATE
from gemelo.tools.cli.common.errors import ExitCode
from tests.simulated import TypedAt

NEAR_ITS_SWITCHES = {
    "brazo_joint": -2.9,
    "antebrazo_joint": -2.9,
    "efector_joint": 0.19,
}  # a homing is short from there


@pytest.fixture
def arm() -> Iterator[gemelo.SimulatedArm]:
    with gemelo.simulate("rm1", start=NEAR_ITS_SWITCHES) as simulated:
        yield simulated


@pytest.fixture
def typed(arm: gemelo.SimulatedArm) -> TypedAt:
    return TypedAt(arm)


def test_a_whole_arm_homes_by_its_switches_and_moves(arm: gemelo.SimulatedArm, typed: TypedAt) -> None:
    said = typed("home")
    for name in arm.joint_names:
        assert f"{name}: home" in said
    assert "homed 3 of 3 joints" in said
    assert arm.device.mode is gemelo.DeviceMode.IDLE
    assert all(arm.device.state.referenced)
    typed("move", "--named", "ready")


def test_an_emergency_stop_ends_the_move_and_a_person_leads_out_of_it(arm: gemelo.SimulatedArm, typed: TypedAt) -> None:
    motion = arm.start(named="ready", speed=0.5)
    assert arm.wait_for(lambda: motion.progress > 0.1, 10.0)
    typed("device", "press", "estop")
    assert arm.wait_for(lambda: arm.device.mode is gemelo.DeviceMode.ESTOP, 5.0)
    with pytest.raises(gemelo.Aborted, match=r"(?i)stop"):
        motion.wait()
    assert not arm.device.state.armed
    assert arm.wait_for(lambda: not any(arm.device.state.referenced), 5.0)
    assert "EMERGENCY_STOP" in typed("device", "status")
    assert "release it, `gemelo reset`" in typed("home", code=ExitCode.FAILED)
    typed("reset", code=ExitCode.FAILED)
    typed("device", "press", "release")
    typed("reset")
    assert "`gemelo device arm`" in typed("home", code=ExitCode.FAILED)
    typed("device", "arm")
    assert "homed 3 of 3 joints" in typed("home")
    typed("move", "--named", "ready")


def test_lost_steps_are_seen_beside_the_counter_and_proven_by_homing(arm: gemelo.SimulatedArm, typed: TypedAt) -> None:
    joint, index = "efector_joint", 2
    shaft = arm.node.latest(DEVICE_SHAFT)
    typed("home", joint)

    def off() -> int:
        assert shaft.message is not None
        return shaft.message.shaft[index] - shaft.message.steps[index]

    assert arm.wait_for(lambda: shaft.message is not None, 5.0)
    before = off()
    typed("device", "press", "slip", joint, "-40")
    assert arm.wait_for(lambda: off() == before - 40, 5.0)
    report = json.loads(typed("home", joint, "--json").splitlines()[-1])
    assert abs(report["steps_off"][joint]) == pytest.approx(40, abs=1)
    assert arm.wait_for(lambda: abs(off() - before) <= 1, 5.0)


def test_ctrl_c_stops_a_homing_and_the_joint_is_unreferenced(arm: gemelo.SimulatedArm, typed: TypedAt) -> None:
    pressed: list[DeviceState] = []

    def press_once(state: DeviceState) -> None:
        if not pressed and state.mode is gemelo.DeviceMode.HOMING:
            pressed.append(state)
            signal.raise_signal(signal.SIGINT)

    arm.node.subscribe(DEVICE_STATE, press_once)
    assert "stopped" in typed("home", "efector_joint", code=ExitCode.CANCELLED)
    assert pressed
    assert arm.wait_for(lambda: arm.device.mode is gemelo.DeviceMode.UNREFERENCED, 5.0)
    assert arm.device.state.referenced == (True, True, False)


def test_an_output_is_switched_and_a_sensor_is_read(arm: gemelo.SimulatedArm, typed: TypedAt) -> None:
    typed("output", "avanzar", "on")
    assert arm.wait_for(lambda: arm.device.state.outputs == ("avanzar",), 2.0)
    typed("output", "avanzar", "off")
    assert arm.wait_for(lambda: arm.device.state.outputs == (), 2.0)
    typed("device", "press", "sensor", "bateria", "6.9")
    arm.sim.sleep(0.5)
    read = {each["name"]: each["value"] for each in json.loads(typed("sensors", "--json"))}
    assert read["bateria"] == pytest.approx(6.9, abs=0.02)


def test_half_the_speed_takes_twice_the_time(typed: TypedAt) -> None:
    there, back = ("--joints", "brazo_joint=-1.5rad"), ("--joints", "brazo_joint=-2.9rad")
    whole = json.loads(typed("move", *there, "--json"))
    typed("speed", "50%")
    half = json.loads(typed("move", *back, "--json"))
    assert half["duration_s"] == pytest.approx(whole["duration_s"], rel=0.05)
    assert 1.7 < half["took_s"] / whole["took_s"] < 2.4
    assert max(map(abs, half["final_error_steps"].values())) <= 0.5


def test_a_configuration_in_force_is_said_and_not_pushed_twice(typed: TypedAt) -> None:
    assert "in force" in typed("device", "status")
    assert "nothing to do" in typed("device", "config", "--push")
