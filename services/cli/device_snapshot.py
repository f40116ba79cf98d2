"""What is known of the device, put together from the newest messages. Pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceConfiguration, DeviceState, DeviceStatus, SensorReadings
from schemas.device_faults import Explanation, explain
from services.cli.device_names import joint_name

if TYPE_CHECKING:
    from services.arm.description import Arm


class DeviceJoint(msgspec.Struct, frozen=True, kw_only=True):
    """One joint as the device knows it."""

    name: str
    referenced: bool | None = None
    steps: int | None = None
    velocity: float | None = None  # [steps/s]
    switches: dict[str, bool] = {}  # by name, whether it is active


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """One sensor."""

    name: str
    value: float | None = None
    unit: str = ""


class DeviceSnapshot(msgspec.Struct, frozen=True, kw_only=True):
    """The device at one glance; also what `--json` prints."""

    status: DeviceStatus
    state: DeviceState | None
    configured: bool
    configuration: str  # why it is not in force, or which is
    fault: str = ""
    fault_joint: str = ""
    meaning: str = ""
    remedy: str = ""
    joints: tuple[DeviceJoint, ...] = ()
    inputs: dict[str, bool] = {}  # of the e-stop and other inputs without a joint
    outputs: dict[str, bool] = {}
    sensors: tuple[Reading, ...] = ()


def device_snapshot(
    arm: Arm,
    status: DeviceStatus | None,
    state: DeviceState | None,
    configuration: DeviceConfiguration | None,
    sensors: SensorReadings | None,
) -> DeviceSnapshot:
    """What has been heard so far; what has not is None."""
    status = status or DeviceStatus(reason="nobody has said who the device is")
    about = explain(state.fault) if state is not None else None
    about = about or Explanation("", "", "")
    active = frozenset(state.inputs) if state is not None else frozenset[str]()
    on = frozenset(state.outputs) if state is not None else frozenset[str]()
    configured, said = _configured(status, configuration)
    return DeviceSnapshot(
        status=status,
        state=state,
        configured=configured,
        configuration=said,
        fault=about.name,
        fault_joint=joint_name(arm, state.fault_joint) if state is not None else "",
        meaning=about.meaning,
        remedy=about.remedy,
        joints=tuple(_joint(arm, name, state, active) for name in arm.joint_names),
        inputs={each.name: each.name in active for each in arm.inputs if not each.joint},
        outputs={each.name: each.name in on for each in arm.outputs},
        sensors=readings(arm, sensors),
    )


def readings(arm: Arm, sensors: SensorReadings | None) -> tuple[Reading, ...]:
    """Every sensor of robot.toml, with its reading where there is one."""
    sensors = sensors or SensorReadings()
    values = dict(zip(sensors.name, sensors.value, strict=False))
    return tuple(Reading(name=each.name, value=values.get(each.name), unit=each.unit) for each in arm.sensors)


def _configured(status: DeviceStatus, configuration: DeviceConfiguration | None) -> tuple[bool, str]:
    wanted = configuration.crc32 if configuration is not None else status.wanted_crc32
    if configuration is not None and configuration.accepted:
        return True, f"in force (crc32 {wanted:08x})"
    if status.config_crc32 and status.config_crc32 == wanted:
        return True, f"in force (crc32 {wanted:08x})"
    reason = configuration.reason if configuration is not None else ""
    has = f"the device has {status.config_crc32:08x}" if status.config_crc32 else "the device has none"
    return False, f"NOT in force: {reason or f'{has}, robot.toml asks for {wanted:08x}; `gemelo device config --push`'}"


def _joint(arm: Arm, name: str, state: DeviceState | None, active: frozenset[str]) -> DeviceJoint:
    switches = {each.name: each.name in active for each in arm.inputs if each.joint == name}
    if state is None or name not in state.name:
        return DeviceJoint(name=name, switches=switches)
    index = state.name.index(name)
    return DeviceJoint(
        name=name,
        referenced=state.referenced[index] if index < len(state.referenced) else None,
        steps=state.steps[index] if index < len(state.steps) else None,
        velocity=state.velocity[index] if index < len(state.velocity) else None,
        switches=switches,
    )
