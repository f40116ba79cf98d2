"""The demonstration's figures, from recorded messages."""

import msgspec
import pytest

from gemelo.schemas.device import CommandAck, CommandChunk, DeviceMode, DeviceState
from gemelo.schemas.joints import StepErrors
from gemelo.schemas.plain_text import ENGLISH
from gemelo.schemas.reasons import because, plain
from gemelo.tools.cli.common.language import choose
from gemelo.tools.demo.ledger import StepTotals, nearest_step
from gemelo.tools.demo.report import FOLLOWING_LIMIT, DemoReport, Move, complaints, report_of, text_of

NAMES = ("brazo_joint", "efector_joint")


def chunk(stream: int, seq: int, *last: int) -> CommandChunk:
    return CommandChunk(stream=stream, seq=seq, name=NAMES, dt=0.02, time=0.04 * seq, steps=((0, 0), last))


def at_rest(stream: int, *steps: int, mode: DeviceMode = DeviceMode.IDLE, velocity: float = 0.0, played: float = 9.0):
    return DeviceState(stream=stream, name=NAMES, steps=steps, mode=mode, velocity=(velocity, 0.0), play_time=played)


def a_good_run() -> StepTotals:
    ledger = StepTotals()
    ledger.on_chunk(chunk(7, 0, 128, 0))
    ledger.on_chunk(chunk(7, 1, 25_700, -200))
    for seq in (0, 1):
        ledger.on_ack(CommandAck(stream=7, seq=seq, round_trip=0.004))
    ledger.on_errors(StepErrors(name=NAMES, error=(-0.25, 0.1), max_error=(0.4, 0.2)))
    ledger.on_state(at_rest(7, 100, -1))
    return ledger


MOVES = [
    Move(name=plain("sine"), succeeded=True, took_s=10.0),
    Move(name=plain("home"), succeeded=True, plan_ms=1.5, took_s=2.0, final_error_steps=0.39),
]


def test_a_good_run_has_no_complaints():
    ledger = a_good_run()
    report = report_of("rm1", MOVES, ledger)
    assert complaints(report, ledger) == []
    assert (report.lost_steps, report.chunks_sent, report.chunks_lost) == (0, 2, 0)
    assert report.max_following_error_steps == 0.4
    assert report.max_final_error_steps == 0.39
    assert report.joints["brazo_joint"].commanded_steps == report.joints["brazo_joint"].executed_steps == 100


def test_the_json_is_what_the_issue_says():
    report = msgspec.to_builtins(report_of("rm1", MOVES, a_good_run()))
    assert list(report) == [
        "robot", "moves", "succeeded", "max_following_error_steps", "max_final_error_steps", "lost_steps",
        "chunks_sent", "chunks_lost", "plan_ms", "joints",
    ]  # fmt: skip
    assert report["plan_ms"] == {"p50": 1.5, "p99": 1.5}
    assert set(report["joints"]["efector_joint"]) == {
        "commanded_steps", "executed_steps", "max_following_error_steps",
    }  # fmt: skip


def test_a_step_that_the_device_did_not_make_is_lost():
    ledger = a_good_run()
    ledger.on_state(at_rest(7, 99, -1))
    assert ledger.lost_steps == 1
    assert "1 steps lost" in map(str, complaints(report_of("rm1", MOVES, ledger), ledger))


def test_steps_are_counted_only_at_rest():
    ledger = StepTotals()
    ledger.on_chunk(chunk(7, 0, 25_600, 0))
    ledger.on_state(at_rest(7, 50, 0, mode=DeviceMode.RUN, velocity=100.0))
    assert not ledger.is_settled
    assert any("not seen at rest" in str(each) for each in complaints(report_of("rm1", MOVES, ledger), ledger))


def test_a_stream_that_was_stopped_on_its_way_has_not_lost_steps():
    ledger = a_good_run()
    ledger.on_chunk(chunk(8, 0, 99_000, 0))
    ledger.on_state(at_rest(8, 120, -1, played=0.01))
    assert ledger.lost_steps == 0
    assert not ledger.is_settled


def test_a_chunk_that_is_sent_again_does_not_move_the_end_back():
    ledger = a_good_run()
    ledger.on_chunk(chunk(7, 0, 128, 0))
    ledger.on_state(at_rest(7, 100, -1))
    assert ledger.commanded["brazo_joint"] == 100
    assert ledger.lost_steps == 0


def test_a_loss_in_an_earlier_stream_is_not_forgotten():
    ledger = a_good_run()
    ledger.on_state(at_rest(7, 97, -1))
    ledger.on_chunk(chunk(8, 0, 97 * 256, -256))
    ledger.on_state(at_rest(8, 97, -1))
    assert ledger.lost_steps == 3


def test_a_chunk_that_was_only_refused_is_lost():
    ledger = a_good_run()
    ledger.on_chunk(chunk(7, 2, 25_700, -200))
    ledger.on_ack(CommandAck(stream=7, seq=2, code=5))
    assert (ledger.chunks_sent, ledger.chunks_lost) == (3, 1)


def test_a_chunk_sent_twice_is_one_chunk():
    ledger = a_good_run()
    ledger.on_chunk(chunk(7, 1, 25_700, -200))
    ledger.on_ack(CommandAck(stream=7, seq=1, code=1))
    assert (ledger.chunks_sent, ledger.chunks_lost) == (2, 0)


def test_an_error_between_two_messages_counts_too():
    ledger = a_good_run()
    ledger.on_errors(StepErrors(name=NAMES, error=(0.0, 0.0), max_error=(0.9, 0.0)))
    report = report_of("rm1", MOVES, ledger)
    assert report.max_following_error_steps == 0.9 > FOLLOWING_LIMIT
    assert any("following error" in str(each) for each in complaints(report, ledger))


def test_silence_is_not_success():
    ledger = StepTotals()
    report = report_of("rm1", [], ledger)
    assert isinstance(report, DemoReport)
    assert complaints(report, ledger)


def test_a_failed_move_stands_in_the_table_with_its_reason():
    moves = [*MOVES, Move(name=plain("tool 1"), succeeded=False, why=plain("out of reach"))]
    report = report_of("rm1", moves, a_good_run())
    text = text_of(report, moves)
    assert "failed: out of reach" in text
    assert "[ms]" in text
    assert "[steps]" in text


@pytest.mark.parametrize(("position", "step"), [(0, 0), (127, 0), (128, 1), (-128, 0), (-129, -1), (25_700, 100)])
def test_the_nearest_step_is_rounded_as_the_firmware_rounds(position, step):
    assert nearest_step(position) == step


def replacing(seq: int, time: float, last: int) -> CommandChunk:
    steps = ((0, 0), (last // 2, 0), (last, 0))
    return CommandChunk(
        stream=7, seq=seq, name=NAMES, dt=0.01, time=time, steps=steps, replaces=True, tail=1, tail_dt=0.03
    )


def test_a_replacement_that_was_taken_moves_the_end_also_to_an_earlier_time():
    ledger = StepTotals()
    for seq, time, last in ((0, 0.0, 256), (1, 0.5, 5120), (2, 0.01, 25_600)):
        ledger.on_chunk(replacing(seq, time, last))
        ledger.on_ack(CommandAck(stream=7, seq=seq))
    ledger.on_chunk(replacing(3, 0.02, 99_999))
    ledger.on_ack(CommandAck(stream=7, seq=3, code=22))
    assert ledger.commanded["brazo_joint"] == 100
    ledger.on_state(at_rest(7, 100, 0, played=0.05))
    assert ledger.is_settled
    assert ledger.lost_steps == 0


def test_a_replacement_is_lost_only_where_no_later_one_was_taken():
    ledger = StepTotals()
    for seq in range(4):
        ledger.on_chunk(replacing(seq, 0.01 * seq, 256))
    ledger.on_ack(CommandAck(stream=7, seq=0))
    assert ledger.chunks_lost == 3
    ledger.on_ack(CommandAck(stream=7, seq=2))
    assert ledger.chunks_lost == 1


def test_figures_and_failures_are_spanish_in_a_spanish_terminal():
    ledger = a_good_run()
    moves = [*MOVES, Move(name=because("demo.tour.tool", number=1), succeeded=False, why=because("demo.lost", steps=2))]
    choose("es")
    try:
        text = text_of(report_of("rm1", moves, ledger), moves)
    finally:
        choose(ENGLISH)
    assert "herramienta 1" in text
    assert "falló: 2 pasos perdidos" in text
    assert "mayor error de seguimiento [pasos]" in text
    assert text.splitlines()[-1].startswith("2 de 3 movimientos con éxito; 0 pasos perdidos; ")
