"""One row per knot, joined with its acknowledgement."""

import struct

import msgspec
import pytest

from gemelo.schemas.device import CommandAck
from gemelo.services.logger.command_log import ACK_TIMEOUT, CommandLog, header

START = 1_795_000_000_000_000_000
JOINTS = ("brazo_joint", "antebrazo_joint", "efector_joint")


def table(rows):
    return [dict(zip(header(JOINTS), line.cells, strict=True)) for line in rows]


def test_the_seeds_columns_come_first():
    columns = header(("brazo_joint",))
    assert columns[:7] == (
        "seq", "timestamp_pc_us", "timestamp_pc_iso", "brazo_joint_pos", "brazo_joint_vel", "brazo_joint_acc",
        "command_sent",
    )  # fmt: skip
    assert columns[7:] == (
        "stream", "knot", "stream_time_s", "ack_timestamp_us", "ack_code", "round_trip_ms", "brazo_joint_executed_steps"
    )  # fmt: skip


def test_a_row_per_knot_is_written_when_its_acknowledgement_arrives(chunk, ack):
    log = CommandLog()
    log.on_chunk(chunk(0), START)
    assert log.step(START) == []
    log.on_ack(ack(0))
    rows = table(log.step(START))
    assert [row["knot"] for row in rows] == ["0", "1", "2", "3", "4"]
    assert rows[2]["timestamp_pc_us"] == str(START // 1000)
    assert rows[2]["timestamp_pc_iso"] == "2026-11-18T11:06:40.000000Z"
    assert rows[2]["ack_timestamp_us"] == str((START + 3_250_000) // 1000)
    assert rows[2]["round_trip_ms"] == "3.250"
    assert rows[2]["ack_code"] == "0"
    assert float(rows[2]["antebrazo_joint_pos"]) == (256 * 2 + 1) / 1000
    assert float(rows[2]["stream_time_s"]) == 0.04
    assert rows[2]["brazo_joint_executed_steps"] == "0"


def test_command_sent_is_the_knots_words_as_on_the_wire(chunk, ack):
    log = CommandLog()
    sent = chunk(3)
    log.on_chunk(sent, START)
    log.on_ack(ack(3))
    row = table(log.step(START))[1]
    assert struct.unpack("<6i", bytes.fromhex(row["command_sent"])) == sent.steps[1] + sent.step_rate[1]


def test_an_unanswered_chunk_is_lost_after_two_seconds(chunk):
    log = CommandLog()
    log.on_chunk(chunk(0), START)
    assert log.step(START + ACK_TIMEOUT - 1) == []
    rows = table(log.step(START + ACK_TIMEOUT))
    assert {row["ack_code"] for row in rows} == {"lost"}
    assert log.lost == 1
    assert log.pending == 0


def test_a_refusal_and_the_same_chunk_sent_again_are_two_sets_of_rows(chunk, ack):
    log = CommandLog()
    log.on_chunk(chunk(1), START)
    log.on_ack(ack(1, code=2))
    log.on_chunk(chunk(1), START)
    log.on_ack(ack(1))
    assert [row["ack_code"] for row in table(log.step(START))] == ["2"] * 5 + ["0"] * 5


def test_a_chunk_sent_again_before_any_answer_is_marked(chunk, ack):
    log = CommandLog()
    log.on_chunk(chunk(1), START)
    log.on_chunk(chunk(1), START)
    log.on_ack(ack(1))
    assert [row["ack_code"] for row in table(log.step(START))] == ["resent"] * 5 + ["0"] * 5


def test_gaps_in_the_sequence_are_counted(chunk):
    log = CommandLog()
    for seq in (4, 5, 8, 8, 9):
        log.on_chunk(chunk(seq), START)
    log.on_chunk(chunk(1, stream=8), START)
    assert log.missing == 2 + 1


def test_a_logger_that_starts_in_the_middle_of_a_stream_misses_nothing(chunk):
    log = CommandLog()
    log.on_chunk(chunk(40), START)
    assert log.missing == 0


def test_an_answer_to_nothing_is_ignored_and_the_rest_is_unanswered_at_the_end(chunk):
    log = CommandLog()
    log.on_ack(CommandAck(stream=1, seq=1))
    log.on_chunk(chunk(0), START)
    assert {row["ack_code"] for row in table(log.finish(START))} == {"unanswered"}
    assert log.finish(START) == []


@pytest.mark.parametrize(
    "odd",
    [
        {"steps": ((1, 2), (3,))}, {"position": ((0.0,),)}, {"steps": ((2**31, 0, 0),) * 5}, {"step_rate": ((0,),) * 5},
        {"name": ("a",)},
    ],
)  # fmt: skip
def test_a_chunk_whose_tables_do_not_fit_together_is_counted_and_left_out(chunk, ack, odd):
    log = CommandLog()
    log.on_chunk(msgspec.structs.replace(chunk(0), **odd), START)
    log.on_ack(ack(0))
    assert log.step(START + 2 * ACK_TIMEOUT) == []
    assert log.malformed == 1


def test_a_chunk_without_velocities_leaves_their_columns_empty(chunk, ack):
    log = CommandLog()
    log.on_chunk(msgspec.structs.replace(chunk(0), velocity=(), step_rate=()), START)
    log.on_ack(msgspec.structs.replace(ack(0), steps=()))
    row = table(log.step(START))[0]
    assert (row["brazo_joint_vel"], row["brazo_joint_acc"], row["brazo_joint_executed_steps"]) == ("", "0", "")
    assert len(bytes.fromhex(row["command_sent"])) == 12


def test_an_acknowledgement_that_comes_before_its_chunk_waits_for_it(chunk, ack):
    log = CommandLog()
    log.on_ack(ack(0))
    log.on_chunk(chunk(0), START)
    assert {row["ack_code"] for row in table(log.step(START))} == {"0"}
    assert log.pending == 0


def test_an_old_acknowledgement_does_not_answer_a_chunk_sent_after_it(chunk, ack):
    log = CommandLog()
    log.on_ack(msgspec.structs.replace(ack(0, code=2), stamp=START - 1))
    log.on_chunk(chunk(0), START)
    log.on_ack(ack(0))
    assert {row["ack_code"] for row in table(log.step(START))} == {"0"}


def replacing(chunk, seq, time):
    """Five knots from `time` [s] on: two follow by 20 ms, two brake by 30 ms."""
    return msgspec.structs.replace(chunk(seq), time=time, replaces=True, tail=2, tail_dt=0.03)


def test_of_chunks_that_replace_one_another_the_knots_that_were_left_are_written(chunk, ack):
    log = CommandLog()
    for seq, time in ((0, 0.0), (1, 0.02), (2, 0.04)):
        log.on_chunk(replacing(chunk, seq, time), START)
        log.on_ack(ack(seq))
    log.on_chunk(replacing(chunk, 3, 0.06), START)
    log.on_ack(ack(3, code=22))  # late: nothing of it is played
    rows = table(log.finish(START))
    taken = [(row["seq"], row["knot"], row["stream_time_s"]) for row in rows if row["ack_code"] == "0"]
    assert taken == [
        ("0", "0", "0.000000"), ("0", "1", "0.020000"), ("1", "1", "0.040000"), ("2", "1", "0.060000"),
        ("2", "2", "0.080000"), ("2", "3", "0.110000"), ("2", "4", "0.140000"),
    ]  # fmt: skip
    assert len([row for row in rows if row["ack_code"] == "22"]) == 5
