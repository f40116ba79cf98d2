"""Messages that a stranger on an open broker has recorded and sends again, or lets the broker retain, move nothing."""

from __future__ import annotations

import struct

from bed_firmware import Bed, wait_for
from bench_firmware import command

from gemelo.schemas.device import DeviceCommandKind, InjectKind
from gemelo.services.stepper_gateway.links.frames import Code

WAY = 200  # [steps]


def place(bed: Bed) -> int:
    """[steps] of q1 in the next state."""
    bed.heard.pop("state", None)
    return int(struct.unpack("<i", bed.answer("state")[60:64])[0])


def said_again(bed: Bed, frame: bytes) -> int:
    """The code of its acknowledgement."""
    bed.publish("traj", frame)
    return bed.answer("traj/ack")[20]


def to_and_fro(bed: Bed, stream: int) -> bytes:
    """Moves there and back again with two streams; the frame of the way there."""
    there = bed.chunk(WAY, 0.5, stream=stream)
    for goal, start in ((WAY, 0), (0, WAY)):
        assert bed.move(goal, 0.5, start, stream)[20] == Code.OK
        bed.event("finished")
        assert place(bed) == goal
        stream += 1
    return there


def test_a_chunk_of_the_same_boot_that_is_said_again_moves_nothing_though_a_new_one_would(bed: Bed):
    bed.start_device()
    with bed.beating():
        there = to_and_fro(bed, stream=1)  # the arm stands again where that chunk begins
        back = bed.chunk(0, 0.5, start=WAY, stream=2)
        assert said_again(bed, there) == Code.WRONG_STREAM
        assert said_again(bed, back) == Code.DUPLICATE
        assert place(bed) == 0
        # Where the lock is open: who makes one of his own moves the arm. `gemelo broker secure` is the lock.
        to_and_fro(bed, stream=3)
        assert said_again(bed, there) == Code.WRONG_STREAM
        assert place(bed) == 0


def go_offline(bed: Bed) -> None:
    """The device leaves for a moment and comes back with the same boot: what is published now is retained to it."""
    bed.press(InjectKind.OFFLINE, value=2.0)
    wait_for(lambda: bed.status["online"] is False, "its last will")


def test_a_chunk_that_the_broker_has_kept_is_refused_by_the_boot_that_it_was_meant_for(bed: Bed):
    bed.start_device()
    with bed.beating():
        to_and_fro(bed, stream=1)
        fresh = bed.chunk(WAY, 0.5, stream=3)
        go_offline(bed)
        bed.publish("traj", fresh, retain=True)
        assert bed.answer("traj/ack")[20] == Code.RETAINED
        assert place(bed) == 0
        bed.publish("traj", b"", retain=True)
        bed.order(DeviceCommandKind.STOP)  # it holds, as it has heard no heartbeat meanwhile
        assert said_again(bed, fresh) == Code.OK, "the same, said by somebody who is there"
        bed.event("finished")
        assert place(bed) == WAY


def test_a_command_that_the_broker_has_kept_is_refused_and_a_fresh_one_carried_out(bed: Bed):
    bed.start_device()
    with bed.beating():
        boot = bed.status["boot_id"]
        assert isinstance(boot, int)
        frame = command(DeviceCommandKind.DISARM, 900, boot=boot)
        go_offline(bed)
        bed.publish("cmd", frame, retain=True)
        assert bed.answer("cmd/ack")[13] == Code.RETAINED
        bed.publish("cmd", b"", retain=True)
        bed.publish("cmd", frame)
        assert bed.answer("cmd/ack")[13] == Code.OK
        assert bed.event("disarmed")["detail"] == "command"
