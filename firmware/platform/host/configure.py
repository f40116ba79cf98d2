"""From the arm's description to what its device is told."""

from __future__ import annotations

import math

from firmware.bindings.device import ConfigError, DeviceConfig, JointConfig
from services.arm.description import Arm, Joint

# Knots are rounded to 1/256 step and sampled from profiles that touch their limits.
HEADROOM = 1.02
WIDEST_Q8 = 1 << 30  # of a joint without limits: 4 million steps each way


def device_config(arm: Arm) -> DeviceConfig:
    """The device of `arm`; raises ConfigError where a driver cannot follow its tick."""
    return DeviceConfig(
        name=arm.device.name,
        joints=tuple(_joint_config(joint, arm.device.tick_hz) for joint in arm.joints),
        tick_hz=arm.device.tick_hz,
        queue_capacity=arm.device.queue_capacity,
    )


def reference_steps(arm: Arm) -> tuple[int, ...]:
    """Whole steps of the pose that robot.toml declares as the reference."""
    positions = zip(arm.joints, arm.reference_position, strict=True)
    return tuple(math.floor(joint.steps.to_steps(position) + 0.5) for joint, position in positions)


def _joint_config(joint: Joint, tick_hz: int) -> JointConfig:
    tick_us = 1e6 / tick_hz
    needed_us = max(joint.driver.step_high_us, joint.driver.step_low_us)
    if tick_us < needed_us:
        raise ConfigError(
            f"joint {joint.name!r}: a tick of {tick_us:g} us is shorter than the {needed_us:g} us "
            f"that its driver {joint.driver.name} needs; lower [device] tick_hz"
        )
    scale = joint.steps.per_unit * 256 * HEADROOM
    return JointConfig(
        name=joint.wire_name,
        lower_q8=_limit_q8(joint, joint.lower),
        upper_q8=_limit_q8(joint, joint.upper),
        max_velocity_q8=math.ceil(joint.velocity * scale),
        max_acceleration_q8=math.ceil(joint.acceleration * scale),
        inverted=joint.drive.motor.inverted,
        dir_setup_us=math.ceil(joint.driver.dir_setup_us),
    )


def _limit_q8(joint: Joint, position: float) -> int:
    if math.isinf(position):
        return WIDEST_Q8 if position > 0 else -WIDEST_Q8
    return joint.steps.to_q8(position)
