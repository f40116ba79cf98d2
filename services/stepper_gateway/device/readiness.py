"""The reasons for which a device that can be reached cannot start a motion, each with its remedy."""

from __future__ import annotations

import re
from functools import lru_cache

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import InputRole
from gemelo.schemas.device_faults import fault_reason
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.stepper_gateway.links.frames import StateFlag, StateFrame

LEAST_FIRMWARE = (1, 0, 0)  # that is driven; chosen: the first; raise it with a frame that an older one does not have

_VERSION = re.compile(r"(\d+)\.(\d+)\.(\d+)")


@lru_cache(maxsize=4)  # it is looked at with every input
def _version(firmware: str) -> tuple[int, ...] | None:
    """Of a firmware's text; None for a board that has no version."""
    found = _VERSION.match(firmware)
    return tuple(map(int, found.groups())) if found is not None else None


def outdated_reason(name: str, firmware: str) -> Reason | None:
    """That device `name` has a version below LEAST_FIRMWARE; None also for a board that has no version."""
    version = _version(firmware)
    if version is None or version >= LEAST_FIRMWARE:
        return None
    least = ".".join(map(str, LEAST_FIRMWARE))
    return because("device.firmware.old", device=name, firmware=firmware, least=least)


def not_ready_reason(arm: ArmDescription, state: StateFrame | None) -> Reason | None:
    """None where a motion may start."""
    name = arm.device.name
    if state is None:
        return because("device.joints_unknown", device=name)
    match state.mode:
        case DeviceMode.IDLE | DeviceMode.RUN:
            return None
        case DeviceMode.UNREFERENCED:
            return _unreferenced(arm, state)
        case DeviceMode.HOMING:
            return because("device.homing", device=name)
        case DeviceMode.HOLD:
            return because("device.held", device=name)
        case DeviceMode.FAULT:
            return _fault(arm, state)
        case DeviceMode.ESTOP:
            return _estop(arm, state)
        case mode:
            return because("device.other_mode", device=name, mode=DeviceMode(mode).name)


def joint_name(arm: ArmDescription, index: int) -> str:
    """The joint's name; empty for the number that means none."""
    return arm.joint_names[index] if index < len(arm.joints) else ""


def input_names(arm: ArmDescription, state: StateFrame) -> tuple[str, ...]:
    """The switches that are active."""
    return tuple(switch.name for index, switch in enumerate(arm.inputs) if state.inputs >> index & 1)


def _unreferenced(arm: ArmDescription, state: StateFrame) -> Reason:
    lost = [joint for index, joint in enumerate(arm.joints) if not state.referenced >> index & 1]
    homes = bool(lost) and all(joint.drive.homing is not None for joint in lost)
    mend = remedy("home_or_reference" if homes else "reference_by_hand")
    if not state.flags & StateFlag.ARMED:
        return because("device.disarmed", mend, device=arm.device.name)
    if not lost:
        return because("device.unreferenced.all", mend, device=arm.device.name)
    return because("device.unreferenced", mend, device=arm.device.name, joints=tuple(joint.name for joint in lost))


def _fault(arm: ArmDescription, state: StateFrame) -> Reason:
    fault = fault_reason(state.fault, joint_name(arm, state.fault_joint))
    if fault is None:
        return because("device.fault.unknown", device=arm.device.name)
    return because("device.fault", fault, device=arm.device.name)


def _estop(arm: ArmDescription, state: StateFrame) -> Reason:
    stops = [switch.name for switch in arm.inputs if switch.role is InputRole.ESTOP]
    pressed = [name for name in input_names(arm, state) if name in stops]
    if pressed:
        return because("device.estop.pressed", remedy("release_and_reset"), device=arm.device.name, input=pressed[0])
    return because("device.estop.was_pressed", remedy("reset_and_reference"), device=arm.device.name)
