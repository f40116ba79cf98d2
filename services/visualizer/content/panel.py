"""The device's state and every joint's steps as a text that is read at a glance."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gemelo.schemas.control import ControlState
from gemelo.schemas.device import (
    DeviceFault,
    DeviceMode,
    DeviceState,
    DeviceStatus,
    SensorReadings,
    ShaftPositions,
)
from gemelo.schemas.device_faults import fault_name, meaning_and_remedy
from gemelo.schemas.device_link import state_round_trip, warning_of, why_not_usable
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.reasons import Reason, because, plain, say
from gemelo.schemas.reasons.catalogue import ENGLISH

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
    language: str = ENGLISH

    def say(self, reason: Reason) -> str:
        """Its sentence in the language of the view."""
        return say(reason, self.language)


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
        what = because("view.not_usable") if status.speaks else because("view.offline")
        return f"## {inputs.robot} · {inputs.say(what)}\n\n{inputs.say(why_not_usable(status, now))}"
    if state is None:
        return f"## {inputs.robot} · {inputs.say(because('view.waiting'))}"
    if (age := now - state.stamp) > STALE:
        silent, last = because("view.silent", time=age / 1e9), because("view.last_mode", mode=state.mode.name)
        return f"## {inputs.robot} · {inputs.say(silent)}\n\n{inputs.say(last)}"
    warning = warning_of(status) if status is not None else None
    bold = f"\n\n**{inputs.say(warning)}**" if warning is not None else ""
    return (_fault(inputs, state) or f"## {inputs.robot} · {_mode(inputs, state)}") + bold


def _mode(inputs: PanelInputs, state: DeviceState) -> str:
    return inputs.say(because("status.mode", mode=state.mode.name)).upper()


def _fault(inputs: PanelInputs, state: DeviceState) -> str:
    """In capitals, with joint and remedy; empty while all is well."""
    if state.fault == DeviceFault.NONE:
        is_stopped = state.mode in (DeviceMode.FAULT, DeviceMode.ESTOP)
        return f"# {inputs.robot} · {_mode(inputs, state)}" if is_stopped else ""
    name = fault_name(state.fault)
    what = because("view.fault", fault=name)
    if state.fault_joint:
        what = because("view.fault.at_joint", fault=name, joint=state.fault_joint)
    meaning, mend = map(inputs.say, meaning_and_remedy(state.fault))
    return f"# {inputs.robot} · {inputs.say(what).upper()}\n\n**{meaning}**\n\n{mend}"


def _open_loop(inputs: PanelInputs) -> str:
    """That the arm drawn is what was sent; empty where it is measured."""
    if inputs.status is None or not inputs.status.open_loop:
        return ""
    return f"**{inputs.say(because('view.open_loop'))}**"


def _lost(inputs: PanelInputs) -> str:
    """The shafts that are not where their counters say."""
    off = {name: error for name, error in shaft_errors(inputs.shaft).items() if is_lost(error)}
    if not off:
        return ""
    errors = ", ".join(f"{name} {error:+d}" for name, error in off.items())
    return f"**{inputs.say(because('view.lost', joints=errors))}** · `gemelo home {' '.join(off)}`"


def _device(inputs: PanelInputs, now: int) -> str:
    """Drivers, references, switches, outputs, sensors, in one line."""
    state = inputs.state
    if state is None or (inputs.status is not None and not inputs.status.online):
        return ""
    known = dict(zip(state.name, state.referenced, strict=False))
    parts = [(because("view.armed"), "") if state.armed else (because("view.disarmed"), "**")]
    parts += [_references(known)] if known else []
    parts += [(because("view.speed", speed=state.speed), "**")] if state.speed != 1.0 else []
    parts += [(because("view.pressed", names=", ".join(state.inputs)), "**")] if state.inputs else []
    parts += [(because("view.on", names=", ".join(state.outputs)), "")] if state.outputs else []
    return " · ".join([*(f"{mark}{inputs.say(part)}{mark}" for part, mark in parts), *_sensors(inputs.sensors, now)])


def _references(known: dict[str, bool]) -> tuple[Reason, str]:
    """With the Markdown around it."""
    missing = [name for name, is_known in known.items() if not is_known]
    if not missing:
        return because("view.referenced"), ""
    if len(missing) == len(known):
        return because("view.unreferenced"), "**"
    return because("view.unreferenced.some", joints=", ".join(missing)), "**"


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
    head = f"{inputs.say(because('view.table'))}\n|---|---|---|---|---|---|"
    return "\n".join([head, *rows])


def _ledger(inputs: PanelInputs) -> str:
    """How sure it is that no step is lost, and what that is at the tool."""
    ledger = inputs.ledger
    if ledger is None or ledger.open_loop:
        return ""
    if not any(ledger.confidence):
        return f"**{inputs.say(because('view.tool.unknown'))}**: {inputs.say(ledger.why or plain(ledger.reason))}"
    joints = ", ".join(f"{name} {_percent(c)}" for name, c in zip(ledger.name, ledger.confidence, strict=False))
    error, bound = 1e3 * ledger.tool_error, 1e3 * ledger.tool_bound
    sure = _percent(ledger.arm_confidence)
    return inputs.say(because("view.tool", error=error, bound=bound, level=ledger.level, sure=sure, joints=joints))


def _control(inputs: PanelInputs) -> str:
    """Who alone may move the arm."""
    control = inputs.control
    if control is None or not control.held:
        return ""
    name = control.name.replace("`", "'")
    return inputs.say(because("view.control", name=name, node=control.node, host=control.host))


def _stopping(inputs: PanelInputs) -> str:
    """How far it goes if all is lost now."""
    stopping = inputs.stopping
    if stopping is None or not stopping.is_known:
        return ""
    return inputs.say(because("view.stops", distance=1e3 * stopping.distance, duration=stopping.duration))


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
    status, trip = inputs.status, state_round_trip(state)
    firmware = because("view.firmware", version=status.firmware) if status is not None and status.firmware else None
    path = because("view.path", trip, scale=state.time_scale, queued=state.buffered * 1e3)
    counts = because("view.counts", underruns=state.underruns, refused=state.refused, bad_frames=state.bad_frames)
    boot = f"{inputs.say(firmware)} · " if firmware is not None else ""
    return f"{inputs.say(path)}\n\n{boot}{inputs.say(counts)}"
