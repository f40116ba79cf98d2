"""The judge of every slot: the counters that a virtual device has recorded, held against the limits of its joints."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gemelo.firmware.platform.host.slot_record import JOINTS, ROW, SLOT, STOOD
from gemelo.schemas.device_config import DeviceConfig, JointConfig
from gemelo.schemas.reasons import Reason, because

ROWS = np.dtype([("time", "<i8"), ("boot", "<u8"), ("steps", "<i4", (JOINTS,))])
SPANS = (1, 2, 5, 10, 20, 40, 80)  # slots over which velocity and acceleration are taken
SECOND = 1e6 / SLOT  # [slots]
Q8 = 256
# firmware/core/ceiling.h: while it is slowed or resumed on its path, a joint may accelerate beyond its limit by that.
MARGIN = 1.0 / 16.0
Rows = NDArray[np.void]  # of ROWS
Counts = NDArray[np.int64]  # [steps] at the end of every slot


class SlotFile:
    """The file that a virtual device appends to."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def forget(self) -> None:
        """Leaves out what has been written so far; the device appends to the rest."""
        if self.path.exists():
            os.truncate(self.path, 0)

    def keep_as(self, path: Path) -> None:
        """Copies what has been written so far, for who looks into a violation."""
        if self.path.exists():
            shutil.copyfile(self.path, path)

    @property
    def size(self) -> int:
        """[bytes] of what has been written so far."""
        return self.path.stat().st_size if self.path.exists() else 0

    def rows(self, offset: int = 0) -> Rows:
        """The rows from `offset` [bytes] on; none where no device has written."""
        if not self.path.exists():
            return np.zeros(0, ROWS)
        with self.path.open("rb") as file:
            file.seek(offset)
            data = file.read()
        return np.frombuffer(data[: len(data) // ROW.size * ROW.size], ROWS)


def segments(rows: Rows) -> Iterator[Counts]:
    """Counters [steps] at every slot, those without a step filled in; a boot or a stand begins a new piece."""
    cuts = np.flatnonzero((rows["boot"][1:] != rows["boot"][:-1]) | (rows["boot"][1:] == STOOD)) + 1
    for piece in np.split(rows, cuts):
        piece = piece[piece["boot"] != STOOD]
        if len(piece) < 2:
            continue
        slots = (piece["time"] - piece["time"][0]) // SLOT
        # Rests of more than the widest span show nothing: each is cut down to that.
        gaps = np.minimum(np.diff(slots), 2 * max(SPANS))
        yield np.repeat(piece["steps"][:-1].astype(np.int64), gaps, axis=0)


def steps_in(rows: Rows) -> int:
    """In how many slots there was a step; a stand of the operating system's is none."""
    return int((rows["boot"] != STOOD).sum())


def violations(config: DeviceConfig, rows: Rows, may_stop_at_once: bool = False) -> list[Reason]:
    """Every joint that went or changed faster than its limits, over any span of slots, with the worst of each.

    `may_stop_at_once`: drivers that go off let the counters stop from one slot to the next, and only velocities count.
    """
    found: list[Reason] = []
    for counts in segments(rows):
        for index, joint in enumerate(config.joints):
            found += too_fast(joint, counts[:, index])
            found += [] if may_stop_at_once else too_steep(joint, counts[:, index])
    return found


def too_fast(joint: JointConfig, place: Counts) -> Iterator[Reason]:
    """Where `place` [steps] changes faster than the joint may; it is rounded, so a difference is off by one at most."""
    for span in SPANS:
        went = int(np.abs(place[span:] - place[:-span]).max(initial=0))
        allowed = joint.max_velocity_q8 / Q8 * span / SECOND + 1.0
        if went > allowed:
            yield because("chaos.slots.jump", joint=joint.name, steps=went, span=span, allowed=allowed)


def too_steep(joint: JointConfig, place: Counts) -> Iterator[Reason]:
    """Where the velocity of `place` [steps] changes faster than the joint may; rounding makes up two steps at most."""
    for span in SPANS:
        turn = int(np.abs(place[2 * span :] - 2 * place[span:-span] + place[: -2 * span]).max(initial=0))
        allowed = (1.0 + MARGIN) * joint.max_acceleration_q8 / Q8 * (span / SECOND) ** 2 + 2.0
        if turn > allowed:
            yield because("chaos.slots.jerk", joint=joint.name, steps=turn, span=span, allowed=allowed)
