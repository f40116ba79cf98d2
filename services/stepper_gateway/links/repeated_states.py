"""States that repeat the one before: the loop is not woken for them, and the core is given few of them."""

from __future__ import annotations

from collections.abc import Callable

from gemelo.services.stepper_gateway.links.frames import state_content, state_time
from gemelo.services.stepper_gateway.links.link import Kind, Received

# [ns] chosen: between one and two periods of the device, so that a device that falls silent has lost none of its states
HELD = 30_000_000
READINGS = (Kind.SENSORS, Kind.SHAFT, Kind.SYNC_R)  # say nothing of what a state says


class Repetition:
    """For one thread: whether a state repeats the one before, but for its time."""

    def __init__(self) -> None:
        self._content: bytes | None = None

    def is_in(self, received: Received) -> bool:
        """True for such a state; what comes after anything else, or is retained or no frame, is none."""
        content = state_content(received.payload) if received.kind is Kind.STATE and not received.retained else None
        before, self._content = self._content, content if received.kind is Kind.STATE else self._content
        return content is not None and content == before


class StateSieve:
    """Leaves out repeated states of which the core makes nothing; what the last of them says is never lost."""

    def __init__(self) -> None:
        self._repetition = Repetition()
        self._held: Received | None = None

    def sift(self, received: Received, is_due: Callable[[int], bool]) -> list[Received]:
        """What the core is given now; `is_due(t_us)` is asked of a repeated state, with the device's time [us].

        Before what differs, and before an answer or an event, comes the last state that was left out: the core sees how
        long it was true, and nothing that was before it after it.
        """
        if self._repetition.is_in(received):
            if not is_due(state_time(received.payload)):
                self._held = received
                return []
            self._held = None
        elif received.kind not in READINGS and self._held is not None:
            return [*self.release(self._held.arrival + HELD), received]
        return [received]

    def release(self, now: int) -> list[Received]:
        """The last state that was left out, once no other has followed it at `now` [ns] monotonic."""
        held = self._held
        if held is None or now - held.arrival < HELD:
            return []
        self._held = None
        return [held]
