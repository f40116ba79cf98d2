"""What `gemelo state` says, put together from the newest messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceState, DeviceStatus
from schemas.joints import JointState, StepErrors
from services.cli.columns import table
from services.cli.units import SHOWN

if TYPE_CHECKING:
    from services.arm.description import Arm


class JointLine(msgspec.Struct, frozen=True):
    """One joint as it is shown; SI in --json."""

    name: str
    unit: str
    position: float | None = None  # [rad] or [m]
    velocity: float | None = None  # [rad/s] or [m/s]
    commanded_steps: float | None = None
    executed_steps: int | None = None
    error_steps: float | None = None


class Snapshot(msgspec.Struct, frozen=True):
    """Everything that `gemelo state` says."""

    robot: str
    joints: tuple[JointLine, ...]
    tool_frame: str
    tool: tuple[float, ...] | None  # (3,) [m] in the base frame
    device: str
    mode: str
    online: bool
    reason: str
    time_scale: float | None
    buffered: float | None  # [s]
    round_trip_ms: float | None


def snapshot(
    arm: Arm,
    states: JointState | None,
    errors: StepErrors | None,
    device: DeviceState | None,
    status: DeviceStatus | None,
    tool: tuple[float, ...] | None,
) -> Snapshot:
    """One `Snapshot` of what has been heard so far; what has not is None."""
    states, errors = states or JointState(), errors or StepErrors()
    position = dict(zip(states.name, states.position, strict=False))
    velocity = dict(zip(states.name, states.velocity, strict=False))
    commanded = dict(zip(errors.name, errors.commanded, strict=False))
    executed = dict(zip(errors.name, errors.executed, strict=False))
    error = dict(zip(errors.name, errors.error, strict=False))
    lines = tuple(
        JointLine(
            joint.name, joint.unit, position.get(joint.name), velocity.get(joint.name),
            commanded.get(joint.name), executed.get(joint.name), error.get(joint.name),
        )
        for joint in arm.joints
    )  # fmt: skip
    return Snapshot(
        robot=arm.name,
        joints=lines,
        tool_frame=arm.tool_frame,
        tool=tool,
        device=status.device if status else "",
        mode=device.mode.name if device else "unknown",
        online=bool(status and status.online),
        reason=status.reason if status else "nothing heard from stepper_gateway",
        time_scale=device.time_scale if device else None,
        buffered=device.buffered if device else None,
        round_trip_ms=device.round_trip * 1e3 if device else None,
    )


def text_of(view: Snapshot) -> str:
    """The snapshot as a table and three lines."""
    headings = ("joint", "position", "unit", "velocity [unit/s]", "commanded [steps]", "executed [steps]",
                "error [steps]")  # fmt: skip
    rows = [_row(line) for line in view.joints]
    tool = (
        "unknown" if view.tool is None else "x {:z.2f}  y {:z.2f}  z {:z.2f} mm".format(*(v * 1e3 for v in view.tool))
    )
    link = "online" if view.online else f"offline: {view.reason}"
    if view.online and view.round_trip_ms is not None:
        link += f", round trip {view.round_trip_ms:.1f} ms"
    device = f"{view.device or 'unknown'}: {view.mode}"
    if view.time_scale is not None and view.buffered is not None:
        device += f", time scale {view.time_scale:.2f}, {view.buffered:.2f} s of path buffered"
    if view.online and view.reason:
        device += f"; {view.reason}"
    return f"{table(headings, rows)}\n\ntool {view.tool_frame}: {tool}\ndevice {device}\nlink   {link}"


def _row(line: JointLine) -> tuple[str, ...]:
    shown, factor = SHOWN[line.unit]
    return (
        line.name, _number(line.position, factor, 3), shown, _number(line.velocity, factor, 3),
        _number(line.commanded_steps, 1.0, 2), _number(line.executed_steps, 1.0, 0), _number(line.error_steps, 1.0, 2),
    )  # fmt: skip


def _number(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{value * factor:z.{digits}f}"
