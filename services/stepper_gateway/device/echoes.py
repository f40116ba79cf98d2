"""Measurements of the wire that somebody has asked for: a question for the clock each, which moves nothing."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from gemelo.libraries.arm.motors.relative_moves import LOOP_READING
from gemelo.schemas.device import EchoResponse
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.links.frames import SyncReply, encode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.reports import SensorReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Answer

TIMEOUT = 1.0  # [s] after which an answer counts as lost; chosen: twice the silence that stops the arm
MOST = 32  # that may wait; chosen: it is one more than any bench has under way
NO_ANSWERS = "a sketch on ra/juntas answers nothing, so no round trip can be measured"
NO_WORD = 'its readings do not say how long its loop() takes: publish "loop_us" in ra/sensores (docs/my_old_sketch.md)'
LOOKED_BACK = 10.0  # [s] of readings that count; chosen: a hundred of a sketch
NOT_YET = "the first line to this board would move it: say where its joints stand first, with `gemelo reference`"


class Waiting(NamedTuple):
    """Who waits for the answer to which question."""

    ticket: int
    asked: float  # [s] monotonic


class LongestPass(NamedTuple):
    """What a sketch has said of its loop() once."""

    arrival: float  # [s] monotonic
    micros: float  # [us]


class Echoes:
    """Every question has a time of its own, so answers are told apart by it."""

    def __init__(self, device: GatewayDevice) -> None:
        self._device = device
        self._waiting: dict[int, Waiting] = {}  # by t0 [us]
        self._passes: deque[LongestPass] = deque()  # of the last LOOKED_BACK

    def ask(self, ticket: int, moment: Moment) -> None:
        """Send a question now, or answer why not."""
        if reason := self._objection(moment):
            return self._answer(ticket, EchoResponse(reason=reason))
        question = self._device.session.question(moment)
        self._waiting[question.t0] = Waiting(ticket, moment.monotonic)
        self._device.out.send(Kind.SYNC, encode(question))

    def on_reply(self, reply: SyncReply, arrival_us: int) -> None:
        """The device has answered a question at `arrival_us` [us] monotonic."""
        waiting = self._waiting.pop(reply.t0, None)
        if waiting is not None:
            held = (reply.t2 - reply.t1) * 1e-6
            took = (arrival_us - reply.t0) * 1e-6 - held
            self._answer(waiting.ticket, EchoResponse(answered=True, round_trip=max(0.0, took), waiting=held))

    def on_readings(self, report: SensorReport, arrival: float) -> None:
        """What a sketch says of its own loop(), at `arrival` [s] monotonic."""
        if LOOP_READING not in report.values:
            return
        self._passes.append(LongestPass(arrival, report.values[LOOP_READING]))
        while arrival - self._passes[0].arrival > LOOKED_BACK:
            self._passes.popleft()

    def step(self, moment: Moment) -> None:
        """Give up what was not answered in time."""
        for t0, waiting in list(self._waiting.items()):
            if moment.monotonic - waiting.asked > TIMEOUT:
                del self._waiting[t0]
                self._answer(waiting.ticket, EchoResponse(reason=f"no answer in {TIMEOUT:g} s"))

    def _objection(self, moment: Moment) -> str:
        dialect, state = self._device.arm.device.dialect, self._device.state
        if not self._device.session.link_up:
            return f"no link to the device: {self._device.session.link_reason}"
        if dialect is Dialect.RA:
            return f"{NO_ANSWERS}; {self._of_the_loop(moment)}"
        if dialect is Dialect.TEXT and (state is None or not state.referenced):
            return NOT_YET
        return "too many measurements at a time: one bench is enough" if len(self._waiting) >= MOST else ""

    def _of_the_loop(self, moment: Moment) -> str:
        """Whether robot.toml's loop_time is as long as the sketch's passes, by its own word."""
        passes = [one.micros for one in self._passes if moment.monotonic - one.arrival <= LOOKED_BACK]
        if not passes:
            return NO_WORD
        longest, believed = max(passes), 1e6 * self._device.arm.device.loop_time
        verdict = "which is enough" if longest <= believed else f"so write loop_time = {1e-6 * longest:.6f}"
        return f"its longest pass of loop() took {longest:.0f} us, robot.toml says {believed:.0f} us, {verdict}"

    def _answer(self, ticket: int, response: EchoResponse) -> None:
        self._device.out.put(Answer(ticket, response))
