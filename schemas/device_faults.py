"""The meaning of a device's fault and its remedy, for a person."""

from __future__ import annotations

from typing import NamedTuple

from gemelo.schemas.device import DeviceFault

AGAIN = "`gemelo reset`, `gemelo home`"


class FaultDescription(NamedTuple):
    """One fault in words."""

    name: str
    meaning: str
    remedy: str


_ABOUT = {
    DeviceFault.TICK_OVERRUN: (
        "the step pulses waited more than 3 ms for the path",
        f"{AGAIN}; if it comes again, lower [device] tick_hz in robot.toml",
    ),
    DeviceFault.INTERNAL: (
        "the firmware found something that cannot be",
        "write down what `gemelo device status` says, then restart the device",
    ),
    DeviceFault.LIMIT_SWITCH: (
        "its limit switch was pressed",
        f"see what it ran into (a torn wire looks the same), then {AGAIN}",
    ),
    DeviceFault.HOMING_TIMEOUT: (
        "it took longer than homing.timeout to find its place",
        f"see that it moves freely, or raise homing.timeout or homing.fast in robot.toml, then {AGAIN}",
    ),
    DeviceFault.SWITCH_NOT_FOUND: (
        "it travelled homing.max_travel and its home switch did not close",
        "press the switch by hand under `gemelo device monitor`; see that homing.direction in robot.toml is right, "
        f"then {AGAIN}",
    ),
    DeviceFault.SWITCH_STUCK: (
        "it moved off its home switch and the switch stays pressed",
        f"free the switch, or look for a torn wire or a wrong `active` in robot.toml, then {AGAIN}",
    ),
    DeviceFault.EMERGENCY_STOP: (
        "the emergency stop is or was pressed; the drivers are off",
        "when the danger is over: release it, `gemelo reset`, `gemelo device arm`, `gemelo home`",
    ),
}


def explain(fault: int) -> FaultDescription | None:
    """The fault with that number on the wire; None for none."""
    if fault == DeviceFault.NONE:
        return None
    if fault not in _ABOUT:
        return FaultDescription(f"FAULT {fault}", "a fault that only a newer gemelo knows", "update gemelo")
    meaning, remedy = _ABOUT[DeviceFault(fault)]
    return FaultDescription(DeviceFault(fault).name, meaning, remedy)


def fault_text(fault: int, joint: str = "") -> str:
    """One sentence with the joint and the remedy; empty for no fault."""
    about = explain(fault)
    if about is None:
        return ""
    where = f' at joint "{joint}"' if joint else ""
    return f"{about.name}{where}: {about.meaning}; {about.remedy}"
