"""A board that speaks `<SEQ,J1,...,Jn>`, as a device of ours: frames on one side, its lines on the other. Pure."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from gemelo.libraries.arm.device.device_config import reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.stepper_gateway.links.foreign.stand_in import Report, StandIn
from gemelo.services.stepper_gateway.links.foreign.text_exchange import TextExchange
from gemelo.services.stepper_gateway.links.foreign.text_messages import AnswerReader, line_of
from gemelo.services.stepper_gateway.links.frames import BadFrame, Sync, decode
from gemelo.services.stepper_gateway.links.link import Kind

NAME = "a board that speaks <SEQ,J1,...>"
SILENCE = 2.0  # [s] without an answer to any line, after which the board is not there; chosen: all RETRIES have failed
TELLING = 10.0  # [s] between two summaries of the line; chosen: the log stays readable


class TextDevice:
    """One arm behind one line; `now` [s] is any clock that only goes forward.

    Nothing is sent until a person has said with REFERENCE where the joints stand: the board moves to whatever it reads.
    """

    def __init__(self, arm: ArmDescription, new_boot: Callable[[], int], now: float) -> None:
        self._arm = arm
        self._stand_in = StandIn(arm, NAME, reference_steps(arm), new_boot, now)
        self._reader, self.exchange = AnswerReader(), TextExchange()
        self._target: tuple[int, ...] | None = None  # [steps] of the newest line
        self._due = self._told = now  # [s] of the next line, and of the latest summary
        self._asked_at: float | None = None  # [s] since when lines are not answered
        self._questions: list[Sync] = []  # that wait for the answer to a line
        self._is_online = True
        self._reports: list[Report] = []

    def receive(self, kind: Kind, payload: bytes, now: float) -> None:
        """A frame of the gateway's at `now` [s]; a question for the clock waits until the board answers a line."""
        if kind is Kind.SYNC and self._stand_in.is_referenced:
            try:
                question = decode(payload)
            except BadFrame:
                question = None
            if isinstance(question, Sync):
                self._questions = [*self._questions[-7:], question]
                return
        self._stand_in.receive(kind, payload, now)

    def hear(self, data: bytes, now: float) -> None:
        """Bytes of the board's, at `now` [s] monotonic."""
        for answer in self._reader.feed(data):
            is_first = self.exchange.on_answer(answer, now)
            self._asked_at = None
            if answer.refusal and is_first:
                self._say({"event": "line_refused", "detail": f"line {answer.seq}: {answer.refusal}"}, now)
            if is_first:
                for question in self._questions:
                    self._stand_in.answer_sync(question, now)
                self._questions.clear()

    def advance(self, now: float) -> list[bytes]:
        """Let time pass until `now` [s] monotonic; the lines to write then."""
        self._stand_in.advance(now)
        self._watch(now)
        if not self._stand_in.is_referenced:
            return []
        lines = self._lines(now)
        if lines and self._asked_at is None:
            self._asked_at = now
        return lines

    def take(self) -> list[Report]:
        """What the gateway is to hear; nothing while the board is silent."""
        if not self._is_online:
            self._stand_in.discard()
            self._reports.clear()
            return []
        said, self._reports = self._stand_in.take(self._is_settled) + self._reports, []
        return said

    @property
    def _is_settled(self) -> bool:
        newest = self.exchange.newest
        is_sent = self._target is None or self._target == self._stand_in.steps
        return is_sent and (newest is None or newest.is_answered)

    def _lines(self, now: float) -> list[bytes]:
        steps = self._stand_in.steps
        is_new = steps != self._target
        if now >= self._due and (is_new or (self._questions and not self.exchange.is_waiting)):
            period = 1.0 / self._arm.device.text_hz
            self._due = self._due + period if now - self._due < period else now + period
            return [self._line(steps, now)]
        again = self.exchange.again(now)
        return [again] if again is not None else []

    def _line(self, steps: tuple[int, ...], now: float) -> bytes:
        positions = [joint.steps.to_position(count) for joint, count in zip(self._arm.joints, steps, strict=True)]
        payload = line_of(self.exchange.next_seq, positions, self._arm.device.text_decimals)
        self.exchange.sent(payload, now)
        self._target = steps
        return payload

    def _watch(self, now: float) -> None:
        """Presence, and a summary now and then."""
        is_silent = self._asked_at is not None and now - self._asked_at > SILENCE
        if is_silent and self._is_online and (self._stand_in.is_moving or not self._is_settled):
            self._stand_in.start(self._stand_in.steps, False, now)
            self._target, self._asked_at, is_silent = None, None, False
            detail = f"no line was answered for {SILENCE:g} s of a motion: where the arm is is not known"
            self._say({"event": "position_lost", "detail": detail}, now)
        if self._is_online and is_silent:
            self._is_online = False
        elif not self._is_online and not is_silent:
            self._is_online = True
            self._stand_in.report_status()
        if now - self._told >= TELLING and self.exchange.counts.lines:
            self._told = now
            self._say({"event": "text_link", "detail": self.exchange.summary()}, now)

    def _say(self, event: dict[str, object], now: float) -> None:
        report = {**event, "t_us": self._stand_in.device_us(now)}
        self._reports.append((Kind.EVENT, msgspec.json.encode(report)))
