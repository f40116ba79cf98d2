"""The cause of an error of pointing, by its pattern over the table: lens, place of the camera, or the arm.

An arm is sent above tags that a camera has located, and a person says how far beside each it points. A camera that
stands elsewhere than believed shifts or turns all of them alike, a lens or print of a wrong scale spreads them, a first
joint whose zero is wrong turns them about the base; what is left over is the arm's, or the noise of the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from gemelo.libraries.vision.rigid import Array
from gemelo.schemas.reasons import Reason, because

FEWEST_TO_TELL = 2  # tags: one shows how large the error is, not where it comes from
SURE = 2.0  # standard deviations that an error may have
AS_MUCH = 0.4  # by which two angles may differ and be one, as a share
MOST_OF_IT = 0.75  # share of the squares that one cause must explain to be named alone


class Cause(StrEnum):
    """What an error of pointing comes from."""

    NONE = "nothing"
    UNKNOWN = "not known"
    MOUNT = "mount"
    SCALE = "scale"
    ZERO = "zero of the first joint"
    ARM = "arm"


@dataclass(frozen=True)
class Budget:
    """Standard deviations [m] that are to be expected of one pointing."""

    camera: float
    mount: float
    arm: float

    @property
    def total(self) -> float:
        return float(np.sqrt(self.camera**2 + self.mount**2 + self.arm**2))


@dataclass(frozen=True)
class Accuracy:
    """What was found."""

    cause: Cause
    worst: float  # [m]
    shift: float  # [m] that all have in common
    turn: float  # [m] RMS that a turn of the camera explains
    scale: float  # [m] RMS that a scale explains
    rest: float  # [m] RMS that nothing of these explains
    why: Reason  # the cause, with how much of the error it is


def judge(points: Array, offsets: Array, budget: Budget) -> Accuracy:
    """Of pointings at `points` (n, 2) [m] in the base, each beside its tag by `offsets` (n, 2) [m], tip minus tag."""
    points, offsets = np.asarray(points, dtype=float), np.asarray(offsets, dtype=float)
    sizes = np.linalg.norm(offsets, axis=1)
    worst = float(sizes.max())
    shift, turn, scale, rest = _parts(points, offsets)
    cause = _cause(points, offsets, budget, (shift, turn, scale, rest))
    return Accuracy(cause, worst, shift, turn, scale, rest, _why(cause, worst, budget, (shift, turn, scale, rest)))


def _parts(points: Array, offsets: Array) -> tuple[float, float, float, float]:
    """Shift, and RMS of turn, scale and rest [m], by least squares."""
    common = offsets.mean(axis=0)
    around = points - points.mean(axis=0)
    spread = float(np.sum(around**2))
    if len(points) < FEWEST_TO_TELL or spread < 1e-6:
        return float(np.linalg.norm(common)), 0.0, 0.0, float(np.sqrt(np.mean(np.sum((offsets - common) ** 2, axis=1))))
    across = np.column_stack([-around[:, 1], around[:, 0]])
    turn = float(np.sum(across * offsets)) / spread
    scale = float(np.sum(around * offsets)) / spread
    rest = offsets - common - turn * across - scale * around
    size = np.sqrt(spread / len(points))
    return (
        float(np.linalg.norm(common)), float(abs(turn) * size), float(abs(scale) * size),
        float(np.sqrt(np.mean(np.sum(rest**2, axis=1)))),
    )  # fmt: skip


def _cause(points: Array, offsets: Array, budget: Budget, parts: Sequence[float]) -> Cause:
    if float(np.linalg.norm(offsets, axis=1).max()) <= SURE * budget.total:
        return Cause.NONE
    if len(points) < FEWEST_TO_TELL:
        return Cause.UNKNOWN
    if len(points) > FEWEST_TO_TELL and _is_about_base(points, offsets):
        return Cause.ZERO
    shift, turn, scale, rest = (each**2 for each in parts)
    found = {Cause.MOUNT: shift + turn, Cause.SCALE: scale, Cause.ARM: rest}
    cause = max(found, key=lambda each: found[each])
    return cause if found[cause] > MOST_OF_IT * sum(found.values()) else Cause.UNKNOWN


def _is_about_base(points: Array, offsets: Array) -> bool:
    """True if a turn about the base explains the offsets, and the tags also turn about their middle by as much."""
    about_base, angle = _turn(points, offsets)
    _, own_angle = _turn(points - points.mean(axis=0), offsets)
    return about_base > MOST_OF_IT * float(np.sum(offsets**2)) and abs(own_angle - angle) < AS_MUCH * abs(angle)


def _turn(points: Array, offsets: Array) -> tuple[float, float]:
    """The squares [m^2] that a turn about the origin explains, and its angle [rad]."""
    across = np.column_stack([-points[:, 1], points[:, 0]])
    spread = max(float(np.sum(across**2)), 1e-12)
    angle = float(np.sum(across * offsets)) / spread
    return angle**2 * spread, angle


def _why(cause: Cause, worst: float, budget: Budget, parts: Sequence[float]) -> Reason:
    shift, turn, scale, rest = (1e3 * each for each in parts)
    off = 1e3 * worst
    match cause:
        case Cause.NONE:
            return because("measure.pointing.well", off=off, total=1e3 * budget.total)
        case Cause.MOUNT:
            return because("measure.pointing.mount", off=off, shift=shift, turn=turn)
        case Cause.SCALE:
            return because("measure.pointing.scale", off=off, scale=scale)
        case Cause.ZERO:
            return because("measure.pointing.zero", off=off)
        case Cause.ARM:
            return because("measure.pointing.arm", off=off, rest=rest)
        case _:
            return because("measure.pointing.unknown", off=off, shift=shift, turn=turn, scale=scale, rest=rest)
