"""What `gemelo device status` says, put together from the newest messages. Pure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceConfiguration, DeviceMode, DeviceState, DeviceStatus, SensorReadings
from schemas.device_faults import Explanation, explain
from services.cli.columns import table
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


def text_of(view: DeviceSnapshot) -> str:
    """One screen."""
    lines = [f"device   {_who(view.status)}", f"config   {view.configuration}"]
    if view.state is None:
        return "\n".join(lines)
    lines += [f"mode     {_mode(view, view.state)}", *_fault(view), f"drivers  {_drivers(view.state)}"]
    lines += [f"speed    {view.state.speed:.0%} asked for, the path runs at {view.state.time_scale:.0%}"]
    lines += _named("inputs", view.inputs, "PRESSED", "released") + _named("outputs", view.outputs, "on", "off")
    lines += [f"sensors  {', '.join(map(reading_text, view.sensors))}"] if view.sensors else []
    return "\n".join([*lines, f"link     {_link(view.state)}", "", _joints(view)])


def reading_text(reading: Reading) -> str:
    """`ultra 12.5 cm`."""
    value = "-" if reading.value is None else f"{reading.value:.6g}"
    return f"{reading.name} {value} {reading.unit}".rstrip()


def _who(status: DeviceStatus) -> str:
    name = status.device or "unknown"
    if not status.online:
        return f"{name}: OFFLINE: {status.reason or 'no reason is known'}"
    kind = "virtual, " if status.virtual else ""
    reason = f"; {status.reason}" if status.reason else ""
    return (
        f"{name}: online, {kind}firmware {status.firmware}, boot {status.boot_id:08x} ({status.reset_cause}), "
        f"{status.joints} joints, tick {status.tick_hz / 1000:g} kHz{reason}"
    )


def _mode(view: DeviceSnapshot, state: DeviceState) -> str:
    hints = {
        DeviceMode.BOOT: "it has no configuration yet: `gemelo device config --push`",
        DeviceMode.UNREFERENCED: "it does not know where its joints are: `gemelo home` or `gemelo reference`",
        DeviceMode.HOLD: "it stands on its path: `gemelo resume` or `gemelo stop`",
    }
    hint = hints.get(state.mode, "")
    return f"{state.mode.name}: {hint}" if hint else state.mode.name


def _fault(view: DeviceSnapshot) -> list[str]:
    if not view.fault:
        return []
    where = f' at joint "{view.fault_joint}"' if view.fault_joint else ""
    return [f"fault    {view.fault}{where}: {view.meaning}", f"remedy   {view.remedy}"]


def _drivers(state: DeviceState) -> str:
    return "armed: the motors hold" if state.armed else "disarmed: the motors are without current, `gemelo device arm`"


def _named(heading: str, parts: dict[str, bool], yes: str, no: str) -> list[str]:
    said = ", ".join(f"{name} {yes if is_on else no}" for name, is_on in parts.items())
    return [f"{heading:<8} {said}"] if said else []


def _link(state: DeviceState) -> str:
    return (
        f"round trip {state.round_trip * 1e3:.1f} ms, {state.buffered:.2f} s of path queued; since boot "
        f"{state.underruns} under-runs, {state.refused} refused, {state.bad_frames} bad frames"
    )


def _joints(view: DeviceSnapshot) -> str:
    return table(("joint", "referenced", "steps", "velocity [steps/s]", "switches"), [_row(j) for j in view.joints])


def _row(joint: DeviceJoint) -> tuple[str, ...]:
    words = {None: "-", True: "yes", False: "NO"}
    switches = ", ".join(f"{name} {'PRESSED' if on else 'released'}" for name, on in joint.switches.items())
    return (
        joint.name,
        words[joint.referenced],
        "-" if joint.steps is None else str(joint.steps),
        "-" if joint.velocity is None else f"{joint.velocity:.1f}",
        switches or "none",
    )
