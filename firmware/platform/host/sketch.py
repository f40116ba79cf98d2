"""A sketch as people have it: relative moves on `ra/juntas` by AccelStepper, in virtual time.

Written from the published behaviour: the ramp of D. Austin, "Generate stepper-motor speed profiles in real time"
(2005), with the first interval 0.676 c0; move() counts from the present position; run() makes one step at most in every
pass of the loop, and only when one is due by the time since the last; telemetry every 100 ms; a reconnection that
blocks the loop, in which the motors stand.
"""

from __future__ import annotations

import json
import math
import random
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field

from gemelo.libraries.arm.motors.relative_moves import Ramp

PASS = 150e-6  # [s] mean of one loop(), without what blocks it; assumed: PubSubClient on an ESP32 takes 60 to 200 us
JITTER = 0.3  # of a pass, either way; chosen: so that passes and steps never keep in step
PUBLISH = 0.0006  # [s] that each of the two messages of the telemetry blocks it; assumed, on an ESP32
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

    @property
    def stepped(self) -> float:
        """[s] when it made its last step: at the start of a pass; minus infinity before the first."""
        return self._last

    def restart(self) -> None:
        """The board starts anew: what was left of a move is not made."""
        self._target, self._wait, self._count = self.position, 0.0, 0

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
    pass_time: float = PASS  # [s] mean of one loop()
    jitter: float = JITTER  # of each pass, either way
    publish: float = PUBLISH  # [s] that each message of the telemetry holds loop() up
    telemetry_time: float = TELEMETRY  # [s]
    seed: int = 1  # of the passes
    moves: int = 0
    discarded: int = 0  # [steps] of moves that another one, or a restart, has ended
    motors: tuple[AustinStepper, ...] = ()
    _free: float = 0.0  # [s] when the next pass begins
    _is_starting: bool = False  # after a restart, until its first pass
    _telemetry: float = 0.0
    _inbox: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.motors = tuple(AustinStepper(ramp.speed, ramp.acceleration) for ramp in self.ramps)
        self._random = random.Random(self.seed)

    @property
    def shafts(self) -> tuple[int, ...]:
        return tuple(motor.position for motor in self.motors)

    @property
    def is_moving(self) -> bool:
        return any(motor.due is not None for motor in self.motors)

    def block(self, seconds: float) -> None:
        """A reconnection, or anything else that holds loop() up for `seconds` [s]: no step is made meanwhile."""
        self._free += seconds

    def restart(self, seconds: float) -> None:
        """A reset: it speaks again after `seconds` [s]; what was left of a move, or came meanwhile, is lost."""
        self._inbox.clear()
        self._is_starting = True
        self.block(seconds)
        for motor in self.motors:
            self.discarded += abs(motor.remaining)
            motor.restart()

    def receive(self, payload: bytes) -> None:
        """A message on ra/juntas; it is read in the next pass of the loop."""
        if not self._is_starting:
            self._inbox.append(payload)

    def advance(self, now: float) -> list[tuple[str, bytes]]:
        """Let time pass until `now` [s]; the messages that were published."""
        said: list[tuple[str, bytes]] = []
        if not self.is_on:
            self._free = max(self._free, now)
        while self.is_on and self._free <= now:
            self._is_starting = False
            self._read()
            steps = min((motor.due for motor in self.motors if motor.due is not None), default=math.inf)
            at = self._idle(min(steps, self._telemetry, now))
            if at > now:
                break
            for motor in self.motors:
                if motor.due is not None and motor.due <= at:
                    motor.step(at)
            self._free += self._pass()
            if at >= self._telemetry:
                self._telemetry = at + self.telemetry_time
                said += [("ra/estados", self.state), ("ra/sensores", self.sensors)]
                self.block(2.0 * self.publish)
        return said

    def _idle(self, until: float) -> float:
        """[s] the start of the first pass at `until` [s] or later: those before it have nothing to do."""
        longest = self.pass_time * (1.0 + self.jitter)
        while self._free < until:
            self._free += max(1, int((until - self._free) / longest)) * self._pass()
        return self._free

    def _pass(self) -> float:
        """[s] that a pass takes."""
        return self.pass_time * self._random.uniform(1.0 - self.jitter, 1.0 + self.jitter)

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
