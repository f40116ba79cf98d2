"""Switches, outputs and sensors of the device configuration."""

from __future__ import annotations

from fractions import Fraction

from gemelo.libraries.arm.device.device_values import device_name, int32, nearest, pin_or_unused
from gemelo.libraries.arm.errors import DescriptionError, suggestion
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device_config import UNUSED, InputConfig, InputRole, OutputConfig, SensorConfig
from gemelo.schemas.robot import DigitalOutput, Input, PinLevel, Sensor


def input_config(switch: Input, arm: ArmDescription) -> InputConfig:
    """A switch; raises `DescriptionError` for a joint that is not there."""
    where = f'input "{switch.name}"'
    return InputConfig(
        name=device_name(switch.name, where),
        pin=switch.pin,
        role=switch.role,
        joint=_joint_index(switch, arm, where),
        inverted=switch.active is PinLevel.LOW,
        pull=switch.pull,
    )


def _joint_index(switch: Input, arm: ArmDescription, where: str) -> int:
    if switch.role is InputRole.ESTOP:
        if switch.joint:
            raise DescriptionError(f'{where}: an e-stop belongs to all joints, not to "{switch.joint}": remove `joint`')
        return UNUSED
    if not switch.joint:
        raise DescriptionError(f"{where}: write the `joint` that this {switch.role} switch belongs to")
    if switch.joint not in arm.joint_names:
        raise DescriptionError(
            f'{where}: there is no joint "{switch.joint}"{suggestion(switch.joint, arm.joint_names)}'
        )
    return arm.joint_names.index(switch.joint)


def output_config(output: DigitalOutput) -> OutputConfig:
    """A digital output."""
    return OutputConfig(
        name=device_name(output.name, f'output "{output.name}"'),
        pin=output.pin,
        inverted=output.active is PinLevel.LOW,
        at_boot=output.at_boot,
        off_at_estop=output.off_at_estop,
    )


def sensor_config(sensor: Sensor) -> SensorConfig:
    """A reading, its scale in 1/1000 of its unit."""
    where = f'sensor "{sensor.name}"'
    return SensorConfig(
        name=device_name(sensor.name, where),
        kind=sensor.kind,
        pin=sensor.pin,
        trigger_pin=pin_or_unused(sensor.trigger_pin),
        scale_q16=int32(nearest(Fraction(sensor.scale) * 65_536_000), f"{where}: scale"),
        offset_milli=int32(nearest(Fraction(sensor.offset) * 1000), f"{where}: offset"),
    )
