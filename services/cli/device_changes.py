"""What is new between two states of the device, a line each. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from schemas.device import DeviceConfiguration, DeviceEvent, DeviceState, DeviceStatus
from schemas.device_faults import fault_text
from services.cli.device_names import joint_name

if TYPE_CHECKING:
    from services.arm.description import Arm


def status_changes(before: DeviceStatus | None, after: DeviceStatus) -> list[str]:
    """Who the device is, and whether it can be reached."""
    if before is None or (before.online, before.boot_id, before.reason) != (after.online, after.boot_id, after.reason):
        reason = f": {after.reason}" if after.reason else ""
        boot = f", boot {after.boot_id:08x} ({after.reset_cause})" if after.online else ""
        return [f"{after.device or 'the device'} is {'online' if after.online else 'OFFLINE'}{boot}{reason}"]
    return []


def configuration_changes(before: DeviceConfiguration | None, after: DeviceConfiguration) -> list[str]:
    """Whether the device works with what robot.toml asks for."""
    known = None if before is None else (before.crc32, before.accepted, before.reason)
    if known == (after.crc32, after.accepted, after.reason):
        return []
    said = "in force" if after.accepted else f"NOT in force: {after.reason or 'the device has another'}"
    return [f"configuration {after.crc32:08x} {said}"]


def state_changes(arm: Arm, before: DeviceState | None, after: DeviceState) -> list[str]:
    """Everything of a state that a person would want to hear of; steps and times are not."""
    old = before or DeviceState()
    lines = [] if before is not None and old.mode is after.mode else [f"mode {after.mode.name}"]
    if after.fault and (old.fault, old.fault_joint) != (after.fault, after.fault_joint):
        lines.append(f"fault {fault_text(after.fault, joint_name(arm, after.fault_joint))}")
    if before is None or old.armed != after.armed:
        lines.append("drivers armed" if after.armed else "drivers disarmed")
    lines += _referenced(old, after)
    lines += _named("input", old.inputs, after.inputs, "PRESSED", "released")
    lines += _named("output", old.outputs, after.outputs, "on", "off")
    lines += [f"speed {after.speed:.0%}"] if old.speed != after.speed else []
    counters = ("underruns", "refused", "bad_frames")
    lines += [
        f"{name.replace('_', ' ')} {getattr(after, name)}"
        for name in counters
        if before is not None and getattr(old, name) != getattr(after, name)
    ]
    return lines


def event_text(event: DeviceEvent) -> str:
    """What the device reports once."""
    return f"event {event.event}" + (f": {event.detail}" if event.detail else "")


def _referenced(before: DeviceState, after: DeviceState) -> list[str]:
    old = dict(zip(before.name, before.referenced, strict=False))
    new = dict(zip(after.name, after.referenced, strict=False))
    return [
        f"{name} is {'referenced' if known else 'UNREFERENCED'}"
        for name, known in new.items()
        if old.get(name) != known
    ]


def _named(kind: str, before: Sequence[str], after: Sequence[str], yes: str, no: str) -> list[str]:
    return [
        *(f"{kind} {name} {yes}" for name in after if name not in before),
        *(f"{kind} {name} {no}" for name in before if name not in after),
    ]
