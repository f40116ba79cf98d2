"""Dialect "text": the gateway drives a board that speaks `<SEQ,J1,...>` over a real pseudo-terminal."""

from __future__ import annotations

import termios
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import ArmDescription, as_its_board_drives_it, load_arm
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.deployment import Deployment, SerialSection
from gemelo.schemas.device import DeviceCommandKind
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.links.foreign.text_exchange import RETRIES, TextExchange
from gemelo.services.stepper_gateway.links.foreign.text_link import TextLink
from gemelo.services.stepper_gateway.links.foreign.text_messages import AnswerReader, LineAnswer, line_of, read_answer
from gemelo.services.stepper_gateway.main import baud_of, open_device
from gemelo.tools.virtual_arm.virtual_arm import rm1
from tests.profiles import examples
from tests.stepper_gateway.dialects import robot_with
from tests.stepper_gateway.processes import DEVICE, Processes
from tests.stepper_gateway.pty_board import PtyBoard
from tests.stepper_gateway.wired import WiredGateway

END = (0.1, -0.2, 0.01)


def text_arm() -> ArmDescription:
    arm = rm1()
    return as_its_board_drives_it(replace(arm, device=msgspec.structs.replace(arm.device, dialect=Dialect.TEXT)))


@contextmanager
def wired(board: PtyBoard, baud: int = 115_200) -> Iterator[tuple[WiredGateway, TextLink]]:
    links: list[TextLink] = []

    def link(wake: Callable[[], None]) -> TextLink:
        links.append(TextLink(board.path, baud, text_arm(), wake))
        return links[0]

    with closing(board), closing(WiredGateway(0, link, text_arm())) as gateway:
        assert gateway.run(5.0, lambda: bool(gateway.published["device/state"]))
        yield gateway, links[0]


def reference(gateway: WiredGateway) -> None:
    assert gateway.run(10.0, lambda: not gateway.core.device.unreachable_reason(gateway.moment))
    gateway.command(DeviceCommandKind.REFERENCE)
    gateway.ready()


@pytest.mark.parametrize("baud", [115_200, 57_600, 921_600])
def test_a_move_arrives_at_the_board_and_every_line_is_acknowledged(baud: int) -> None:
    board = PtyBoard()
    with wired(board, baud) as (gateway, link):
        assert gateway.run(30.0, lambda: board.speed == getattr(termios, f"B{baud}")), (
            "the first state is before the port"
        )
        assert link.device.exchange.counts.lines == 0, "nothing is sent before a person says where the joints are"
        reference(gateway)
        assert gateway.move_to(END).accepted
        status, result = gateway.finish()
        assert (status, result.verified) == (GoalStatusCode.SUCCEEDED, False)
        counts = link.device.exchange.counts
        assert counts.acknowledged == counts.lines - (1 if link.device.exchange.is_waiting else 0)
        assert (counts.lost, counts.doubled, counts.late, counts.strange) == (0, 0, 0, 0)
        assert 0.0 < link.device.exchange.median < 0.25
        assert gateway.state.round_trip > 0.0


def test_the_board_is_told_the_commanded_steps_to_less_than_a_step() -> None:
    board = PtyBoard()
    with wired(board) as (gateway, link):
        reference(gateway)
        assert gateway.move_to(END).accepted
        gateway.finish()
        assert gateway.run(10.0, lambda: not link.device.exchange.is_waiting), "its last line has no answer"
        for joint, said, counted in zip(gateway.arm.joints, board.position, gateway.state.steps, strict=True):
            assert abs(joint.steps.to_steps(said) - counted) < 0.1


def test_lost_doubled_and_late_answers_are_counted_and_lost_ones_repeated() -> None:
    seen: Counter[int] = Counter()

    def answering(seq: int, answer: bytes) -> list[bytes]:
        seen[seq] += 1
        if seq % 5 == 0 and seen[seq] == 1:
            return []
        if seq % 7 == 0:
            return [answer, answer]
        return [b"boot: noise <", answer] if seq % 11 == 0 else [answer]

    with wired(PtyBoard(answering)) as (gateway, link):
        reference(gateway)
        assert gateway.move_to(END).accepted
        assert gateway.finish()[0] is GoalStatusCode.SUCCEEDED
        counts = link.device.exchange.counts
        assert counts.doubled > 0
        assert counts.lost + counts.retries > 0
        assert "doubled" in link.device.exchange.summary()


def test_a_board_that_falls_silent_in_a_move_ends_it_and_its_position_is_lost() -> None:
    board = PtyBoard()
    with wired(board) as (gateway, _):
        reference(gateway)
        assert gateway.move_to((1.0, -1.0, 0.1)).accepted
        gateway.run(1.0)
        board.answering = lambda _seq, _answer: []
        assert gateway.finish(seconds=15.0)[0] is GoalStatusCode.ABORTED
        assert gateway.run(3.0, lambda: "position_lost" in gateway.events())
        lines = len(board.lines)
        gateway.run(1.0)
        assert len(board.lines) == lines, "nothing is sent to a board that is not known to stand where it should"
        assert "gemelo reference" in gateway.move_to(END, "next").reason


def test_our_own_board_is_driven_by_its_text_mode_too(tmp_path: Path) -> None:
    robot = robot_with(tmp_path, 'dialect = "text"')
    arm = load_arm(robot)
    with closing(Processes("mosquitto", tmp_path, robot=robot)) as processes:
        processes.start(DEVICE)
        deployment = processes.deployment
        with closing(WiredGateway(0, lambda wake: open_device(deployment, arm, wake), arm)) as gateway:
            assert gateway.run(10.0, lambda: bool(gateway.published["device/state"]))
            reference(gateway)
            assert gateway.move_to(END).accepted
            assert gateway.finish()[0] is GoalStatusCode.SUCCEEDED
            assert gateway.state.round_trip > 0.0


def test_the_baud_rate_is_the_deployments_or_else_that_of_robot_toml(tmp_path: Path) -> None:
    arm = load_arm(robot_with(tmp_path, "serial_baud = 115_200"))
    assert baud_of(Deployment(), arm) == 115_200
    assert baud_of(Deployment(serial=SerialSection(baud=57_600)), arm) == 57_600
    assert baud_of(Deployment(), rm1()) == 921_600


def test_a_port_that_is_not_there_is_named() -> None:
    with closing(WiredGateway(0, lambda wake: TextLink("/dev/ttyNONE", 115_200, text_arm(), wake), text_arm())) as one:
        one.run(0.5)
        assert "/dev/ttyNONE" in one.reason_not_ready


def exchange_of(count: int) -> TextExchange:
    exchange = TextExchange()
    for index in range(count):
        exchange.sent(b"x", index * 0.04)
    return exchange


def test_an_answer_to_a_line_that_counts_as_lost_is_late() -> None:
    exchange = exchange_of(2)
    exchange.again(1.0)
    assert exchange.counts.lost == 1
    assert exchange.on_answer(LineAnswer(1, 5), 1.1)
    assert (exchange.counts.late, exchange.counts.doubled) == (1, 0)
    assert not exchange.on_answer(LineAnswer(1, 5), 1.2)
    assert exchange.counts.doubled == 1
    exchange.on_answer(LineAnswer(77, 5), 1.2)
    assert exchange.counts.strange == 1


def test_only_the_newest_line_is_repeated_and_not_for_ever() -> None:
    exchange, now, again = TextExchange(), 0.0, []
    exchange.sent(b"old", now)
    exchange.sent(b"new", now)
    for _ in range(100):
        now += 0.1
        again.append(exchange.again(now))
    assert [line for line in again if line] == [b"new"] * RETRIES
    assert exchange.counts.lost == 2


def test_numbers_wrap_at_32_bits_and_time_stamps_do_too() -> None:
    exchange = TextExchange(first_seq=(1 << 32) - 1)
    assert exchange.sent(b"a", 0.0) == (1 << 32) - 1
    assert exchange.sent(b"b", 0.0) == 0
    exchange.on_answer(LineAnswer((1 << 32) - 1, (1 << 32) - 10), 0.1)
    exchange.on_answer(LineAnswer(0, 5), 0.1)
    assert exchange.counts.backwards == 0
    exchange.sent(b"c", 0.2)
    exchange.on_answer(LineAnswer(1, 2), 0.3)
    assert exchange.counts.backwards == 1, "the board has started anew"


@given(st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=8), st.integers(0, (1 << 32) - 1))
def test_a_line_says_its_positions_to_the_last_decimal(positions: list[float], seq: int) -> None:
    line = line_of(seq, positions, 6)
    head, *numbers = line.decode().strip("<>\n").split(",")
    assert int(head) == seq
    assert all(abs(float(a) - b) <= 0.5e-6 + 1e-12 for a, b in zip(numbers, positions, strict=True))


@examples(quick=25)
@given(st.lists(st.binary(max_size=40) | st.just(b"<ACK,7,12>"), max_size=8))
def test_any_bytes_are_answers_or_counted_and_take_no_memory(pieces: list[bytes]) -> None:
    reader = AnswerReader()
    for piece in pieces:
        for answer in reader.feed(piece):
            assert 0 <= answer.seq < 1 << 32
    assert len(reader.rest) <= 64
    reader.feed(b">")
    assert reader.feed(b"<ACK,9,1>\n") == [LineAnswer(9, 1)], "what came before does not spoil what follows"


def test_what_comes_between_the_answers_is_counted_and_they_are_not() -> None:
    reader = AnswerReader()
    assert reader.feed(b"<ACK,7,12>\n<ACK,8,13>\n") == [LineAnswer(7, 12), LineAnswer(8, 13)]
    assert reader.bad == 0
    reader.feed(b"<AC,9,14>\n<ACK,9,14>\n")
    assert reader.bad == 1


@pytest.mark.parametrize(
    "frame", [b"<ACK,1>", b"<ACK,,5>", b"<ACK,4294967296,5>", b"<ACK,1,-5>", b"<ack,1,5>", b"<ACK,1,5,6>", b"<>"]
)
def test_what_is_no_answer_is_none(frame: bytes) -> None:
    assert read_answer(frame) is None
