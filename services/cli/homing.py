"""The progress of a homing, from the device's states and events. Pure."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import msgspec

from schemas.device import DeviceEvent, DeviceMode, DeviceState
from schemas.device_faults import fault_text
from schemas.robot import HomingDirection
from services.cli.robot_names import joint_name

if TYPE_CHECKING:
    from services.arm.model.description import Arm, Joint

WAITS, TO, OFF, HOME = "waits", "to its switch", "off its switch", "home"


class HomeReport(msgspec.Struct, frozen=True, kw_only=True):
    """The end of a homing; --json prints it."""

    homed: tuple[str, ...] = ()
    steps_off: dict[str, int] = {}  # of joints whose place had been known before
    took_s: float = 0.0
    interrupted: bool = False
    reason: str = ""  # why not all are home


class Homing:
    """The homing of some joints: takes events and states from the moment on at which the device has agreed."""

    def __init__(self, arm: Arm, joints: Sequence[Joint]) -> None:
        self.joints = tuple(joints)
        self.has_begun = False
        self.reason = ""  # why it ended before its end
        self.steps_off: dict[str, int] = {}
        self.phases = {joint.name: WAITS for joint in joints}
        self._arm = arm
        self._mode: DeviceMode | None = None

    @property
    def homed(self) -> tuple[str, ...]:
        """The joints that have found their switches."""
        return tuple(name for name, phase in self.phases.items() if phase == HOME)

    @property
    def is_over(self) -> bool:
        """True if the device has left the mode Homing again."""
        return self.has_begun and self._mode is not DeviceMode.HOMING

    @property
    def is_done(self) -> bool:
        """True if all joints are home."""
        return len(self.homed) == len(self.phases)

    def on_event(self, event: DeviceEvent) -> None:
        """Takes an event of the device."""
        match event.event:
            case "homed":
                self._on_homed(event.detail)
            case "homing_stopped":
                self.reason = self.reason or stopped_text(event.detail)

    def on_state(self, state: DeviceState) -> None:
        """Takes a state of the device; one from before the homing, which may still be under way, is ignored."""
        self.has_begun = self.has_begun or state.mode is DeviceMode.HOMING or state.fault != 0
        if not self.has_begun:
            return
        self._mode = state.mode
        if state.fault:
            self.reason = fault_text(state.fault, joint_name(self._arm, state.fault_joint))
        velocity = dict(zip(state.name, state.velocity, strict=False))
        for joint in self.joints:
            if self.phases[joint.name] != HOME:
                self.phases[joint.name] = phase_of(joint, velocity.get(joint.name, 0.0)) or self.phases[joint.name]

    def _on_homed(self, detail: str) -> None:
        name, _, rest = detail.partition(":")
        name = joint_name(self._arm, name.strip())
        if name not in self.phases:
            return
        self.phases[name] = HOME
        off = re.search(r"-?\d+", rest)
        if off is not None:
            self.steps_off[name] = int(off[0])


def phase_of(joint: Joint, velocity: float) -> str:
    """The phase of a joint that moves at `velocity` [steps/s]; empty at standstill, as at every reversal."""
    if abs(velocity) < 1.0 or joint.drive.homing is None:
        return ""
    towards = 1.0 if joint.drive.homing.direction is HomingDirection.UPPER else -1.0
    return TO if math.copysign(1.0, velocity) == towards else OFF


def home_text(name: str, steps_off: int | None) -> str:
    """One line about a homed joint; `steps_off` is how far its counter was from its true position [steps]."""
    if steps_off is None:
        return f"{name}: home"
    if abs(steps_off) <= 1:
        return f"{name}: home; its counter was right{' to a step' if steps_off else ''}"
    return f"{name}: home; its counter was {steps_off:+d} steps off (steps were lost, or it was moved by hand)"


def stopped_text(detail: str) -> str:
    """The reason for which the device ended the homing."""
    if detail == "heartbeat":
        return "the device heard nothing from stepper_gateway for too long and stopped: `gemelo home` again"
    return "it was stopped; the joints that were not home yet are unreferenced: `gemelo home` again"
