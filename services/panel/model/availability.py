"""The actions that are available now, and for each other one the reason: a key of the words, and the value in it."""

from __future__ import annotations

from collections.abc import Callable

import gemelo
from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.services.panel.model.readings import Readings

Reason = tuple[str, str] | None  # key of the words, value; None: it can be done

MOVING = (DeviceMode.RUN, DeviceMode.HOLD, DeviceMode.HOMING)
OF_THE_HOLDER = ("move", "jog", "arm", "home", "reference", "reset", "resume", "output", "grip")
FAULTY = (DeviceMode.FAULT, DeviceMode.ESTOP)


def reasons(arm: gemelo.Arm, readings: Readings) -> dict[str, Reason]:
    """By action: move, jog, arm, disarm, home, reference, reset, hold, resume, output, grip, inject."""
    state = readings.state
    if state is None:
        gone: Reason = ("device_silent", "")
        return dict.fromkeys((*CHECKS, "home", "inject"), gone)
    found = {name: check(state) for name, check in CHECKS.items()}
    found["home"] = _home(arm, state)
    if (other := other_holder(arm, readings)) is not None:
        found |= dict.fromkeys(OF_THE_HOLDER, ("other_in_control", other))
    found["inject"] = None if readings.status is not None and readings.status.virtual else ("not_virtual", "")
    return found


def other_holder(arm: gemelo.Arm, readings: Readings) -> str | None:
    """The name of who holds control of the arm, if that is neither nobody nor this page."""
    control = readings.control
    if control is None or not control.held or arm.node.address in control.members:
        return None
    return control.name


def _move(state: DeviceState) -> Reason:
    if state.mode in FAULTY:
        return "in_fault", state.mode.name
    if not state.armed:
        return "drivers_off", ""
    if not all(state.referenced):
        missing = [name for name, known in zip(state.name, state.referenced, strict=False) if not known]
        return "unreferenced", ", ".join(missing)
    return ("is_homing", "") if state.mode is DeviceMode.HOMING else None


def _still(state: DeviceState) -> Reason:
    return ("is_moving", state.mode.name) if state.mode in MOVING else None


def _arm(state: DeviceState) -> Reason:
    if state.mode in FAULTY:
        return "in_fault", state.mode.name
    return ("already_armed", "") if state.armed else None


def _disarm(state: DeviceState) -> Reason:
    return None if state.armed else ("already_disarmed", "")


def _reference(state: DeviceState) -> Reason:
    if state.mode in FAULTY:
        return "in_fault", state.mode.name
    return _still(state)


def _reset(state: DeviceState) -> Reason:
    return None if state.mode in FAULTY or state.fault else ("no_fault", "")


def _hold(state: DeviceState) -> Reason:
    return None if state.mode is DeviceMode.RUN else ("not_moving", state.mode.name)


def _resume(state: DeviceState) -> Reason:
    return None if state.mode is DeviceMode.HOLD else ("not_held", state.mode.name)


def _output(state: DeviceState) -> Reason:
    return None


def _grip(state: DeviceState) -> Reason:
    return ("in_fault", state.mode.name) if state.mode is DeviceMode.ESTOP else None


def _home(arm: gemelo.Arm, state: DeviceState) -> Reason:
    if all(joint.drive.homing is None for joint in arm.description.joints):
        return "no_switches", ""
    if state.mode in FAULTY:
        return "in_fault", state.mode.name
    return _still(state) or (None if state.armed else ("drivers_off", ""))


CHECKS: dict[str, Callable[[DeviceState], Reason]] = {
    "move": _move, "jog": _move, "arm": _arm, "disarm": _disarm, "reference": _reference, "reset": _reset,
    "hold": _hold, "resume": _resume, "output": _output, "grip": _grip,
}  # fmt: skip
