"""The judge of every slot: what the witness of a device wrote, held against the limits of its joints."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from schemas.device_config import DeviceConfig
from tests.stack.witness import JOINTS, ROW, SLOT, STOOD

ROWS = np.dtype([("time", "<i8"), ("boot", "<u8"), ("steps", "<i4", (JOINTS,))])
SPANS = (1, 2, 5, 10, 20, 40, 80)  # slots over which velocity and acceleration are taken
SECOND = 1e6 / SLOT  # [slots]
Q8 = 256


def read(path: Path, offset: int = 0) -> np.ndarray:
    """The rows from `offset` [bytes] on."""
    assert ROWS.itemsize == ROW.size
    with path.open("rb") as file:
        file.seek(offset)
        return np.frombuffer(file.read(), ROWS)


def segments(rows: np.ndarray) -> Iterator[np.ndarray]:
    """Counters [steps] at every slot, those without a step filled in; a boot or a stand begins a new piece."""
    cuts = np.flatnonzero((rows["boot"][1:] != rows["boot"][:-1]) | (rows["boot"][1:] == STOOD)) + 1
    for piece in np.split(rows, cuts):
        piece = piece[piece["boot"] != STOOD]
        if len(piece) < 2:
            continue
        slots = (piece["time"] - piece["time"][0]) // SLOT
        # Rests of more than the widest span show nothing: each is cut down to that.
        gaps = np.minimum(np.diff(slots), 2 * max(SPANS))
        yield np.repeat(piece["steps"][:-1], gaps, axis=0)


def steps_in(rows: np.ndarray) -> int:
    """In how many slots there was a step; a stand of the operating system's is none."""
    return int((rows["boot"] != STOOD).sum())


def violations(config: DeviceConfig, rows: np.ndarray) -> list[str]:
    """Every joint that went or changed faster than its limits, over any span of slots, with the worst of each.

    A counter is the path rounded to the nearest step, so a difference is off by at most one step, one of two
    differences by two.
    """
    found = []
    for counts in segments(rows):
        for index, joint in enumerate(config.joints):
            place = counts[:, index].astype(np.int64)
            for span in SPANS:
                seconds = span / SECOND
                went = np.abs(place[span:] - place[:-span]).max(initial=0)
                speed = joint.max_velocity_q8 / Q8 * seconds + 1.0
                if went > speed:
                    found.append(f"{joint.name} went {went} steps in {span} ms, allowed {speed:.1f}")
                turn = np.abs(place[2 * span :] - 2 * place[span:-span] + place[: -2 * span]).max(initial=0)
                pull = joint.max_acceleration_q8 / Q8 * seconds**2 + 2.0
                if turn > pull:
                    found.append(f"{joint.name} changed by {turn} steps over 2 x {span} ms, allowed {pull:.1f}")
    return found
