"""The sender of commanded steps to a sketch: what it has been sent, and the time of the next message. Pure.

AccelStepper's move() counts from where the motor is, so a message that comes before the last one has ended discards
what is left of that. So one message is under way at a time, and it is over when its time has passed and the sketch was
heard after it: while the sketch's loop stands still its motors do too, and it says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

from gemelo.libraries.arm.motors.relative_moves import GATHERING, LONGEST_GAP, MARGIN, Loop, Ramp


class RaSender:
    """The steps of one arm; `now` is [s] on any clock that only goes forward."""

    def __init__(self, ramps: Sequence[Ramp], steps: Sequence[int], loop: Loop) -> None:
        """The sketch stands at `steps`, and sends a word of telemetry every so often while its loop runs."""
        self._longest_gap = LONGEST_GAP * loop.telemetry_time
        self._ramps, self._loop = tuple(ramps), loop
        self.sent = list(steps)  # absolute: where the sketch's shafts are when it has done all
        self._due = -1.0e9  # [s] when the last message has surely ended
        self._heard = -1.0e9  # [s] the sketch's latest word
        self._behind_since: float | None = None  # [s] since when there is something to send

    @property
    def is_done(self) -> bool:
        """The sketch has had its time for the last message, and was heard after that."""
        return self._heard >= self._due

    def heard(self, now: float) -> None:
        """A word of the sketch at `now` [s]: it lives; for what it was silent longer than usual, its motors stood."""
        silence = now - self._heard
        if not self.is_done and silence > self._longest_gap:
            self._due += silence
        self._heard = now

    def rebase(self, by: Sequence[int]) -> None:
        """The steps were counted anew without a move: a person has said where the joints are."""
        self.sent = [count + more for count, more in zip(self.sent, by, strict=True)]

    def take(self, commanded: Sequence[int], is_at_rest: bool, now: float) -> tuple[int, ...] | None:
        """The relative move [steps] to send now, all that is left of `commanded`; None while it is to wait."""
        move = tuple(wanted - sent for wanted, sent in zip(commanded, self.sent, strict=True))
        if not any(move):
            self._behind_since = None
            return None
        if self._behind_since is None:
            self._behind_since = now
        is_gathered = is_at_rest or now - self._behind_since >= GATHERING
        # A sketch that is silent just now may have lost its connection, and the message with it.
        is_present = now - self._heard <= self._longest_gap
        if not (self.is_done and is_gathered and is_present):
            return None
        self.sent = list(commanded)
        self._behind_since = None
        longest = max(ramp.duration(count, self._loop) for ramp, count in zip(self._ramps, move, strict=True))
        self._due = now + MARGIN + longest
        return move
