"""The jaws as the device drives them: a servo by its pulse, a valve by an output. Openings in [m]."""

from __future__ import annotations

from abc import ABC, abstractmethod

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.model.gripper import opening_of, pulse_of
from gemelo.schemas.device import DeviceCommandKind
from gemelo.schemas.grippers.gripper import PulseDrive, SwitchDrive
from gemelo.schemas.reasons import because
from gemelo.services.stepper_gateway.device.pending_commands import Arguments
from gemelo.services.stepper_gateway.goals.rejections import invalid
from gemelo.services.stepper_gateway.links.frames import StateFrame

SLACK = 1e-6  # [m] by which an end may be missed; chosen: rounding of a conversion

Sending = tuple[DeviceCommandKind, Arguments]


class Jaws(ABC):
    """What a way of driving a gripper can do, and what the device's states say of it."""

    commanded: float | None = None  # [m] of the device's output now; None: nothing was commanded since its start
    target: float | None = None  # [m] that the device goes to

    @property
    def has_arrived(self) -> bool:
        """The device's output is where it goes to; what hangs on it may still be on its way."""
        return self.commanded is not None and self.commanded == self.target

    @abstractmethod
    def require(self, position: float) -> None:
        """Raises `GoalRejected` for an opening [m] that it cannot have."""

    @abstractmethod
    def sending(self, position: float) -> Sending:
        """The command that opens or closes it to `position` [m]."""

    @abstractmethod
    def stopping(self) -> Sending | None:
        """The command that lets it stay where it is; None where it cannot."""

    @abstractmethod
    def travel_time(self, position: float) -> float:
        """[s] to `position` [m] from where it is, or from anywhere where that is not known."""

    @abstractmethod
    def on_state(self, state: StateFrame, now: float) -> None:
        """Take what the device says; `now` [s] monotonic."""

    @abstractmethod
    def is_overruled(self, position: float) -> bool:
        """True if the device does not go to `position` [m] any more."""


class ServoJaws(Jaws):
    """The pulse goes to its target at the configured speed."""

    def __init__(self, drive: PulseDrive) -> None:
        self._drive = drive

    def require(self, position: float) -> None:
        _require_within(position, self._drive.closed, self._drive.open)

    def sending(self, position: float) -> Sending:
        return DeviceCommandKind.SERVO, Arguments(argument=self._pulse(position))

    def stopping(self) -> Sending | None:
        return DeviceCommandKind.SERVO, Arguments(index=1)

    def travel_time(self, position: float) -> float:
        drive = self._drive
        way = drive.open - drive.closed if self.commanded is None else abs(position - self.commanded)
        return way / drive.speed

    def on_state(self, state: StateFrame, now: float) -> None:
        self.commanded = opening_of(self._drive, state.servo_us) if state.servo_us else None
        self.target = opening_of(self._drive, state.servo_target_us) if state.servo_target_us else None

    def is_overruled(self, position: float) -> bool:
        return self.target is None or abs(pulse_of(self._drive, self.target) - self._pulse(position)) > 0.5

    def _pulse(self, position: float) -> int:
        return round(pulse_of(self._drive, position))


class OutputJaws(Jaws):
    """Open or closed; how far it is on its way is known by its travel time alone."""

    def __init__(self, drive: SwitchDrive, arm: ArmDescription) -> None:
        self._drive = drive
        self._index = [output.name for output in arm.outputs].index(drive.output)
        self._from = 0.0  # [m]
        self._switched = -1e9  # [s] monotonic

    def require(self, position: float) -> None:
        drive = self._drive
        _require_within(position, drive.closed, drive.open)
        if not self._is_closed(position) and abs(position - drive.open) > SLACK:
            ends = {"closed": drive.closed, "open": drive.open}
            raise invalid(because("gripper.opening.between", value=position, output=drive.output, **ends))

    def sending(self, position: float) -> Sending:
        is_on = self._is_closed(position) == self._drive.closes
        return DeviceCommandKind.OUTPUT, Arguments(index=self._index, argument=int(is_on))

    def stopping(self) -> Sending | None:
        return None

    def travel_time(self, position: float) -> float:
        share = 1.0 if self.commanded is None else abs(position - self.commanded) / self._travel
        return self._drive.travel_time * share

    def on_state(self, state: StateFrame, now: float) -> None:
        is_closed = bool(state.outputs >> self._index & 1) == self._drive.closes
        target = self._drive.closed if is_closed else self._drive.open
        if self.target is None or self.commanded is None:
            self._from = target
        elif target != self.target:
            self._from, self._switched = self.commanded, now
        self.target = target
        most = (now - self._switched) / self._drive.travel_time * self._travel
        way = target - self._from
        self.commanded = target if abs(way) <= most else self._from + (most if way > 0.0 else -most)

    def is_overruled(self, position: float) -> bool:
        return self.target is None or abs(self.target - position) > SLACK

    @property
    def _travel(self) -> float:
        return self._drive.open - self._drive.closed

    def _is_closed(self, position: float) -> bool:
        return abs(position - self._drive.closed) <= SLACK


def jaws_of(arm: ArmDescription) -> Jaws | None:
    """The jaws of robot.toml's gripper; None without one."""
    if arm.gripper is None:
        return None
    drive = arm.gripper.drive
    return ServoJaws(drive) if isinstance(drive, PulseDrive) else OutputJaws(drive, arm)


def _require_within(position: float, closed: float, opened: float) -> None:
    if not closed - SLACK <= position <= opened + SLACK:
        raise invalid(because("gripper.opening.beyond", value=position, closed=closed, open=opened))
