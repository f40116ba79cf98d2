"""The meaning of a device's fault and its remedy, for a person."""

from __future__ import annotations

from typing import NamedTuple

from gemelo.schemas.device import DeviceFault
from gemelo.schemas.reasons import Reason, because, remedy


class FaultDescription(NamedTuple):
    """One fault in words."""

    name: str
    meaning: str
    remedy: str


_MEANINGS: dict[int, tuple[str, str]] = {  # the code of its meaning, and that of its remedy
    DeviceFault.TICK_OVERRUN: ("fault.tick_overrun", "fault_tick_overrun"),
    DeviceFault.INTERNAL: ("fault.internal", "fault_internal"),
    DeviceFault.LIMIT_SWITCH: ("fault.limit_switch", "fault_limit_switch"),
    DeviceFault.HOMING_TIMEOUT: ("fault.homing_timeout", "fault_homing_timeout"),
    DeviceFault.SWITCH_NOT_FOUND: ("fault.switch_not_found", "fault_switch_not_found"),
    DeviceFault.SWITCH_STUCK: ("fault.switch_stuck", "fault_switch_stuck"),
    DeviceFault.EMERGENCY_STOP: ("fault.emergency_stop", "fault_emergency_stop"),
}
_NEWER = ("fault.newer", "fault_newer")  # that a newer firmware has


def fault_reason(fault: int, joint: str = "") -> Reason | None:
    """The fault with that number on the wire, with the joint, its meaning and its remedy; None for no fault."""
    if fault == DeviceFault.NONE:
        return None
    meaning = _meaning(fault)
    if joint:
        return because("fault.at_joint", meaning, fault=fault_name(fault), joint=joint)
    return because("fault.present", meaning, fault=fault_name(fault))


def fault_text(fault: int, joint: str = "") -> str:
    """The same as a sentence; empty for no fault."""
    return str(fault_reason(fault, joint) or "")


def meaning_and_remedy(fault: int) -> tuple[Reason, Reason]:
    """Of the fault with that number on the wire, apart from one another."""
    meaning = _meaning(fault)
    return because(meaning.code), because("fault.remedy", *meaning.remedies)


def explain(fault: int) -> FaultDescription | None:
    """The fault with that number on the wire; None for none."""
    if fault == DeviceFault.NONE:
        return None
    meaning, mend = meaning_and_remedy(fault)
    return FaultDescription(fault_name(fault), str(meaning), str(mend))


def _meaning(fault: int) -> Reason:
    code, mend = _MEANINGS.get(fault, _NEWER)
    return because(code, remedy(mend))


def fault_name(fault: int) -> str:
    """As `word.fault` has it in the catalogue."""
    return DeviceFault(fault).name if fault in DeviceFault._value2member_map_ else f"FAULT {fault}"
