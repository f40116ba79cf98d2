"""The device's state and every joint's steps as a text that is read at a glance."""

from __future__ import annotations

import math
from dataclasses import dataclass

from schemas.device import DeviceMode, DeviceState, DeviceStatus
from schemas.joints import JointState, StepErrors

STALE = 1_000_000_000  # [ns] after which a state is no longer called present


@dataclass(frozen=True)
class Facts:
    """The newest of everything that the panel shows."""

    robot: str = ""
    status: DeviceStatus | None = None
    state: DeviceState | None = None
    errors: StepErrors | None = None
    joints: JointState | None = None
    prismatic: frozenset[str] = frozenset()


def panel(facts: Facts, now: int) -> str:
    """Markdown; `now` in ns UNIX."""
    return "\n\n".join(part for part in (_heading(facts, now), _table(facts), _numbers(facts)) if part) + "\n"


def _heading(facts: Facts, now: int) -> str:
    state, status = facts.state, facts.status
    if status is not None and not status.online:
        return f"## {facts.robot} · OFFLINE\n\n{status.reason or 'the device is not connected'}"
    if state is None:
        return f"## {facts.robot} · waiting for the device"
    age = now - state.stamp
    if age > STALE:
        return f"## {facts.robot} · SILENT for {age / 1e9:.0f} s\n\nlast mode {mode_name(state)}"
    return f"## {facts.robot} · {mode_name(state)}"


def mode_name(state: DeviceState) -> str:
    """The mode, and the fault where there is one."""
    fault = f" (fault {state.fault})" if state.mode is DeviceMode.FAULT else ""
    return state.mode.name + fault


def _table(facts: Facts) -> str:
    errors = facts.errors
    if errors is None:
        return ""
    positions = dict(zip(facts.joints.name, facts.joints.position, strict=False)) if facts.joints else {}
    rows = [
        f"| {name} | {_position(facts, name, positions.get(name))} | {commanded:.2f} | {executed} | **{error:+.2f}** |"
        f" {worst:.2f} |"
        for name, commanded, executed, error, worst in zip(
            errors.name, errors.commanded, errors.executed, errors.error, errors.max_error, strict=False
        )
    ]
    head = "| joint | position | commanded | executed | error | worst |\n|---|---|---|---|---|---|"
    return "\n".join([head, *rows]) + "\n\ncommanded, executed, error and worst error of this motion in motor steps"


def _position(facts: Facts, name: str, value: float | None) -> str:
    if value is None:
        return "?"
    return f"{value * 1e3:.2f} mm" if name in facts.prismatic else f"{math.degrees(value):.2f}°"


def _numbers(facts: Facts) -> str:
    state = facts.state
    if state is None:
        return ""
    boot = f"firmware {facts.status.firmware} · " if facts.status is not None and facts.status.firmware else ""
    return (
        f"path {state.time_scale:.0%} of its speed · {state.buffered * 1e3:.0f} ms queued · "
        f"round trip {state.round_trip * 1e3:.1f} ms\n\n"
        f"{boot}under-runs {state.underruns} · refused {state.refused} · bad frames {state.bad_frames}"
    )
