"""A sketch as people have it: relative moves on `ra/juntas` by AccelStepper, in virtual time.

Written from the published behaviour: the ramp of D. Austin, "Generate stepper-motor speed profiles in real time"
(2005), with the first interval 0.676 c0; move() counts from the present position; one step at most in every pass of
the loop; telemetry every 100 ms; a reconnection that blocks the loop, in which the motors stand.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from gemelo.libraries.arm.motors.relative_moves import Ramp

PASS = 40e-6  # [s] of one loop(), without what blocks it
PUBLISH = 0.002  # [s] that the two messages of the telemetry block it
TELEMETRY = 0.1  # [s]
FIRST = 0.676  # of the exact first interval: what the approximation lacks


class AustinStepper:
    """One motor; `position` counts the steps of its shaft. Times are [s]."""

    def __init__(self, speed: float, acceleration: float) -> None:
        self.position = self._target = 0
        self._acceleration = acceleration
        self._shortest = 1.0 / speed
        self._first = FIRST * math.sqrt(2.0 / acceleration)
        self._interval = 0.0
        self._last = -math.inf  # the last step, or the power-on: both were long ago when the first message comes
        self._count = 0  # of the ramp: negative while it slows down
        self._direction = 1
        self._wait = 0.0  # the present step interval; 0: stands

    @property
    def remaining(self) -> int:
        """[steps] to the target."""
        return self._target - self.position

    @property
    def due(self) -> float | None:
        """[s] when its next step is due; None: it stands."""
        return self._last + self._wait if self._wait else None

    def move(self, relative: int) -> None:
        """From where it is now: what was left of another move is forgotten."""
        self._target = self.position + relative
        self._plan()

    def step(self, now: float) -> None:
        """The step that is due at `now` [s]."""
        self.position += self._direction
        self._last = now
        self._plan()

    def _plan(self) -> None:
        left = self.remaining
        to_stop = int((1.0 / self._wait) ** 2 / (2.0 * self._acceleration)) if self._wait else 0
        if left == 0 and to_stop <= 1:
            self._wait, self._count = 0.0, 0
            return
        is_ahead = left * self._direction > 0
        if self._count > 0 and (to_stop >= abs(left) or not is_ahead):
            self._count = -to_stop
        elif self._count < 0 and to_stop < abs(left) and is_ahead:
            self._count = -self._count
        if self._count == 0:
            self._interval, self._direction = self._first, 1 if left > 0 else -1
        else:
            self._interval -= 2.0 * self._interval / (4.0 * self._count + 1.0)
            self._interval = max(self._interval, self._shortest)
        self._count += 1
        self._wait = self._interval


@dataclass
class HostSketch:
    """One board; it hears and speaks only by `receive` and `advance`."""

    ramps: Sequence[Ramp]
    truncates: bool = True  # degrees to steps: (long) x, or lround(x)
    is_on: bool = True
    led: bool = False
    state: bytes = b'{"estado": 1}'  # published on ra/estados
    sensors: bytes = b'{"ultra": 42}'  # and on ra/sensores
    moves: int = 0
    discarded: int = 0  # [steps] of moves that another one has ended
    motors: tuple[AustinStepper, ...] = ()
    _now: float = 0.0
    _free: float = 0.0  # [s] until then the loop is blocked
    _telemetry: float = 0.0
    _inbox: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.motors = tuple(AustinStepper(ramp.speed, ramp.acceleration) for ramp in self.ramps)

    @property
    def shafts(self) -> tuple[int, ...]:
        return tuple(motor.position for motor in self.motors)

    @property
    def is_moving(self) -> bool:
        return any(motor.due is not None for motor in self.motors)

    def block(self, seconds: float) -> None:
        """A reconnection, or anything else that holds loop() up for `seconds` [s]: no step is made meanwhile."""
        self._free = max(self._now, self._free) + seconds

    def receive(self, payload: bytes) -> None:
        """A message on ra/juntas; it is read in the next pass of the loop."""
        self._inbox.append(payload)

    def advance(self, now: float) -> list[tuple[str, bytes]]:
        """Let time pass until `now` [s]; the messages that were published."""
        said: list[tuple[str, bytes]] = []
        while self.is_on and self._free <= now:
            at = max(self._free, self._now)
            self._read()
            due = [motor for motor in self.motors if motor.due is not None]
            next_step = min((motor.due or 0.0 for motor in due), default=math.inf)
            soonest = max(at, min(next_step, self._telemetry))
            if soonest > now:
                self._now = self._free = now
                break
            for motor in due:
                if (motor.due or 0.0) <= soonest:
                    motor.step(soonest)
            self._now = self._free = soonest + PASS
            if soonest >= self._telemetry:
                self._telemetry = soonest + TELEMETRY
                self._free += PUBLISH
                said += [("ra/estados", self.state), ("ra/sensores", self.sensors)]
        self._now = now
        return said

    def _read(self) -> None:
        for payload in self._inbox:
            try:
                message = json.loads(payload)
            except ValueError:
                continue
            if isinstance(message, dict):
                self._obey(message)
        self._inbox.clear()

    def _obey(self, message: dict[str, float]) -> None:
        if "avanzar" in message:
            self.led = bool(message["avanzar"])
        if not all(ramp.name in message for ramp in self.ramps):
            return
        self.moves += 1
        for ramp, motor in zip(self.ramps, self.motors, strict=True):
            self.discarded += abs(motor.remaining)
            motor.move(self.steps(message[ramp.name], ramp))

    def steps(self, degrees: float, ramp: Ramp) -> int:
        """The steps that it makes of `degrees` [deg], with the floats of an ESP32."""
        exact = _single(_single(_single(degrees) * _single(float(ramp.steps_per_turn))) / 360.0)
        return int(exact) if self.truncates else math.floor(exact + 0.5)


def _single(value: float) -> float:
    return float(struct.unpack("f", struct.pack("f", value))[0])
