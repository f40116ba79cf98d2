"""The record of a virtual board has its counters at the end of every slot with a step, however its time passes."""

from __future__ import annotations

from bench_firmware import Bench, heartbeat, rm1_config

from gemelo.firmware.platform.host.slot_record import SLOT, STOOD, SlotRecord
from gemelo.tools.chaos.slots import SlotFile, steps_in, violations

GOAL = (900, -40, 25)
END = 2_500_000  # [us] when it rests
PIECE = 7300  # [us] no multiple of a slot


def moving_bench() -> Bench:
    bench = Bench(rm1_config())
    bench.run(100)
    assert bench.move(GOAL, 2.0) == 0
    return bench


def test_a_record_has_every_slot_with_a_step(tmp_path):
    file = SlotFile(tmp_path / "slots")
    assert len(file.rows()) == 0  # no board has written yet
    other, bench = moving_bench(), moving_bench()
    expected, last = [], ()
    while other.device.now_us < END:
        other.device.receive(heartbeat(other.device.now_us // SLOT + 10))
        other.device.advance((other.device.now_us // SLOT + 1) * SLOT)
        if other.device.steps != last:
            last = other.device.steps
            expected.append((other.device.now_us, *last))
    record = SlotRecord(str(file.path))
    while bench.device.now_us < END:
        bench.device.receive(heartbeat(bench.device.now_us // SLOT + 10))
        record.advance(bench.device, min(bench.device.now_us + PIECE, END))
    rows = file.rows()
    assert [(int(each["time"]), *map(int, each["steps"][:3])) for each in rows][1:] == expected[1:]
    assert last == GOAL
    assert steps_in(rows) > 300
    assert violations(rm1_config(), rows) == []


def test_a_stand_of_the_operating_system_is_recorded_and_what_was_read_is_forgotten(tmp_path):
    file, bench = SlotFile(tmp_path / "slots"), moving_bench()
    record = SlotRecord(str(file.path))
    record.advance(bench.device, bench.device.now_us + 200_000)
    record.stand_still(bench.device, bench.device.now_us // SLOT * SLOT + 300_000)
    assert file.rows()[-1]["boot"] == STOOD
    assert len(file.rows(file.size)) == 0
    file.forget()
    assert len(file.rows()) == 0
    rebooted = moving_bench().device
    record.advance(rebooted, rebooted.now_us + 400_000)
    assert steps_in(file.rows()) > 10
