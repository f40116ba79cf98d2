"""The reasons for which a device that can be reached cannot start a motion, each with its remedy."""

from __future__ import annotations

import re
from functools import lru_cache

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import InputRole
from gemelo.schemas.device_faults import fault_text
from gemelo.services.stepper_gateway.links.frames import StateFlag, StateFrame

LEAST_FIRMWARE = (1, 0, 0)  # that is driven; chosen: the first; raise it with a frame that an older one does not have

_VERSION = re.compile(r"(\d+)\.(\d+)\.(\d+)")


@lru_cache(maxsize=4)  # it is looked at with every input
def _version(firmware: str) -> tuple[int, ...] | None:
    """Of a firmware's text; None for a board that has no version."""
    found = _VERSION.match(firmware)
    return tuple(map(int, found.groups())) if found is not None else None


def outdated_reason(name: str, firmware: str) -> str:
    """A sentence where device `name` says a version below LEAST_FIRMWARE; empty for a board that has no version."""
    version = _version(firmware)
    if version is None or version >= LEAST_FIRMWARE:
        return ""
    least = ".".join(map(str, LEAST_FIRMWARE))
    return (
        f'device "{name}" runs firmware {firmware}, and this gateway drives {least} and newer: `gemelo device update` '
        "brings it a newer one, or flash it over its cable (firmware/README.md)"
    )


def not_ready_reason(arm: ArmDescription, state: StateFrame | None) -> str:
    """A sentence, empty where a motion may start."""
    name = arm.device.name
    if state is None:
        return f'device "{name}" has not said yet where its joints stand: wait a second'
    match state.mode:
        case DeviceMode.IDLE | DeviceMode.RUN:
            return ""
        case DeviceMode.UNREFERENCED:
            return _unreferenced(arm, state)
        case DeviceMode.HOMING:
            return f'device "{name}" looks for its home switches: wait until it has found them, or run `gemelo stop`'
        case DeviceMode.HOLD:
            return f'device "{name}" holds: run `gemelo resume` or `gemelo stop` first'
        case DeviceMode.FAULT:
            return f'device "{name}" has a fault: {fault_text(state.fault, joint_name(arm, state.fault_joint))}'
        case DeviceMode.ESTOP:
            return _estop(arm, state)
        case mode:
            return f'device "{name}" is in mode {DeviceMode(mode).name}: wait until it is IDLE'


def joint_name(arm: ArmDescription, index: int) -> str:
    """The joint's name; empty for the number that means none."""
    return arm.joint_names[index] if index < len(arm.joints) else ""


def input_names(arm: ArmDescription, state: StateFrame) -> tuple[str, ...]:
    """The switches that are active."""
    return tuple(switch.name for index, switch in enumerate(arm.inputs) if state.inputs >> index & 1)


def _unreferenced(arm: ArmDescription, state: StateFrame) -> str:
    lost = [joint for index, joint in enumerate(arm.joints) if not state.referenced >> index & 1]
    names = ", ".join(joint.name for joint in lost) or "its joints"
    by_hand = "put the arm into its reference pose and run `gemelo reference`"
    homes = bool(lost) and all(joint.drive.homing is not None for joint in lost)
    remedy = f"run `gemelo home`, or {by_hand}" if homes else by_hand
    if not state.flags & StateFlag.ARMED:
        return f'device "{arm.device.name}" is disarmed: run `gemelo device arm`; then {remedy}'
    return f'device "{arm.device.name}" does not know where {names} stands: {remedy}'


def _estop(arm: ArmDescription, state: StateFrame) -> str:
    stops = [switch.name for switch in arm.inputs if switch.role is InputRole.ESTOP]
    pressed = [name for name in input_names(arm, state) if name in stops]
    again = "run `gemelo reset`, `gemelo device arm`, then `gemelo home` or `gemelo reference`"
    if pressed:
        return f'the emergency stop "{pressed[0]}" of device "{arm.device.name}" is pressed: release it, {again}'
    return f'the emergency stop of device "{arm.device.name}" was pressed: {again}'
