"""A sketch that is driven by dialect "ra", as a device of ours: frames on one side, its JSON on the other. Pure."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import msgspec

from gemelo.libraries.arm.device.device_config import reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.arm.motors.relative_moves import MARGIN, loop_of, ramp_of
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.foreign import ra_messages
from gemelo.services.stepper_gateway.links.foreign.ra_sender import RaSender
from gemelo.services.stepper_gateway.links.foreign.stand_in import Report, StandIn
from gemelo.services.stepper_gateway.links.link import Kind

NAME = "an AccelStepper sketch on ra/juntas"
AT_REST = 10.0  # words of its telemetry that a sketch may miss before it counts as gone; chosen: QoS 0 loses some
# Chosen: a board that starts anew is back on its network after more than three words at 10 Hz.
IN_A_MESSAGE = 3.0  # words that it may miss while it has a message to do, but never less than a network delays one
LONGEST_SILENCE = 1.0  # [s] whatever its telemetry is; chosen: a restart takes longer
UNSEEN = 1.0  # [s] after which the broker has not passed a message on; chosen: longer than a slow network takes
OWN = 64  # messages of ours that are known when the broker sends them back; chosen: those of a minute and more
COMPLAINTS = 1.0  # [s] between two about messages that cannot be read; chosen: the log stays readable


class RaDevice:
    """One arm behind one sketch; `now` [s] is any clock that only goes forward."""

    def __init__(self, arm: ArmDescription, new_boot: Callable[[], int], now: float) -> None:
        """Nobody knows where the sketch's joints are: a person has to say it, with REFERENCE."""
        self._ramps = tuple(ramp_of(joint.drive) for joint in arm.joints)
        self._loop, steps = loop_of(arm.device), reference_steps(arm)
        self._stand_in = StandIn(arm, NAME, steps, new_boot, now)
        self._sender = RaSender(self._ramps, steps, self._loop)
        self._heard = -1.0e9  # [s] the sketch's latest word
        self._stalled = 0.0  # [s] of the stand-in's, as far as it was taken into account
        self._is_online = False
        self._output = False
        self._said_output: bool | None = None  # None: not known at the sketch
        self._estado: float | None = None
        self._bad, self._complained = 0, -1.0e9  # how many, and [s] when one was told of last
        self._reports: list[Report] = []
        self._own: deque[bytes] = deque(maxlen=OWN)
        self._unseen: bytes | None = None  # the newest move, until the broker has sent it back
        self._moved = -1.0e9  # [s] when it was sent
        self._sees_own = False  # the broker sends our messages back to us
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
        stalled, self._stalled = self._stand_in.stalled - self._stalled, self._stand_in.stalled
        self._heard = min(now, self._heard + stalled)
        self._watch(now)
        if not self._is_online:
            return []
        messages = self._messages(now)
        self._own.extend(messages)
        return messages

    def take(self) -> list[Report]:
        """What the gateway is to receive, with why a motion has ended first; nothing while the sketch is silent."""
        if not self._is_online:
            self._stand_in.discard()
            self._reports.clear()
            return []
        said, self._reports = self._reports + self._stand_in.take(self._is_settled), []
        return said

    @property
    def _is_settled(self) -> bool:
        return self._sender.is_done and not self._is_unseen and self._stand_in.steps == self.sent

    @property
    def _is_unseen(self) -> bool:
        """The broker, which sends our messages back to us, has not sent back the newest move."""
        return self._sees_own and self._unseen is not None

    def _messages(self, now: float) -> list[bytes]:
        output = ra_messages.OUTPUT in self._stand_in.outputs
        move = None
        if not self._is_unseen:
            move = self._sender.take(self._stand_in.steps, not self._stand_in.is_moving, now)
        if move is not None:
            self._said_output = output
            message = ra_messages.joints_message(move, self._ramps, output)
            self._unseen, self._moved = message, now
            return [message]
        if output != self._said_output:
            self._said_output = output
            return [ra_messages.output_message(output)]
        return []

    def _hear_joints(self, payload: bytes, now: float) -> None:
        """What the broker has passed on to the sketch: by another's move nobody knows any more where the arm is."""
        if payload in self._own:
            self._sees_own = True
            self._unseen = None if payload == self._unseen else self._unseen
            return
        if not ra_messages.moves(payload, self._ramps):
            return
        self._others += 1
        if self._stand_in.is_referenced or self._stand_in.is_moving or not self._is_settled:
            self._start(False, now)
            self._told_others = -1.0e9
        if now - self._told_others >= COMPLAINTS:
            self._told_others = now
            message = payload.decode(errors="replace")
            self._say_lost(because("position.other_program", count=self._others, message=message), now)

    def _watch(self, now: float) -> None:
        """Presence: what a sketch that fell silent in a message did of it is not known, and no motion goes on."""
        silence = now - self._heard
        if self._is_online and not self._sender.is_done and silence > self._patience(IN_A_MESSAGE):
            return self._lose(because("position.sketch_silent", time=silence), now)
        if self._is_online and self._is_unseen and now - self._moved > UNSEEN:
            return self._lose(because("position.message_lost"), now)
        is_present = silence <= self._patience(AT_REST)
        if self._is_online and not is_present and (self._stand_in.is_moving or not self._is_settled):
            self._start(True, now)  # nothing of the motion was sent yet
        if is_present and not self._is_online:
            self._said_output = None
            self._stand_in.report_status()
        self._is_online = is_present

    def _patience(self, words: float) -> float:
        """[s] of silence that so many words of its telemetry make."""
        telemetry_time = self._loop.telemetry_time
        return min(LONGEST_SILENCE, max(words * telemetry_time, telemetry_time + MARGIN))

    def _lose(self, why: Reason, now: float) -> None:
        self._start(False, now)
        self._say_lost(why, now)

    def _start(self, is_known: bool, now: float) -> None:
        """Begin anew where all that was sent ends; `is_known`: the sketch has done all of it."""
        self._stand_in.start(self.sent, is_known, now)
        self._sender = RaSender(self._ramps, self.sent, self._loop)
        self._sender.heard(self._heard)
        self._unseen = None

    def _say_lost(self, why: Reason, now: float) -> None:
        t_us = self._stand_in.device_us(now)
        self._say(Kind.EVENT, {"event": "position_lost", "t_us": t_us, "detail": str(why), "why": why})

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
