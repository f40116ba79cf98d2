"""What is known of the device: the newest of every message about it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from schemas.device import DeviceState, DeviceStatus
from schemas.topics import DEVICE_CONFIGURATION, DEVICE_STATE, DEVICE_STATUS, SENSORS
from services.cli.exits import CommandError, ExitCode

if TYPE_CHECKING:
    from services.cli.session import Session

PATIENCE = 2.0  # [s] for the first messages
POLL = 0.02  # [s]


class DeviceView:
    """Listens from its making on."""

    def __init__(self, session: Session) -> None:
        self.session = session
        node = session.node
        self.status = node.latest(DEVICE_STATUS)
        self.state = node.latest(DEVICE_STATE)
        self.configuration = node.latest(DEVICE_CONFIGURATION)
        self.sensors = node.latest(SENSORS)

    def wait_for(self, is_enough: Callable[[], bool], timeout: float = PATIENCE) -> bool:
        """Handles messages until `is_enough()`; whether it came true."""
        node = self.session.node
        deadline = node.monotonic() + timeout
        while not is_enough():
            if node.monotonic() >= deadline:
                return False
            node.wait(POLL)
        return True

    def require_heard(self) -> None:
        """Waits for the first word of the device; raises if there is none."""
        self.wait_for(lambda: self._is_settled)
        if self.status.message is None and self.state.message is None:
            raise CommandError(
                f"nothing heard of the device in {PATIENCE:g} s: is stepper_gateway running? `gemelo node list`",
                ExitCode.NO_STACK,
            )

    def require_state(self) -> DeviceState:
        """How the device is now; raises where it cannot be known, with the reason."""
        self.require_heard()
        status = self.status.message
        if status is not None and not status.online:
            raise CommandError(f"the device is offline: {status.reason or 'no reason is known'}")
        if self.state.message is None or self.state.is_stale:
            raise CommandError("the device says nothing of its state: `gemelo device status`", ExitCode.NO_STACK)
        return self.state.message

    def require_status(self) -> DeviceStatus:
        """Who the device is; raises where nobody says it."""
        self.wait_for(lambda: self.status.message is not None)
        if self.status.message is None:
            raise CommandError("nobody says who the device is: is stepper_gateway running?", ExitCode.NO_STACK)
        return self.status.message

    @property
    def _is_settled(self) -> bool:
        """Whether nothing more is to be expected: an offline device has no state."""
        status = self.status.message
        return status is not None and (not status.online or self.state.message is not None)
