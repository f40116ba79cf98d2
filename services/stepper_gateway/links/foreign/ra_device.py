"""A sketch that is driven by dialect "ra", as a device of ours: frames on one side, its JSON on the other. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import msgspec

from gemelo.libraries.arm.device.device_config import reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.motors.relative_moves import ramp_of
from gemelo.services.stepper_gateway.links.foreign import ra_messages
from gemelo.services.stepper_gateway.links.foreign.ra_sender import RaSender
from gemelo.services.stepper_gateway.links.foreign.stand_in import Report, StandIn
from gemelo.services.stepper_gateway.links.link import Kind

NAME = "an AccelStepper sketch on ra/juntas"
SILENCE = 10.0  # words of its telemetry that a sketch may miss before it counts as gone; chosen: QoS 0 loses some

OWN = 64  # messages of ours that are known when the broker sends them back; chosen: those of a minute and more
OTHER = (
    "another program sends ra/juntas too, and the sketch has moved by it: where the arm is is not known. End that "
    "program, then run `gemelo reference`"
)
COMPLAINTS = 1.0  # [s] between two about messages that cannot be read; chosen: the log stays readable


class RaDevice:
    """One arm behind one sketch; `now` [s] is any clock that only goes forward."""

    def __init__(self, arm: ArmDescription, new_boot: Callable[[], int], now: float) -> None:
        """Nobody knows where the sketch's joints are: a person has to say it, with REFERENCE."""
        self._ramps = tuple(ramp_of(joint.drive) for joint in arm.joints)
        self._telemetry_time, steps = arm.device.telemetry_time, reference_steps(arm)
        self._stand_in = StandIn(arm, NAME, steps, new_boot, now)
        self._sender = RaSender(self._ramps, steps, self._telemetry_time)
        self._heard = -1.0e9  # [s] the sketch's latest word
        self._is_online = self._is_lost = False
        self._output = False
        self._said_output: bool | None = None  # None: not known at the sketch
        self._estado: float | None = None
        self._bad, self._complained = 0, -1.0e9  # how many, and [s] when one was told of last
        self._reports: list[Report] = []
        self._own: deque[bytes] = deque(maxlen=OWN)
        self._others, self._told_others = 0, -1.0e9  # messages of another program, and [s] when they were told of last

    @property
    def sent(self) -> tuple[int, ...]:
        """[steps] the sum of all that the sketch was sent, from where a person has said that it stands."""
        return tuple(self._sender.sent)

    def receive(self, kind: Kind, payload: bytes, now: float) -> None:
        """A frame of the gateway's, at `now` [s] monotonic."""
        before = self._stand_in.steps
        self._stand_in.advance(now)
        moved = self._stand_in.steps
        self._stand_in.receive(kind, payload, now)
        placed = tuple(b - a for a, b in zip(moved, self._stand_in.steps, strict=True))
        if kind is Kind.CMD and any(placed) and before == moved:
            self._sender.rebase(placed)

    def hear(self, topic: str, payload: bytes, retained: bool, now: float) -> None:
        """A message of the sketch, or to it, at `now` [s]. One retained may be of a dead sketch; what is unreadable is
        told."""
        if retained:
            return
        if topic == ra_messages.JOINTS:
            return self._hear_joints(payload, now)
        read = ra_messages.read_states if topic == ra_messages.STATES else ra_messages.read_sensors
        try:
            values = read(payload).values
        except ra_messages.BadRaMessage as error:
            return self._complain(str(error), now)
        self._sender.heard(now)
        self._heard = now
        self._tell(values, now)

    def advance(self, now: float) -> list[bytes]:
        """Let time pass until `now` [s] monotonic; what is to be published on ra/juntas then."""
        self._stand_in.advance(now)
        if now - self._heard > SILENCE * self._telemetry_time:
            self._miss(now)
            return []
        if not self._is_online:
            self._is_online, self._said_output = True, None
            self._stand_in.report_status()
            if self._is_lost:
                self._is_lost = False
                detail = "the sketch was silent in a motion: where the arm is is not known"
                self._say(Kind.EVENT, {"event": "position_lost", "t_us": 0, "detail": detail})
        messages = self._messages(now)
        self._own.extend(messages)
        return messages

    def take(self) -> list[Report]:
        """What the gateway is to hear; nothing while the sketch is silent."""
        if not self._is_online:
            self._stand_in.discard()
            self._reports.clear()
            return []
        said, self._reports = self._stand_in.take(self._is_settled) + self._reports, []
        return said

    @property
    def _is_settled(self) -> bool:
        return self._sender.is_done and self._stand_in.steps == self.sent

    def _messages(self, now: float) -> list[bytes]:
        output = ra_messages.OUTPUT in self._stand_in.outputs
        move = self._sender.take(self._stand_in.steps, not self._stand_in.is_moving, now)
        if move is not None:
            self._said_output = output
            return [ra_messages.joints_message(move, self._ramps, output)]
        if output != self._said_output:
            self._said_output = output
            return [ra_messages.output_message(output)]
        return []

    def _hear_joints(self, payload: bytes, now: float) -> None:
        """What the broker has passed on to the sketch: by another's move nobody knows any more where the arm is."""
        if payload in self._own or not ra_messages.moves(payload, self._ramps):
            return
        self._others += 1
        if self._stand_in.is_referenced or self._stand_in.is_moving or not self._is_settled:
            self._stand_in.start(self.sent, False, now)
            self._sender = RaSender(self._ramps, self.sent, self._telemetry_time)
            self._told_others = -1.0e9
        if now - self._told_others >= COMPLAINTS:
            self._told_others = now
            event = {"event": "position_lost", "t_us": self._stand_in.device_us(now)}
            self._say(
                Kind.EVENT, {**event, "detail": f"{OTHER} ({self._others} so far: {payload.decode(errors='replace')})"}
            )

    def _miss(self, now: float) -> None:
        """The sketch has fallen silent: a motion does not go on, and what it did of the last message is not known."""
        if not self._is_online:
            return
        self._is_online = False
        if self._stand_in.is_moving or not self._is_settled:
            is_known = self._sender.is_done
            self._is_lost = not is_known
            self._stand_in.start(self.sent, is_known, now)
            self._sender = RaSender(self._ramps, self.sent, self._telemetry_time)

    def _tell(self, values: dict[str, float], now: float) -> None:
        t_us = self._stand_in.device_us(now)
        estado = values.pop("estado", self._estado)
        if estado != self._estado:
            self._estado = estado
            self._say(Kind.EVENT, {"event": "estado", "t_us": t_us, "detail": f"{estado:g}"})
        if values:
            self._say(Kind.SENSORS, {"t_us": t_us, **values})

    def _complain(self, about: str, now: float) -> None:
        self._bad += 1
        if now - self._complained >= COMPLAINTS:
            self._complained = now
            event = {"event": "bad_message", "t_us": self._stand_in.device_us(now)}
            self._say(Kind.EVENT, {**event, "detail": f"{about} ({self._bad} so far)"})

    def _say(self, kind: Kind, report: dict[str, object]) -> None:
        self._reports.append((kind, msgspec.json.encode(report)))
