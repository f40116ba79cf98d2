"""The virtual ESP32's whole process stands still for a while: what it has missed is not caught up."""

from __future__ import annotations

import signal
import struct
import time

from bed_firmware import Bed, wait_for

HOLD = 5
FROZEN = 2.9  # [s]
FASTEST = 4666  # [steps/s] of any joint


def steps_of(state: bytes) -> int:
    return int(struct.unpack("<i", state[60:64])[0])


def test_a_process_that_was_stopped_in_a_move_holds_and_plays_nothing_in_fast_forward(bed: Bed) -> None:
    bed.start_device()
    with bed.beating():
        assert bed.move(4000, 2.5)[20] == 0
        wait_for(lambda: bool(bed.states) and steps_of(bed.states[-1][1]) > 500, "the move")
        assert bed.process is not None
        bed.process.send_signal(signal.SIGSTOP)
        time.sleep(FROZEN)  # the fault itself; the heartbeats wait in the socket
        before, count = steps_of(bed.states[-1][1]), len(bed.states)
        bed.process.send_signal(signal.SIGCONT)
        wait_for(lambda: any(state[16] == HOLD for _, state in bed.states[count:]), "the hold")
        awake = next(state for _, state in bed.states[count:] if state[16] == HOLD)
        # What it had made but not said when it was stopped, and no more than two slots of what came after.
        assert steps_of(awake) - before <= FASTEST * 0.025
        wait_for(lambda: len(bed.states) >= count + 50, "a second of states")
    assert steps_of(bed.states[-1][1]) - steps_of(awake) <= 2 * FASTEST / 1000 + 1
    assert str(bed.event("late")["detail"]).endswith(" ms")
    assert bed.event("hold")["detail"] == "heartbeat"
