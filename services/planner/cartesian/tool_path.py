"""The path of the tool by its length: straight lines, arcs, and rounded corners, with the orientation turning
evenly."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise
from typing import Protocol

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose
from gemelo.services.planner.path.path_curve import NO_LENGTH, blending, cut

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
METRES_PER_RADIAN = 0.1  # a line that mostly turns is as long as its turn
CORNER_ROWS = 16  # along a corner, for its length in metres; chosen: exact to 0.1 % on a quarter turn


class Piece(Protocol):
    """A smooth part of the path; `length` is [m] where it moves more than it turns, `metres` those of the tool."""

    @property
    def length(self) -> float:
        """Length [m], or `METRES_PER_RADIAN` times the turn if that is longer."""

    @property
    def metres(self) -> float:
        """Length [m] of the tool's translation."""

    def at(self, along: float) -> FramePose:
        """Pose of the tool in the base after the length `along` [m] of this piece."""


@dataclass(frozen=True)
class Straight:
    """From `start` with an even `twist` (6,): metres above radians per unit of length."""

    start: FramePose
    twist: Array
    length: float

    @property
    def metres(self) -> float:
        """Length [m] of the tool's translation."""
        return self.length * float(np.linalg.norm(self.twist[:3]))

    def at(self, along: float) -> FramePose:
        """Pose of the tool in the base after the length `along` [m] of this piece."""
        return moved(self.start, along * self.twist)

    def part(self, begin: float, end: float) -> Straight:
        """The line between the lengths `begin` and `end` [m] of this piece."""
        return Straight(self.at(begin), self.twist, end - begin)


@dataclass(frozen=True)
class Corner:
    """Around `corner` from one twist to another: begins and ends `radius` of length away, continuous in acceleration.

    The twist is at every moment a mean of both, so the path stays in the triangle of its ends and the corner.
    """

    corner: FramePose
    coming: Array
    leaving: Array
    radius: float

    @property
    def length(self) -> float:
        """Length [m] of the piece, from where it leaves the first line to where it joins the second; turns are
        weighted."""
        return 2.0 * self.radius

    @property
    def metres(self) -> float:
        """Length [m] of the tool's translation, by chords."""
        rows = np.array([self.at(along).position for along in np.linspace(0.0, self.length, CORNER_ROWS)])
        return float(np.linalg.norm(np.diff(rows, axis=0), axis=1).sum())

    def at(self, along: float) -> FramePose:
        """Pose of the tool in the base after the length `along` [m] of this piece."""
        turned = self.length * blending(along / self.length)
        offset = (along - self.radius) * self.coming + turned * (self.leaving - self.coming)
        return moved(self.corner, offset)


@dataclass(frozen=True)
class ArcPiece:
    """About `centre` (3,) and the unit `normal` (3,) by `angle` [rad], the tool itself turning by `turn` (3,) [rad]."""

    start: FramePose
    centre: Array
    normal: Array
    angle: float
    turn: Array

    @property
    def metres(self) -> float:
        """Length [m] of the arc."""
        return self.angle * float(np.linalg.norm(self.start.position - self.centre))

    @property
    def length(self) -> float:
        """Length of the piece: [m], or the weighted turn if that is longer."""
        return max(self.metres, METRES_PER_RADIAN * float(np.linalg.norm(self.turn)))

    def at(self, along: float) -> FramePose:
        """Pose of the tool in the base after the length `along` [m] of this piece."""
        share = along / self.length
        spoke = pin.exp3(share * self.angle * self.normal) @ (self.start.position - self.centre)
        return FramePose(self.centre + spoke, pin.exp3(share * self.turn) @ self.start.rotation)


class ToolPath:
    """Pieces one after the other, without a corner between them."""

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self._pieces = pieces
        self._ends = list(accumulate(piece.length for piece in pieces))
        self.length = self._ends[-1]
        self.metres = sum(piece.metres for piece in pieces)

    def at(self, along: float) -> FramePose:
        """Pose of the tool in the base at `along` [m], a length in [0, length]."""
        index, begin = self._locate(along)
        return self._pieces[index].at(min(along - begin, self._pieces[index].length))

    def metres_to(self, along: float) -> float:
        """Length [m] of the tool's translation up to the length `along` [m] of the path."""
        index, begin = self._locate(along)
        piece = self._pieces[index]
        return sum(other.metres for other in self._pieces[:index]) + piece.metres * (along - begin) / piece.length

    @property
    def marks(self) -> list[float]:
        """The lengths [m] at which pieces meet."""
        return self._ends[:-1]

    def _locate(self, along: float) -> tuple[int, float]:
        index = min(bisect_right(self._ends, along), len(self._ends) - 1)
        return index, self._ends[index - 1] if index else 0.0


def polyline(poses: Sequence[FramePose], blend: float) -> list[ToolPath]:
    """Straight from pose to pose, corners cut within `blend` [m] of them; one path for each part without a stop.

    Empty where all poses are one.
    """
    lines = [straight(*pair) for pair in pairwise(poses)]
    legs = [leg for leg in lines if leg.length > NO_LENGTH]
    cuts = [0.0, *(cut(one.length, other.length, blend) for one, other in pairwise(legs)), 0.0]
    runs: list[list[Piece]] = []
    for index, leg in enumerate(legs):
        before, after = cuts[index], cuts[index + 1]
        if before == 0.0:
            runs.append([])
        else:
            runs[-1].append(Corner(leg.start, legs[index - 1].twist, leg.twist, before))
        if leg.length - before - after > NO_LENGTH:
            runs[-1].append(leg.part(before, leg.length - after))
    return [ToolPath(run) for run in runs]


def straight(start: FramePose, end: FramePose) -> Straight:
    """The line between two poses, by the shorter turn."""
    twist = np.concatenate((end.position - start.position, pin.log3(end.rotation @ start.rotation.T)))
    length = max(float(np.linalg.norm(twist[:3])), METRES_PER_RADIAN * float(np.linalg.norm(twist[3:])))
    return Straight(start, twist / length if length > 0.0 else twist, length)


def moved(pose: FramePose, offset: Array) -> FramePose:
    """`pose` after a translation (3,) [m] and a rotation vector (3,) [rad], one above the other in `offset` (6,), both
    along the base's axes."""
    return FramePose(pose.position + offset[:3], pin.exp3(offset[3:]) @ pose.rotation)
