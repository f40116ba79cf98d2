"""The log of the core's inputs: whole from the beginning, a gap where it was off, and the input that ends a core."""

from __future__ import annotations

import zlib

import pytest

from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.input_log import HELD_BACK, PERIOD, InputLog
from gemelo.services.stepper_gateway.inputs import (
    BeganInput,
    LinkInput,
    SceneInput,
    StepInput,
    digest_of,
    unpacked,
)
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.outputs import SendFrame
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.virtual_arm import rm1

BEGAN = BeganInput(7, GatewayParameters())


class Log:
    """A core with its log, and a clock."""

    def __init__(self) -> None:
        self.said = []
        self.now = 0.0
        self.core = GatewayCore(rm1(), BEGAN.session, BEGAN.parameters)
        self.log = InputLog(self.core, BEGAN, self.moment, self.said.append)

    @property
    def moment(self) -> Moment:
        return Moment(1_700_000_000_000_000_000 + round(self.now * 1e9), 1000.0 + self.now)

    def run(self, seconds: float, is_on: bool = True) -> None:
        for _ in range(round(seconds / 0.02)):
            self.now += 0.02
            self.log.handle(StepInput(), self.moment)
            self.log.step(self.moment, is_on)

    @property
    def inputs(self):
        return [given for message in self.said for given in unpacked(message.inputs)]


def test_nothing_is_said_until_a_recorder_has_had_time_and_then_all_from_the_beginning():
    log = Log()
    log.run(HELD_BACK - 0.1)
    assert log.said == []
    log.run(0.2)
    assert [message.number for message in log.said] == list(range(len(log.said)))
    assert log.inputs[0].input == BEGAN
    assert {message.session for message in log.said} == {7}


def test_afterwards_it_speaks_twice_a_second():
    log = Log()
    log.run(HELD_BACK + 0.1)
    before = len(log.said)
    log.run(10 * PERIOD)
    assert len(log.said) - before == pytest.approx(10, abs=1)


def test_the_end_is_said_too():
    log = Log()
    log.run(0.3)
    log.log.finish()
    assert len(log.inputs) == 1 + 15


def test_each_input_has_its_moment_and_gives_the_same_again():
    log = Log()
    log.log.handle(LinkInput(True, ""), log.moment)
    log.run(2.0)
    log.log.handle(SceneInput(3, 4), log.moment)
    log.log.finish()
    again = GatewayCore(rm1(), BEGAN.session, BEGAN.parameters)
    others = GatewayCore(rm1(), BEGAN.session, BEGAN.parameters)
    for given in log.inputs[1:]:
        assert again.handle(given.input, given.moment) == others.handle(given.input, given.moment)
    assert [given.moment.monotonic for given in log.inputs] == sorted(given.moment.monotonic for given in log.inputs)


def test_the_digest_of_a_frame_that_ends_with_its_own_crc_tells_its_content():
    frames = [payload[:-4] + zlib.crc32(payload[:-4]).to_bytes(4, "little") for payload in (bytes(12), bytes([1] * 12))]
    first, second = (digest_of(None, [SendFrame(Kind.TRAJ, frame)]) for frame in frames)
    assert first != second
    assert digest_of(None, []) == 0


def test_what_was_given_while_it_was_off_is_a_gap_in_the_numbers():
    log = Log()
    log.run(HELD_BACK + 1.0)
    log.run(2.0, is_on=False)
    said = len(log.said)
    log.run(2.0)
    numbers = [message.number for message in log.said]
    assert numbers[said] == numbers[said - 1] + 2


def test_the_input_that_ends_the_core_is_said_before_its_error(monkeypatch):
    log = Log()
    log.run(0.1)

    def broken(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(log.core, "handle", broken)
    with pytest.raises(ZeroDivisionError):
        log.log.handle(LinkInput(False, "gone"), log.moment)
    assert log.inputs[-1].input == LinkInput(False, "gone")
