"""The device's state and every joint's steps as a text that is read at a glance."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gemelo.schemas.control import ControlState
from gemelo.schemas.device import DeviceMode, DeviceState, DeviceStatus, SensorReadings, ShaftPositions
from gemelo.schemas.device_faults import explain
from gemelo.schemas.device_link import offline_word, reason_text, state_round_trip_text
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance

STALE = 1_000_000_000  # [ns] after which a state is no longer called present
LOST = 1  # [steps] between counter and shaft that a motor under load may be off


@dataclass(frozen=True)
class PanelInputs:
    """The newest of everything that the panel shows."""

    robot: str = ""
    status: DeviceStatus | None = None
    state: DeviceState | None = None
    errors: StepErrors | None = None
    joints: JointState | None = None
    sensors: SensorReadings | None = None
    shaft: ShaftPositions | None = None
    ledger: StepLedger | None = None
    stopping: StoppingDistance | None = None
    control: ControlState | None = None
    prismatic: frozenset[str] = frozenset()


def panel(inputs: PanelInputs, now: int) -> str:
    """Markdown; `now` in ns UNIX."""
    parts = (
        _heading(inputs, now),
        _control(inputs),
        _open_loop(inputs),
        _lost(inputs),
        _device(inputs, now),
        _table(inputs),
        _ledger(inputs),
        _stopping(inputs),
        _numbers(inputs),
    )
    return "\n\n".join(part for part in parts if part) + "\n"


def shaft_errors(shaft: ShaftPositions | None) -> dict[str, int]:
    """[steps] that each true shaft is ahead of its counter, by joint."""
    if shaft is None:
        return {}
    return {name: true - counted for name, counted, true in zip(shaft.name, shaft.steps, shaft.shaft, strict=False)}


def is_lost(error: int) -> bool:
    """True if a shaft is farther from its counter [steps] than a motor that holds its load may be."""
    return abs(error) > LOST


def _heading(inputs: PanelInputs, now: int) -> str:
    state, status = inputs.state, inputs.status
    if status is not None and not status.online:
        why = reason_text(status, now) if status.reason else "the device is not connected"
        return f"## {inputs.robot} · {offline_word(status.speaks).upper()}\n\n{why}"
    if state is None:
        return f"## {inputs.robot} · waiting for the device"
    age = now - state.stamp
    if age > STALE:
        return f"## {inputs.robot} · SILENT for {age / 1e9:.0f} s\n\nlast mode {state.mode.name}"
    warning = f"\n\n**{status.warning}**" if status is not None and status.warning else ""
    return (_fault(inputs.robot, state) or f"## {inputs.robot} · {state.mode.name}") + warning


def _fault(robot: str, state: DeviceState) -> str:
    """In capitals, with joint and remedy; empty while all is well."""
    about = explain(state.fault)
    if about is None and state.mode not in (DeviceMode.FAULT, DeviceMode.ESTOP):
        return ""
    if about is None:
        return f"# {robot} · {state.mode.name}"
    where = f" AT {state.fault_joint.upper()}" if state.fault_joint else ""
    return f"# {robot} · {about.name}{where}\n\n**{about.meaning}**\n\n{about.remedy}"


def _open_loop(inputs: PanelInputs) -> str:
    """That the arm drawn is what was sent; empty where it is measured."""
    if inputs.status is None or not inputs.status.open_loop:
        return ""
    return "**SENT, NOT VERIFIED: this board does not say what it has executed**"


def _lost(inputs: PanelInputs) -> str:
    """The shafts that are not where their counters say."""
    off = {name: error for name, error in shaft_errors(inputs.shaft).items() if is_lost(error)}
    if not off:
        return ""
    said = ", ".join(f"{name} {error:+d}" for name, error in off.items())
    return f"**STEPS LOST: true shaft minus counter {said}** · `gemelo home {' '.join(off)}`"


def _device(inputs: PanelInputs, now: int) -> str:
    """Drivers, references, switches, outputs, sensors, in one line."""
    state = inputs.state
    if state is None or (inputs.status is not None and not inputs.status.online):
        return ""
    known = dict(zip(state.name, state.referenced, strict=False))
    parts = ["armed" if state.armed else "**DISARMED**"]
    parts += [_references(known)] if known else []
    parts += [f"**speed {state.speed:.0%}**"] if state.speed != 1.0 else []
    parts += [f"**pressed: {', '.join(state.inputs)}**"] if state.inputs else []
    parts += [f"on: {', '.join(state.outputs)}"] if state.outputs else []
    return " · ".join([*parts, *_sensors(inputs.sensors, now)])


def _references(known: dict[str, bool]) -> str:
    missing = [name for name, is_known in known.items() if not is_known]
    if not missing:
        return "all joints referenced"
    return f"**UNREFERENCED{'' if len(missing) == len(known) else ' ' + ', '.join(missing)}**"


def _sensors(sensors: SensorReadings | None, now: int) -> list[str]:
    if sensors is None or now - sensors.stamp > STALE:
        return []
    rows = zip(sensors.name, sensors.value, sensors.unit, strict=False)
    return [f"{name} {value:.3g} {unit}".rstrip() for name, value, unit in rows]


def _table(inputs: PanelInputs) -> str:
    errors = inputs.errors
    if errors is None:
        return ""
    positions = dict(zip(inputs.joints.name, inputs.joints.position, strict=False)) if inputs.joints else {}
    rows = [
        f"| {name} | {_position(inputs, name, positions.get(name))} | {commanded:z.2f} | {executed} |"
        f" **{error:+z.2f}** | {worst:.2f} |"
        for name, commanded, executed, error, worst in zip(
            errors.name, errors.commanded, errors.executed, errors.error, errors.max_error, strict=False
        )
    ]
    head = "| joint | position | steps commanded | executed | error | worst |\n|---|---|---|---|---|---|"
    return "\n".join([head, *rows])


def _ledger(inputs: PanelInputs) -> str:
    """How sure it is that no step is lost, and what that is at the tool."""
    ledger = inputs.ledger
    if ledger is None or ledger.open_loop:
        return ""
    if not any(ledger.confidence):
        return f"**tool error not known**: {ledger.reason}"
    sure = ", ".join(f"{name} {_percent(c)}" for name, c in zip(ledger.name, ledger.confidence, strict=False))
    return (
        f"tool error {1e3 * ledger.tool_error:.2f} mm, at most {1e3 * ledger.tool_bound:.2f} mm ({ledger.level:.0%}) · "
        f"**{_percent(ledger.arm_confidence)} sure** that no step is lost: {sure}"
    )


def _control(inputs: PanelInputs) -> str:
    """Who alone may move the arm."""
    control = inputs.control
    if control is None or not control.held:
        return ""
    name = control.name.replace("`", "'")
    return f"control: `{name}` (node `{control.node}` on `{control.host}`): nobody else moves the arm"


def _stopping(inputs: PanelInputs) -> str:
    """How far it goes if all is lost now."""
    stopping = inputs.stopping
    if stopping is None or not stopping.is_known:
        return ""
    return f"stops within {1e3 * stopping.distance:.0f} mm and {stopping.duration:.2f} s if all is lost now"


def _percent(share: float) -> str:
    """Rounded down."""
    return f"{int(share * 1000.0) / 10.0:g} %"


def _position(inputs: PanelInputs, name: str, value: float | None) -> str:
    if value is None:
        return "?"
    return f"{value * 1e3:z.2f} mm" if name in inputs.prismatic else f"{math.degrees(value):z.2f}°"


def _numbers(inputs: PanelInputs) -> str:
    state = inputs.state
    if state is None:
        return ""
    boot = f"firmware {inputs.status.firmware} · " if inputs.status is not None and inputs.status.firmware else ""
    return (
        f"path {state.time_scale:.0%} of its speed · {state.buffered * 1e3:.0f} ms queued · "
        f"{state_round_trip_text(state)}\n\n"
        f"{boot}under-runs {state.underruns} · refused {state.refused} · bad frames {state.bad_frames}"
    )
