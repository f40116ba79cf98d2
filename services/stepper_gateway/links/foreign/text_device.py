"""A board that speaks `<SEQ,J1,...,Jn>`, as a device of ours: frames on one side, its lines on the other. Pure."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import NamedTuple

import msgspec

from gemelo.libraries.arm.device.device_config import reference_steps
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.foreign.stand_in import Report, StandIn
from gemelo.services.stepper_gateway.links.foreign.text_exchange import TextExchange
from gemelo.services.stepper_gateway.links.foreign.text_messages import AnswerReader, line_of
from gemelo.services.stepper_gateway.links.frames import BadFrame, Sync, decode
from gemelo.services.stepper_gateway.links.link import Kind

NAME = "a board that speaks <SEQ,J1,...>"
# Chosen: all RETRIES have failed, and the gateway has not yet concluded from its questions that the board is deaf.
SILENCE = 1.2  # [s] without an answer to any line, after which the board is not there
STILL_SILENT = 0.4  # [s] the same, of a board that has not answered since it was missed; chosen: five lost lines
PROBE = 1.0  # [s] between two repetitions of the newest line to a board that is not there; chosen: it is back at once
TELLING = 10.0  # [s] between two summaries of the line; chosen: the log stays readable
MOST_QUESTIONS = 8  # that wait for a line; chosen: more than the gateway asks between two


class Question(NamedTuple):
    """One for the clock, which waits for a line."""

    sync: Sync
    asked: float  # [s] when it came


class TextDevice:
    """One arm behind one line; `now` [s] is any clock that only goes forward.

    Nothing is sent until a person has said with REFERENCE where the joints stand: the board moves to whatever it reads.
    """

    def __init__(self, arm: ArmDescription, new_boot: Callable[[], int], now: float, baud: int) -> None:
        """`baud` is that of the port, for what a person is told."""
        self._arm, self._baud = arm, baud
        self._stand_in = StandIn(arm, NAME, reference_steps(arm), new_boot, now)
        self._reader, self.exchange = AnswerReader(), TextExchange()
        self._target: tuple[int, ...] | None = None  # [steps] of the newest line; None: none of this reference
        self._is_confirmed = True  # a line with this target was answered, or it is where the board stands
        self._due = self._told = self._probed = now  # [s] of the next line, the latest summary and the latest probe
        self._asked_at: float | None = None  # [s] since when lines are not answered
        self._stalled = 0.0  # [s] of the stand-in's, as far as it was taken into account
        self._is_missed = False  # it has not answered since it was missed last
        self._waiting: list[Question] = []  # for the next line
        self._carried: OrderedDict[int, list[Question]] = OrderedDict()  # by the number of the line that they wait for
        self._objection: Reason | None = None
        self._reports: list[Report] = []

    @property
    def objection(self) -> Reason | None:
        """Why the board counts as not there; None if it is."""
        return self._objection

    def receive(self, kind: Kind, payload: bytes, now: float) -> None:
        """A frame of the gateway's at `now` [s]; a question for the clock waits until the board answers a line."""
        if kind is Kind.SYNC and self._stand_in.is_referenced:
            try:
                question = decode(payload)
            except BadFrame:
                question = None
            if isinstance(question, Sync):
                self._waiting = [*self._waiting[1 - MOST_QUESTIONS :], Question(question, now)]
                return
        self._stand_in.advance(now)
        before = self._stand_in.steps
        self._stand_in.receive(kind, payload, now)
        if kind is Kind.CMD and self._stand_in.steps != before:
            self._target, self._is_confirmed = None, True  # a person has said where the board stands

    def hear(self, data: bytes, now: float) -> None:
        """Bytes of the board's, at `now` [s] monotonic."""
        for answer in self._reader.feed(data):
            is_first = self.exchange.on_answer(answer, now)
            self._asked_at, self._is_missed = None, False
            if answer.refusal and is_first:
                self._say({"event": "line_refused", "detail": f"line {answer.seq}: {answer.refusal}"}, now)
            if is_first:
                self._is_confirmed = self._is_confirmed or self.exchange.is_newest(answer.seq)
                self._answer_questions(answer.seq, now)

    def advance(self, now: float) -> list[bytes]:
        """Let time pass until `now` [s] monotonic; the lines to write then."""
        self._stand_in.advance(now)
        stalled, self._stalled = self._stand_in.stalled - self._stalled, self._stand_in.stalled
        if self._asked_at is not None:
            self._asked_at = min(now, self._asked_at + stalled)
        self._watch(now)
        if not self._stand_in.is_referenced:
            return []
        lines = self._probe(now) if self._objection else self._lines(now)
        if lines and self._asked_at is None:
            self._asked_at = now
        return lines

    def take(self) -> list[Report]:
        """What the gateway is to receive, with why a motion has ended first; nothing while the board is silent."""
        if self._objection:
            self._stand_in.discard()
            self._reports.clear()
            return []
        said, self._reports = self._reports + self._stand_in.take(self._is_settled), []
        return said

    @property
    def _is_settled(self) -> bool:
        """A line that only asks for the clock says the target again, and unsettles nothing."""
        return self._target in (None, self._stand_in.steps) and self._is_confirmed

    def _lines(self, now: float) -> list[bytes]:
        steps = self._stand_in.steps
        is_new = steps != self._target
        if now >= self._due and (is_new or (self._waiting and not self.exchange.is_waiting)):
            period = 1.0 / self._arm.device.text_hz
            self._due = self._due + period if now - self._due < period else now + period
            return [self._line(steps, now)]
        # What was sent before this reference is no longer where the board is to be.
        again = self.exchange.again(now) if self._target is not None else None
        return [again] if again is not None else []

    def _probe(self, now: float) -> list[bytes]:
        """The newest line again, from time to time: by its answer the board is there."""
        if now - self._probed < PROBE:
            return []
        self._probed = now
        return [self._line(self._stand_in.steps, now)]

    def _line(self, steps: tuple[int, ...], now: float) -> bytes:
        positions = [joint.steps.to_position(count) for joint, count in zip(self._arm.joints, steps, strict=True)]
        payload = line_of(self.exchange.next_seq, positions, self._arm.device.text_decimals)
        seq = self.exchange.sent(payload, now)
        self._is_confirmed = self._is_confirmed and self._target in (None, steps)
        self._target = steps
        if self._waiting:
            self._carried[seq], self._waiting = self._waiting, []
        while len(self._carried) > MOST_QUESTIONS:
            self._carried.popitem(last=False)
        return payload

    def _answer_questions(self, seq: int, now: float) -> None:
        """Those that line `seq` was sent with: what they waited for it is no time of the wire."""
        sent = self.exchange.sent_at(seq)
        for question in self._carried.pop(seq, []):
            self._stand_in.answer_sync(question.sync, question.asked, sent, now)

    def _watch(self, now: float) -> None:
        """Presence, and a summary now and then."""
        longest = STILL_SILENT if self._is_missed else SILENCE
        if self._asked_at is not None and now - self._asked_at > longest and not self._objection:
            self._miss(longest, now)
        elif self._objection and self._asked_at is None:
            self._objection = None
            self._stand_in.report_status()
        if now - self._told >= TELLING and self.exchange.counts.lines:
            self._told = now
            self._say({"event": "text_link", "detail": self.exchange.summary()}, now)

    def _miss(self, silence: float, now: float) -> None:
        """The board is silent: at rest it counts as not there until it answers, and a motion is lost."""
        self._is_missed = True
        if not self._stand_in.is_moving and self._is_settled:
            self._objection, self._probed = because("link.board_silent", time=silence, baud=self._baud), now
            return
        self._stand_in.start(self._stand_in.steps, False, now)
        self._target, self._is_confirmed, self._asked_at = None, True, None
        self._waiting.clear()
        self._carried.clear()
        lost = because("position.board_silent", time=silence, baud=self._baud)
        self._say({"event": "position_lost", "detail": str(lost), "why": lost}, now)

    def _say(self, event: dict[str, object], now: float) -> None:
        report = {**event, "t_us": self._stand_in.device_us(now)}
        self._reports.append((Kind.EVENT, msgspec.json.encode(report)))
