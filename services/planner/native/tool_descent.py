"""Compiled descents of one arm's joints towards a target of the tool (native/src/descent.h)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.native.binding import motion
from gemelo.services.planner.native.chain import frames_of, transform_row

Array = NDArray[np.float64]


class NativeDescent:
    """Joint values are (n,) [rad] or [m] in the arm's order, poses in its base frame."""

    def __init__(self, arm: ArmDescription) -> None:
        frames = frames_of(arm)
        frame, pose = frames.places[arm.tool_frame]
        bounds = np.array([[joint.lower for joint in arm.joints], [joint.upper for joint in arm.joints]])
        self._arm = motion.tool_descent(frames.links, frames.numbers, frame, transform_row(pose), bounds)

    def tool_position(self, positions: Sequence[float] | Array) -> tuple[float, float, float]:
        """[m] where the tool is at joint values (n,) [rad] or [m]."""
        return motion.tool_position(self._arm, positions)

    def descend(
        self,
        starts: Array,
        position: Array,
        rotation: Array,
        metres_per_radian: float,
        position_tolerance: float,
        rotation_tolerance: float,
    ) -> list[tuple[Array, float, bool]]:
        """For each of `starts` (m, n) where the descent ends, how far from `position` (3,) [m] and `rotation` (9,), by
        rows or empty, and True if that is within the tolerances [m] and [rad]; the error is in [m], a radian counts
        `metres_per_radian`."""
        ends = motion.descend(
            self._arm,
            np.ascontiguousarray(starts, dtype=np.float64),
            np.ascontiguousarray(position, dtype=np.float64),
            np.ascontiguousarray(rotation, dtype=np.float64),
            metres_per_radian,
            position_tolerance,
            rotation_tolerance,
        )
        reached = ends[:, :-2].copy()
        return [
            (row, error, is_there == 1.0) for row, (error, is_there) in zip(reached, ends[:, -2:].tolist(), strict=True)
        ]

    def centred(
        self,
        solution: Array,
        middle: Array,
        weight: Array,
        position: Array,
        rotation: Array,
        metres_per_radian: float,
        position_tolerance: float,
        rotation_tolerance: float,
    ) -> Array | None:
        """`solution` (n,) [rad] or [m], which meets the target, moved by self-motion towards `middle` (n,), where a
        joint's distance counts by `weight` (n,); None where it has no self-motion. As of `descend` are the target's
        `position` and `rotation`, `metres_per_radian`, `position_tolerance` [m] and `rotation_tolerance` [rad]."""
        moved = motion.centre(
            self._arm,
            np.ascontiguousarray(solution, dtype=np.float64),
            middle,
            weight,
            np.ascontiguousarray(position, dtype=np.float64),
            np.ascontiguousarray(rotation, dtype=np.float64),
            metres_per_radian,
            position_tolerance,
            rotation_tolerance,
        )
        return moved if len(moved) else None
