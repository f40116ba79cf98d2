"""The device configuration, made from the arm's description: joints, servo, switches, outputs and sensors."""

from __future__ import annotations

import math
import re
from fractions import Fraction

from msgspec import UNSET, UnsetType

from gemelo.libraries.arm.errors import DescriptionError, Subject
from gemelo.libraries.arm.errors import nearest as near_name
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.libraries.arm.model.gripper import pulse_speed
from gemelo.libraries.arm.model.virtual_drive import MAX_NAME
from gemelo.libraries.arm.motors.steps import Q8, StepScale
from gemelo.schemas.device_config import (
    UNUSED,
    DeviceConfig,
    HomingConfig,
    InputConfig,
    InputRole,
    JointConfig,
    OutputConfig,
    SensorConfig,
    ServoConfig,
)
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.robot import DigitalOutput, Homing, HomingDirection, Input, PinLevel, Sensor

# Knots are rounded to 1/256 step and sampled from profiles that touch their limits.
HEADROOM = 1.02
UNLIMITED_Q8 = 1 << 30  # of a joint without limits: 4 million steps each way
SERVO_NAME = "gripper"  # in what the device says of its configuration
MAX_COUNTS = {"joint": 8, "input": 16, "output": 8, "sensor": 8}  # of one device, the firmware's
DEFAULT_TRAVEL_FACTOR = 1.1  # how far a joint looks for its switch, where robot.toml does not say
NAME = re.compile(rf"[A-Za-z0-9_-]{{1,{MAX_NAME}}}")


def device_config(arm: ArmDescription) -> DeviceConfig:
    """The device configuration of an arm; raises `DescriptionError` with the thing, its value and the remedy."""
    _require_counts(arm)
    device = arm.device
    return DeviceConfig(
        name=device_name(device.name, Subject("device")),
        joints=tuple(_joint(joint, arm) for joint in arm.joints),
        tick_hz=device.tick_hz,
        queue_capacity=device.queue_capacity,
        sensor_hz=_sensor_hz(device.sensor_hz),
        enable_lead_ms=max(math.ceil(joint.driver.enable_lead_ms) for joint in arm.joints),
        armed_at_boot=device.armed_at_boot,
        enable_pin=pin_or_unused(device.enable_pin),
        enable_inverted=device.enable_active is PinLevel.LOW,
        inputs=tuple(input_config(switch, arm) for switch in arm.inputs),
        outputs=tuple(output_config(output) for output in arm.outputs),
        sensors=tuple(sensor_config(sensor) for sensor in arm.sensors),
        servo=_servo(arm),
    )


def reference_steps(arm: ArmDescription) -> tuple[int, ...]:
    """Whole steps of the pose that robot.toml declares as the reference."""
    positions = zip(arm.joints, arm.reference_position, strict=True)
    return tuple(math.floor(joint.steps.to_steps(position) + 0.5) for joint, position in positions)


def _joint(joint: Joint, arm: ArmDescription) -> JointConfig:
    where, motor = Subject("joint", joint.name), joint.drive.motor
    _require_tick(joint, arm.device.tick_hz)
    scale = joint.steps.per_unit * Q8 * HEADROOM
    return JointConfig(
        name=device_name(joint.wire_name, where._replace(part="wire_name")),
        lower_q8=_limit_q8(joint, joint.lower),
        upper_q8=_limit_q8(joint, joint.upper),
        max_velocity_q8=int32(math.ceil(joint.velocity * scale), where._replace(part="velocity")),
        max_acceleration_q8=int32(math.ceil(joint.acceleration * scale), where._replace(part="acceleration")),
        inverted=motor.inverted,
        dir_setup_us=math.ceil(joint.driver.dir_setup_us),
        step_pin=pin_or_unused(motor.step_pin),
        dir_pin=pin_or_unused(motor.dir_pin),
        text_scale_q32=_text_scale(joint.steps),
        homing=_homing(joint.drive.homing, joint, arm) if joint.drive.homing is not None else None,
    )


def _servo(arm: ArmDescription) -> ServoConfig | UnsetType:
    drive = arm.gripper.drive if arm.gripper is not None else None
    if not isinstance(drive, PulseDrive):
        return UNSET
    return ServoConfig(
        name=SERVO_NAME,
        pin=drive.pin,
        lower_us=min(drive.open_us, drive.closed_us),
        upper_us=max(drive.open_us, drive.closed_us),
        speed_us_s=round(pulse_speed(drive)),
        off_at_estop=drive.off_at_estop,
    )


def _homing(homing: Homing, joint: Joint, arm: ArmDescription) -> HomingConfig:
    where = Subject("joint", joint.name)
    names = [switch.name for switch in arm.inputs]
    if homing.switch not in names:
        what = because("robot.homing.no_switch", near_name(homing.switch, names), switch=homing.switch)
        raise DescriptionError(where.around(what))
    return HomingConfig(
        input=names.index(homing.switch),
        group=homing.group,
        direction=1 if homing.direction is HomingDirection.UPPER else -1,
        fast_q8=_steps_q8(joint, homing.fast, where._replace(part="homing.fast")),
        slow_q8=_steps_q8(joint, homing.slow, where._replace(part="homing.slow")),
        back_off_q8=_steps_q8(joint, homing.back_off, where._replace(part="homing.back_off")),
        position_q8=int32(joint.steps.to_q8(homing.position), where._replace(part="homing.position")),
        max_travel_q8=_steps_q8(joint, _max_travel(homing, joint), where._replace(part="homing.max_travel")),
        timeout_ms=int32(math.ceil(homing.timeout * 1000.0), where._replace(part="homing.timeout")),
    )


def _max_travel(homing: Homing, joint: Joint) -> float:
    """[rad] or [m] on the way to the switch."""
    if homing.max_travel is not None:
        return homing.max_travel
    if math.isinf(joint.upper - joint.lower):
        raise DescriptionError(Subject("joint", joint.name).around(because("robot.homing.no_max_travel")))
    return (joint.upper - joint.lower) * DEFAULT_TRAVEL_FACTOR


def _sensor_hz(rate: int) -> int:
    if 1000 % rate:
        lower = next(divisor for divisor in range(rate, 0, -1) if 1000 % divisor == 0)
        raise DescriptionError(because("robot.device.sensor_hz", value=rate, nearest=lower))
    return rate


def _require_counts(arm: ArmDescription) -> None:
    parts = {"joint": arm.joints, "input": arm.inputs, "output": arm.outputs, "sensor": arm.sensors}
    for kind, things in parts.items():
        if len(things) > MAX_COUNTS[kind]:
            raise DescriptionError(because("robot.device.many", count=len(things), kind=kind, limit=MAX_COUNTS[kind]))


def _require_tick(joint: Joint, tick_hz: int) -> None:
    tick_us = 1e6 / tick_hz
    needed_us = max(joint.driver.step_high_us, joint.driver.step_low_us)
    if tick_us < needed_us:
        what = because("robot.device.tick", tick=tick_us * 1e-6, needed=needed_us * 1e-6, driver=joint.driver.name)
        raise DescriptionError(Subject("joint", joint.name).around(what))


def _limit_q8(joint: Joint, position: float) -> int:
    if math.isinf(position):
        return UNLIMITED_Q8 if position > 0 else -UNLIMITED_Q8
    return int32(joint.steps.to_q8(position), Subject("joint", joint.name, "limit"))


def _steps_q8(joint: Joint, value: float, where: Subject) -> int:
    """[1/256 step] of a travel or speed that is not zero."""
    q8 = joint.steps.to_q8(value)
    if q8 < 1:
        raise DescriptionError(where.around(because("robot.wire.too_small", value=value)))
    return int32(q8, where)


def _text_scale(scale: StepScale) -> int:
    """[1/256 step per 1e-7 rad or m] Q32; 0 where it does not fit: the joint then has no text mode."""
    exact = scale.steps_per_turn * Q8 / Fraction(scale.travel_per_turn) / 10**7
    return nearest(exact * 2**32) if exact * 2**32 < 2**63 else 0


def input_config(switch: Input, arm: ArmDescription) -> InputConfig:
    """A switch; raises `DescriptionError` for a joint that is not there."""
    where = Subject("input", switch.name)
    return InputConfig(
        name=device_name(switch.name, where),
        pin=switch.pin,
        role=switch.role,
        joint=_joint_index(switch, arm, where),
        inverted=switch.active is PinLevel.LOW,
        pull=switch.pull,
    )


def _joint_index(switch: Input, arm: ArmDescription, where: Subject) -> int:
    if switch.role is InputRole.ESTOP:
        if switch.joint:
            what = because("robot.estop.joint", remedy("remove_key", key="joint"), joint=switch.joint)
            raise DescriptionError(where.around(what))
        return UNUSED
    if not switch.joint:
        what = because("robot.switch.no_joint", remedy("write_key", key="joint"), role=str(switch.role))
        raise DescriptionError(where.around(what))
    if switch.joint not in arm.joint_names:
        what = because("robot.joint.none", near_name(switch.joint, arm.joint_names), joint=switch.joint)
        raise DescriptionError(where.around(what))
    return arm.joint_names.index(switch.joint)


def output_config(output: DigitalOutput) -> OutputConfig:
    """A digital output."""
    return OutputConfig(
        name=device_name(output.name, Subject("output", output.name)),
        pin=output.pin,
        inverted=output.active is PinLevel.LOW,
        at_boot=output.at_boot,
        off_at_estop=output.off_at_estop,
    )


def sensor_config(sensor: Sensor) -> SensorConfig:
    """A reading, its scale in 1/1000 of its unit."""
    where = Subject("sensor", sensor.name)
    return SensorConfig(
        name=device_name(sensor.name, where),
        kind=sensor.kind,
        pin=sensor.pin,
        trigger_pin=pin_or_unused(sensor.trigger_pin),
        scale_q16=int32(nearest(Fraction(sensor.scale) * 65_536_000), where._replace(part="scale")),
        offset_milli=int32(nearest(Fraction(sensor.offset) * 1000), where._replace(part="offset")),
    )


def nearest(value: Fraction) -> int:
    """The nearest integer (dimensionless), halves upwards."""
    return math.floor(value + Fraction(1, 2))


def int32(value: int, where: Subject) -> int:
    """`value`, if the wire's integers hold it; raises `DescriptionError`."""
    if not -(2**31) <= value < 2**31:
        raise DescriptionError(where.around(because("robot.wire.range", value=value)))
    return value


def device_name(text: str, where: Subject) -> str:
    """`text`, if the firmware takes it as a name; raises `DescriptionError`."""
    if not NAME.fullmatch(text):
        raise DescriptionError(where.around(because("robot.device.name", name=text, limit=MAX_NAME)))
    return text


def pin_or_unused(pin: int | None) -> int:
    """The GPIO, or the number that stands for none."""
    return UNUSED if pin is None else pin
