"""Motors of an imported arm: asked for joint by joint, written as robot.toml, and the step rates that follow."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.urdf import JointKind, UrdfJoint
from gemelo.libraries.arm.motors.speed import fastest_steps, speed_limits
from gemelo.libraries.arm.motors.steps import exact_ratio
from gemelo.libraries.robot_import.parts import PINS, SWITCH_PINS, DriverPart, MotorPart, driver_named, motor_named
from gemelo.libraries.robot_import.questions import BadAnswer, Questions, above_zero, one_of, whole, yes_or_no
from gemelo.schemas.reasons import Reason, Value, because

# Tuning constants: chosen, where a line does not say measured or standard.
PINION_RADIUS = 0.01  # [m]
RAMP_TIME, RAMP_TIME_BARE = 1.0, 0.5  # [s] with motors, and without
SWITCH_MARGIN = 0.02  # of the travel between its end and the switch: room to brake behind it
HOMING_SHARE = 0.3  # of full speed, at most, to the switch
BRAKING_SHARE = 0.7  # of the speed from which the margin is enough to stop


@dataclass(frozen=True)
class JointDrive:
    """What a person answered for one joint."""

    joint: UrdfJoint
    number: int  # from 1, in the arm's order
    motor: MotorPart
    driver: DriverPart
    microsteps: int
    ratio: Fraction  # motor turns per turn of the joint's shaft, without what is in the motor
    step_pin: int
    dir_pin: int
    inverted: bool
    pinion_radius: float | None  # [m] of a sliding joint
    switch: str  # "none", "lower" or "upper"
    switch_pin: int

    @property
    def travel_per_turn(self) -> float:
        """[rad] or [m] of the joint for a turn of its shaft."""
        return math.tau * (1.0 if self.pinion_radius is None else self.pinion_radius)

    @property
    def rpm(self) -> float:
        """[rev/min] of the shaft: the URDF's velocity, or less where the motor is slower."""
        assert self.joint.limit is not None
        wanted = 60.0 * self.joint.limit.velocity / self.travel_per_turn
        return min(wanted, self.motor.most_rpm / float(self.ratio))


def ask_drives(joints: Sequence[UrdfJoint], questions: Questions, motor: str, driver: str) -> list[JointDrive]:
    """For every joint, each with the answers before it as defaults for motor and driver."""
    drives: list[JointDrive] = []
    for number, joint in enumerate(joints, 1):
        before = drives[-1] if drives else None
        names = (before.motor.name, before.driver.name) if before else (motor, driver)
        drives.append(_ask(joint, number, questions, *names))
    return drives


def _ask(joint: UrdfJoint, number: int, questions: Questions, motor: str, driver: str) -> JointDrive:
    place = (number - 1) % len(PINS)

    def key(word: str) -> tuple[str, Reason]:
        return f"{joint.name}.{word}", because("import.ask.drive", joint=joint.name, what=word)

    part = questions.ask(*key("motor"), motor, motor_named)
    board = questions.ask(*key("driver"), driver, driver_named)
    slides = joint.kind is JointKind.PRISMATIC
    steps = questions.ask(*key("microsteps"), str(board.usual), lambda text: _microsteps(text, board))
    ratio = questions.ask(*key("ratio"), "1", exact_ratio)
    radius = questions.ask(*key("pinion_radius"), str(PINION_RADIUS), above_zero) if slides else None
    step_pin = questions.ask(*key("step_pin"), str(PINS[place][0]), _pin)
    dir_pin = questions.ask(*key("dir_pin"), str(PINS[place][1]), _pin)
    inverted = questions.ask(*key("inverted"), "no", yes_or_no)
    switch = questions.ask(*key("switch"), "none", one_of("none", "lower", "upper"))
    switch_pin = -1 if switch == "none" else questions.ask(*key("switch_pin"), str(SWITCH_PINS[place]), _pin)
    return JointDrive(joint, number, part, board, steps, ratio, step_pin, dir_pin, inverted, radius, switch, switch_pin)


def _microsteps(text: str, driver: DriverPart) -> int:
    value = whole(text)
    if value not in driver.microsteps:
        known = tuple(map(str, driver.microsteps))
        raise BadAnswer(because("import.answer.microsteps", driver=driver.name, known=known))
    return value


def _pin(text: str) -> int:
    value = whole(text)
    if not 0 <= value <= 63:
        raise BadAnswer(because("import.answer.gpio"))
    return value


def driven_toml(
    drives: Sequence[JointDrive], device: str, reference: Mapping[str, float], accelerations: Mapping[str, float]
) -> str:
    """[device], [[driver]], [[input]] and [[joint]] of robot.toml; `reference` [rad] or [m] is where the arm is put,
    `accelerations` [rad/s^2] or [m/s^2] are what its owner allows."""
    drivers = {drive.driver.name: drive.driver for drive in drives}
    blocks = [f"[device]\nname = {json.dumps(device)}\n"]
    blocks += [
        f"# {driver.source}.\n[[driver]]\nname = {json.dumps(driver.name)}\nstep_high_us = {driver.step_high_us}\n"
        f"step_low_us = {driver.step_low_us}\ndir_setup_us = {driver.dir_setup_us}\n"
        f"enable_lead_ms = {driver.enable_lead_ms}\n"
        for driver in drivers.values()
    ]
    blocks += [
        f'[[input]]\nname = "home_q{drive.number}"\npin = {drive.switch_pin}\nrole = "home"\n'
        f'joint = {json.dumps(drive.joint.name)}\nactive = "high"\npull = "up"\n'
        for drive in drives
        if drive.switch != "none"
    ]
    return "\n".join([*blocks, *(_joint_toml(drive, reference[drive.joint.name], accelerations) for drive in drives)])


def bare_toml(joints: Sequence[UrdfJoint], reference: Mapping[str, float], accelerations: Mapping[str, float]) -> str:
    """[[joint]] of an arm without motors: speeds that a person may change; `reference` [rad] or [m] and
    `accelerations` [rad/s^2] or [m/s^2] by joint."""
    blocks = ["# Without motors: to plan and look at only. docs/my_own_arm.md says what to add for a real arm.\n"]
    for joint in joints:
        speed = ""  # a sliding joint's is its URDF's
        if joint.kind is not JointKind.PRISMATIC and joint.limit is not None:
            speed = f"max_speed_rpm = {60.0 * joint.limit.velocity / math.tau:.9g}\n"
        velocity = joint.limit.velocity if joint.limit is not None else 0.0
        ramp = _ramp_time(RAMP_TIME_BARE, velocity, accelerations.get(joint.name))
        rest = f"ramp_time = {ramp}\n{_reference(reference[joint.name])}"
        blocks.append(f"[[joint]]\nname = {json.dumps(joint.name)}\n{speed}{rest}")
    return "\n".join(blocks)


def _reference(position: float) -> str:
    """[rad] or [m] that `gemelo reference` declares, where it is not 0."""
    return f"reference_position = {position:.9g}\n" if position else ""


def _ramp_time(usual: float, velocity: float, acceleration: float | None) -> float:
    """[s] to full speed [rad/s] or [m/s]; longer than usual where the acceleration [rad/s^2] or [m/s^2] is less."""
    return usual if acceleration is None else max(usual, math.ceil(1e4 * velocity / acceleration) / 1e4)


def _joint_toml(drive: JointDrive, reference: float, accelerations: Mapping[str, float]) -> str:
    ramp = _ramp_time(RAMP_TIME, drive.rpm / 60.0 * drive.travel_per_turn, accelerations.get(drive.joint.name))
    rack = ""
    if drive.pinion_radius is not None:
        rack = f'transmission = "rack_and_pinion"\npinion_radius = {drive.pinion_radius!r}\n'
    total = drive.ratio * Fraction(drive.motor.ratio)
    return (
        f"# {drive.motor.name}: {drive.motor.source}.\n"
        f'[[joint]]\nname = {json.dumps(drive.joint.name)}\nwire_name = "q{drive.number}"\n{rack}'
        f"max_speed_rpm = {drive.rpm:.9g}\nramp_time = {ramp}\n"
        f"{_reference(reference)}{_homing_toml(drive)}"
        f"\n[joint.motor]\ndriver = {json.dumps(drive.driver.name)}\n"
        f"pulses_per_turn = {drive.motor.full_steps * drive.microsteps}\ngear_ratio = {json.dumps(str(total))}\n"
        f"step_pin = {drive.step_pin}\ndir_pin = {drive.dir_pin}\ninverted = {str(drive.inverted).lower()}\n"
    )


def _homing_toml(drive: JointDrive) -> str:
    """Where there is a switch: slow enough to stop before the travel's end."""
    limit = drive.joint.limit
    if drive.switch == "none" or limit is None:
        return ""
    turns = drive.joint.kind is JointKind.CONTINUOUS
    travel = math.tau if turns else limit.upper - limit.lower
    margin, speed = SWITCH_MARGIN * travel, drive.rpm / 60.0 * drive.travel_per_turn
    fast = min(HOMING_SHARE * speed, BRAKING_SHARE * math.sqrt(2.0 * speed / RAMP_TIME * margin))
    position = 0.0 if turns else limit.lower + margin if drive.switch == "lower" else limit.upper - margin
    timeout = math.ceil(2.0 * (travel / fast + 12.0 * margin / fast))
    most = f"max_travel = {1.1 * travel:.6g}\n" if turns else ""
    return (
        f'\n[joint.homing]\nswitch = "home_q{drive.number}"\ndirection = "{drive.switch}"\nposition = {position:.6g}\n'
        f"fast = {fast:.4g}\nslow = {fast / 5.0:.4g}\nback_off = {margin:.4g}\ntimeout = {float(timeout)}\n{most}"
    )


def speed_lines(arm: ArmDescription) -> list[Reason]:
    """The step rate of every joint at full speed, and its share of what driver and tick allow."""
    tick = arm.device.tick_hz
    lines = [because("import.speed", tick=1.0 / tick, kilohertz=tick / 1000)]
    for joint in arm.joints:
        speed = speed_limits(joint.drive)
        rate = float(speed.step_rate)
        driver = 1e6 / (joint.driver.step_high_us + joint.driver.step_low_us)
        fastest = fastest_steps(joint.driver, tick)
        values: dict[str, Value] = {
            "joint": joint.name, "rpm": joint.drive.max_speed_rpm, "rate": rate,
            "acceleration": float(speed.step_acceleration), "driver": joint.driver.name, "most": driver,
            "share": rate / driver, "tick_most": float(fastest), "tick_share": float(rate / fastest),
        }  # fmt: skip
        lines.append(because("import.speed.joint", **values))
    return lines
