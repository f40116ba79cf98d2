"""The seed's way of stepping: relative moves, each counted from where the motor happens to be.

Step intervals after Austin, "Generate stepper-motor speed profiles in real time" (Embedded Systems Programming, 2005),
with the rule of the seed's library that a new target is the PRESENT position plus the message's steps, whatever is
left of the move before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

FIRST_INTERVAL = 0.676  # Austin's correction of the first of the equal-acceleration intervals


@dataclass(frozen=True)
class Message:
    """One relative move as it arrives."""

    time: float  # [s]
    steps: int


def relative_moves(steps: int, period: float, duration: float) -> list[Message]:
    """A move as the seed streams it: all of it in the first message, nothing in those that follow."""
    return [Message(number * period, 0 if number else steps) for number in range(round(duration / period))]


class SeedStepper:
    """One motor of the sketch; `pulses` says when it steps, and which way."""

    def __init__(self, speed: float, acceleration: float) -> None:
        self._shortest = 1.0 / speed  # [s] between steps
        self._acceleration = acceleration  # [steps/s^2]
        self._position = self._target = 0
        self._ramp = 0  # steps since rest, negative: still to do until rest
        self._interval = 0.0  # [s] to the next step; 0: at rest
        self._direction = 1

    def pulses(self, messages: Sequence[Message], until: float) -> Iterator[tuple[float, int]]:
        """Time [s] and direction of every step before `until`."""
        waiting, now = sorted(messages, key=lambda message: message.time), 0.0
        while True:
            due = now + self._interval if self._interval else math.inf
            if waiting and waiting[0].time <= due:
                message = waiting.pop(0)
                was_resting = self._interval == 0.0
                self._target = self._position + message.steps
                self._plan()
                # Intervals count from the last step; after a rest that is long ago, so the first step is due at once.
                now = message.time - self._interval if was_resting else now
                continue
            if due >= until:
                return
            now = due
            self._position += self._direction
            yield now, self._direction
            self._plan()

    def _plan(self) -> None:
        to_go = self._target - self._position
        to_stop = self._steps_to_stop()
        if to_go == 0 and to_stop <= 1:
            self._interval, self._ramp = 0.0, 0
            return
        is_on_its_way = to_go * self._direction > 0
        if self._ramp > 0 and (to_stop >= abs(to_go) or not is_on_its_way):
            self._ramp = -to_stop
        elif self._ramp < 0 and to_stop < abs(to_go) and is_on_its_way:
            self._ramp = -self._ramp
        self._next_interval(to_go)

    def _next_interval(self, to_go: int) -> None:
        if self._ramp == 0:
            self._direction = 1 if to_go > 0 else -1
            self._interval = FIRST_INTERVAL * math.sqrt(2.0 / self._acceleration)
        else:
            self._interval -= 2.0 * self._interval / (4.0 * self._ramp + 1.0)
            self._interval = max(self._interval, self._shortest)
        self._ramp += 1

    def _steps_to_stop(self) -> int:
        speed = 1.0 / self._interval if self._interval else 0.0
        return int(speed * speed / (2.0 * self._acceleration))
