"""Measurements of the wire that somebody has asked for: a question for the clock each, which moves nothing."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from gemelo.libraries.arm.motors.relative_moves import LOOP_READING
from gemelo.schemas.device import EchoResponse
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.device.gateway_device import GatewayDevice
from gemelo.services.stepper_gateway.links.frames import SyncReply, encode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.links.reports import SensorReport
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import Answer

TIMEOUT = 1.0  # [s] after which an answer counts as lost; chosen: twice the silence that stops the arm
MOST = 32  # that may wait; chosen: it is one more than any bench has under way
LOOKED_BACK = 10.0  # [s] of readings that count; chosen: a hundred of a sketch


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
            return self._refuse(ticket, reason)
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
                self._refuse(waiting.ticket, because("echo.unanswered", time=TIMEOUT))

    def _objection(self, moment: Moment) -> Reason | None:
        dialect, state = self._device.arm.device.dialect, self._device.state
        if not self._device.session.link_up:
            return because("echo.no_link", self._device.session.link_reason)
        if dialect is Dialect.RA:
            return because("echo.sketch", self._of_the_loop(moment))
        if dialect is Dialect.TEXT and (state is None or not state.referenced):
            return because("echo.unreferenced")
        return because("echo.too_many") if len(self._waiting) >= MOST else None

    def _of_the_loop(self, moment: Moment) -> Reason:
        """Whether robot.toml's loop_time is as long as the sketch's passes, by its own readings."""
        passes = [one.micros for one in self._passes if moment.monotonic - one.arrival <= LOOKED_BACK]
        if not passes:
            return because("echo.loop_unknown")
        longest, configured = max(passes), 1e6 * self._device.arm.device.loop_time  # [us]
        if longest <= configured:
            return because("echo.loop_fits", longest=longest, configured=configured)
        return because("echo.loop_too_long", longest=longest, configured=configured, loop_time=1e-6 * longest)

    def _refuse(self, ticket: int, why: Reason) -> None:
        self._answer(ticket, EchoResponse(reason=str(why), why=why))

    def _answer(self, ticket: int, response: EchoResponse) -> None:
        self._device.out.put(Answer(ticket, response))
