"""The virtual device's world: shafts that close switches, motors that lose steps, buttons; all in virtual time."""

from __future__ import annotations

import random

import pytest
from bench_firmware import Bench
from msgspec.structs import replace

from gemelo.firmware.bindings.injection import InjectRefused
from gemelo.libraries.arm.device.device_config import device_config
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, InjectKind
from gemelo.schemas.device_config import DeviceConfig, HomingConfig, InputConfig, InputRole, JointConfig

OK, NOT_READY, NOT_ARMED, ESTOP_PRESSED = 0, 12, 17, 18
CYCLE = 8  # [steps] by which a motor of rm1 slips
HOME, ARM, DISARM, RESET, OUTPUT = (
    DeviceCommandKind.HOME,
    DeviceCommandKind.ARM,
    DeviceCommandKind.DISARM,
    DeviceCommandKind.RESET,
    DeviceCommandKind.OUTPUT,
)
LEAD = 300  # [ms] and a little more from energised drivers to motion


def rm1_bench(arm: ArmDescription, shaft: tuple[int, ...] = (0, 0, 0), referenced: bool = True) -> Bench:
    """rm1's device with its motors, energised for long enough."""
    motors = [joint.drive.motor for joint in arm.joints]
    bench = Bench(device_config(arm), motors=motors, shaft=shaft, referenced=referenced)
    bench.run(LEAD)
    return bench


def six_joints() -> DeviceConfig:
    """Like PAROL6's: microsteps, six switches, three groups, an 80 kHz tick."""
    joints, inputs = [], []
    for j in range(6):
        homing = HomingConfig(
            input=j, group=j // 2, direction=1 if j % 2 else -1, fast_q8=4000 * 256, slow_q8=400 * 256,
            back_off_q8=600 * 256, position_q8=(14_500 if j % 2 else -14_500) * 256, max_travel_q8=32_000 * 256,
            timeout_ms=60_000,
        )  # fmt: skip
        limits = {"lower_q8": -14_000 * 256, "upper_q8": 14_000 * 256}
        rates = {"max_velocity_q8": 15_000 * 256, "max_acceleration_q8": 40_000 * 256}
        joints.append(JointConfig(name=f"J{j + 1}", inverted=j % 3 == 0, homing=homing, **limits, **rates))
        inputs.append(InputConfig(name=f"home_{j + 1}", pin=30 + j, role=InputRole.HOME, joint=j, inverted=j % 2 == 0))
    return DeviceConfig(name="six", tick_hz=80_000, joints=tuple(joints), inputs=tuple(inputs))


@pytest.mark.parametrize("shaft", [(0, 0, 0), (5000, -120, 300), (-8000, 150, 20)])
def test_rm1_finds_its_place_from_anywhere(rm1: ArmDescription, shaft: tuple[int, ...]):
    bench = rm1_bench(rm1, shaft=shaft, referenced=False)
    assert bench.device.mode == DeviceMode.UNREFERENCED
    assert bench.order(HOME) == OK
    bench.run_until(DeviceMode.IDLE, 150.0)
    assert bench.device.referenced
    assert bench.details("homed") == ["q3", "q2", "q1"]  # by groups
    for counted, true in zip(bench.device.steps, bench.device.shaft, strict=True):
        assert abs(counted - true) <= 1  # the rotor hangs a little behind its field
    for joint, steps in zip(bench.device.config.joints, bench.device.steps, strict=True):
        assert joint.lower_q8 <= steps * 256 <= joint.upper_q8


@pytest.mark.parametrize("seed", range(5))
def test_six_joints_find_their_places_two_by_two(seed: int):
    shaft = [random.Random(seed).randint(-13_000, 13_000) for _ in range(6)]
    bench = Bench(six_joints(), shaft=shaft, referenced=False)
    bench.run(10)
    assert bench.order(HOME) == OK
    bench.run_until(DeviceMode.IDLE, 60.0)
    assert bench.device.steps == bench.device.shaft
    homed = [str(detail) for detail in bench.details("homed")]
    groups = [sorted(homed[i : i + 2]) for i in range(0, 6, 2)]
    assert groups == [["J1", "J2"], ["J3", "J4"], ["J5", "J6"]]


@pytest.mark.parametrize("slip", [37, -37])
def test_homing_proves_steps_that_were_lost(rm1: ArmDescription, slip: int):
    bench = rm1_bench(rm1)
    assert bench.move((2000, 40, 60), 3.0) == OK
    bench.run(1500)
    bench.press(InjectKind.SLIP, "q1", slip)
    bench.run(2500)
    assert bench.device.steps == (2000, 40, 60)  # what the counter believes
    assert bench.device.shaft == (2000 + slip, 40, 60)
    assert bench.order(HOME) == OK
    bench.run_until(DeviceMode.IDLE, 150.0)
    found = [str(detail).removesuffix(" steps off").split(": ") for detail in bench.details("homed")]
    assert [name for name, _ in found] == ["q3", "q2", "q1"]
    off = [int(steps) for _, steps in found]
    assert abs(off[0]) <= 1
    assert abs(off[1]) <= 1
    assert abs(off[2] - slip) <= 1
    for counted, true in zip(bench.device.steps, bench.device.shaft, strict=True):
        assert abs(counted - true) <= 1


def passable() -> DeviceConfig:
    """Six joints whose home switches, 14,500 steps from zero, lie within their limits."""
    config = six_joints()
    return replace(
        config, joints=tuple(replace(joint, lower_q8=-16_000 * 256, upper_q8=16_000 * 256) for joint in config.joints)
    )


@pytest.mark.parametrize("slip", [0, 50, -50])
def test_a_home_switch_that_a_motion_passes_proves_steps_that_were_lost_and_corrects_nothing(slip: int):
    bench = Bench(passable())
    bench.device.slip(0, slip)
    assert bench.move((-15_200, 15_200, 0, 0, 0, 0), 5.0) == OK
    bench.run(5500)
    assert bench.device.mode == DeviceMode.IDLE
    found = dict(str(detail).removesuffix(" steps off").split(": ") for detail in bench.details("passed"))
    assert sorted(found) == ["J1", "J2"]
    assert abs(int(found["J1"]) - slip) <= 1
    assert abs(int(found["J2"])) <= 1
    assert bench.device.steps[:2] == (-15_200, 15_200)
    assert bench.move((0, 0, 0, 0, 0, 0), 5.0) == OK  # off the switches: no closing
    bench.run(5500)
    assert len(bench.details("passed")) == 2


def test_a_home_switch_that_a_hand_presses_is_not_passed():
    bench = Bench(passable())
    bench.press(InjectKind.SWITCH, "home_1", 1)
    bench.run(100)
    bench.press(InjectKind.SWITCH, "home_1", -1)
    assert bench.move((2000, 2000, 0, 0, 0, 0), 2.0) == OK  # J1 homes downwards
    bench.run(1000)
    bench.press(InjectKind.SWITCH, "home_1", 1)
    bench.run(1500)
    assert bench.details("passed") == []


def test_a_motor_that_is_asked_for_more_than_it_has_loses_cycles_and_only_the_shaft_knows(rm1: ArmDescription):
    config = device_config(rm1)
    fast = [JointConfig(name=j.name, lower_q8=-(1 << 30), upper_q8=1 << 30, max_velocity_q8=256 * 24_000,
            max_acceleration_q8=256 * 4_000_000) for j in config.joints]  # fmt: skip
    bench = Bench(DeviceConfig(name="fast", joints=tuple(fast)), motors=[j.drive.motor for j in rm1.joints])
    assert bench.move((12_000, 0, 0), 1.5) == OK  # 15,000 steps/s: the curve ends at 10,000
    bench.run(3000)
    assert bench.device.steps == (12_000, 0, 0)
    lost = 12_000 - bench.device.shaft[0]
    assert lost > 1000
    assert lost % CYCLE == 0
    assert bench.device.max_slot_error <= 128  # the device itself did all it was told


def test_a_joint_that_is_held_fast_loses_its_steps(rm1: ArmDescription):
    bench = rm1_bench(rm1)
    bench.press(InjectKind.BLOCK, "q1")
    assert bench.move((1003, 10, 10), 2.0) == OK
    bench.run(3000)
    assert bench.device.steps == (1003, 10, 10)
    assert bench.device.shaft == (0, 10, 10)
    bench.press(InjectKind.BLOCK, "q1", 0.0)
    bench.run(1000)
    assert bench.device.shaft == (1003 % CYCLE, 10, 10)


def test_the_e_stop_silences_a_moving_arm_within_a_tick_and_wants_a_person(rm1: ArmDescription):
    bench = rm1_bench(rm1)
    assert bench.order(OUTPUT, 0, 1) == OK
    assert bench.device.outputs == ("avanzar",)
    assert bench.move((4000, 50, 50), 4.0) == OK
    bench.run(2000)
    before = bench.device.steps
    bench.press(InjectKind.ESTOP)
    bench.device.advance(bench.device.now_us + 40)  # two ticks
    stood = bench.device.steps
    assert abs(stood[0] - before[0]) <= 1
    bench.run(500)
    assert bench.device.steps == stood
    assert bench.device.mode == DeviceMode.ESTOP
    assert not bench.device.armed
    assert not bench.device.referenced
    assert bench.device.outputs == ()
    assert bench.details("estop") == ["estop"]
    assert bench.order(RESET) == ESTOP_PRESSED
    bench.press(InjectKind.ESTOP, value=0.0)
    bench.run(10)
    assert bench.order(RESET) == OK
    assert bench.order(HOME) == NOT_ARMED
    assert bench.order(ARM) == OK
    bench.run(LEAD)
    assert bench.order(HOME) == OK
    bench.run_until(DeviceMode.IDLE, 150.0)


def test_a_disarmed_arm_can_be_turned_by_hand_and_must_home_again(rm1: ArmDescription):
    bench = rm1_bench(rm1)
    assert bench.order(DISARM) == OK
    bench.press(InjectKind.SLIP, "q2", 25)
    bench.run(100)
    assert bench.device.steps == (0, 0, 0)
    assert bench.device.shaft == (0, 25, 0)
    assert not bench.device.referenced
    assert bench.order(ARM) == OK
    bench.run(LEAD)
    assert bench.order(HOME) == OK
    bench.run_until(DeviceMode.IDLE, 150.0)
    assert abs(bench.device.steps[1] - bench.device.shaft[1]) <= 1


def test_a_shaft_that_reaches_a_limit_switch_outside_homing_is_a_fault(rm1: ArmDescription):
    bench = rm1_bench(rm1)
    switch = bench.device.config.joints[0].homing
    assert switch is not None
    bench.press(InjectKind.SLIP, "q1", switch.position_q8 // 256)
    bench.run(10)
    assert bench.device.mode == DeviceMode.FAULT
    assert bench.details("fault") == ["limit_q1"]


def test_a_switch_that_never_closes_is_a_fault_of_homing_and_works_again_once_it_does(rm1: ArmDescription):
    bench = rm1_bench(rm1, shaft=(0, 0, 400), referenced=False)
    bench.press(InjectKind.SWITCH, "limit_q3", 0.0)
    bench.run(10)
    assert bench.order(HOME, argument=4) == OK
    bench.run_until(DeviceMode.FAULT, 120.0)
    assert bench.details("fault") == ["q3: its switch was not found"]
    bench.press(InjectKind.SWITCH, "limit_q3", -1.0)
    bench.run(10)
    assert bench.order(RESET) == OK
    assert bench.order(HOME, argument=4) == OK
    bench.run_until(DeviceMode.UNREFERENCED, 60.0)  # q1 and q2 have not homed
    assert bench.details("homed") == ["q3"]


def test_a_switch_that_stays_closed_is_a_fault_of_homing(rm1: ArmDescription):
    bench = rm1_bench(rm1, referenced=False)
    bench.press(InjectKind.SWITCH, "limit_q3")
    bench.run(10)
    assert bench.order(RESET) == OK  # a limit switch that closes by itself is a fault already
    assert bench.order(HOME, argument=4) == OK
    bench.run_until(DeviceMode.FAULT, 120.0)
    assert bench.details("fault")[-1] == "q3: its switch is still active after backing off"


def test_a_slot_task_that_hangs_stops_the_pulses_and_is_a_fault(rm1: ArmDescription):
    bench = rm1_bench(rm1)
    assert bench.move((4000, 0, 0), 4.0) == OK
    bench.run(2000)
    bench.press(InjectKind.FREEZE, value=0.5)
    bench.device.advance(bench.device.now_us + 4_000)
    stood = bench.device.steps
    bench.run(1000)
    assert bench.device.steps == stood
    assert bench.device.mode == DeviceMode.FAULT
    assert bench.details("fault") == ["no new slot for 3 ms"]


def test_sensors_read_what_they_are_given(rm1: ArmDescription):
    bench = rm1_bench(rm1)
    assert bench.sensors["ultra"] == pytest.approx(20.0, abs=0.1)
    assert bench.sensors["bateria"] == pytest.approx(7.4, abs=0.01)
    bench.press(InjectKind.SENSOR, "bateria", 6.3)
    bench.run(200)
    assert bench.sensors["bateria"] == pytest.approx(6.3, abs=0.002)
    assert bench.sensors["ultra"] == pytest.approx(20.0, abs=0.1)


@pytest.mark.parametrize(
    ("kind", "target", "value", "reason"),
    [
        (InjectKind.BLOCK, "q9", 1.0, "there is no joint 'q9'; there is q1, q2, q3"),
        (InjectKind.SWITCH, "estopp", 1.0, "there is no input 'estopp'"),
        (InjectKind.SWITCH, "limit_q1", 2.0, "the value 2 is none of -1, 0, 1"),
        (InjectKind.SENSOR, "baterie", 1.0, "there is ultra, bateria"),
        (InjectKind.FREEZE, "", 1e9, "not 0 to 60"),
        (InjectKind.SLIP, "q1", 1e12, "not -1e[+]06 to 1e[+]06"),
        (InjectKind.REBOOT, "", 1.0, "only the virtual ESP32's process"),
    ],
)
def test_a_press_that_cannot_be_is_refused_with_what_could_be(
    rm1: ArmDescription, kind: InjectKind, target: str, value: float, reason: str
):
    bench = rm1_bench(rm1)
    with pytest.raises(InjectRefused, match=reason):
        bench.press(kind, target, value)
    assert bench.device.shaft == (0, 0, 0)


def test_a_device_without_an_e_stop_says_so():
    bench = Bench(six_joints())
    with pytest.raises(InjectRefused, match="no e-stop"):
        bench.press(InjectKind.ESTOP)
