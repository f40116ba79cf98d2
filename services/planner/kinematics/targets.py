"""Targets of the tool: position, rotation or pointing direction, tolerances, and the error of a configuration."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
POSITION_TOLERANCE = 1e-7  # [m] at which a solution is exact; chosen: a hundredth of what a motor step moves
ROTATION_TOLERANCE = 1e-6  # [rad] chosen: as much at a tool of 0.1 m as the position's
EDGE = 0.99  # share of a tolerance that is used, so that rounding does not put the end of a descent outside
METRES_PER_RADIAN = 0.2  # how much a turn of the tool counts against its position while searching


class AxisPointing(NamedTuple):
    """An axis (3,) of the tool, in the tool's frame, that is to point along `direction` (3,) in the base frame."""

    axis: Array
    direction: Array


class ToolTarget(NamedTuple):
    """A tool position (3,) [m] in the base frame and, where it matters, its rotation (3, 3) or where it points."""

    position: Array
    rotation: Array | None = None
    pointing: AxisPointing | None = None
    position_tolerance: float = 0.0  # [m] that will do as well
    rotation_tolerance: float = 0.0  # [rad]
    metres_per_radian: float = METRES_PER_RADIAN

    @property
    def has_turn(self) -> bool:
        """True if it matters how the tool is turned."""
        return self.rotation is not None or self.pointing is not None

    @property
    def is_tolerant(self) -> bool:
        """True if less than exact will do."""
        return self.position_tolerance > POSITION_TOLERANCE or self.rotation_tolerance > ROTATION_TOLERANCE

    def error_and_jacobian(self, kinematics: Kinematics, positions: Array) -> tuple[Array, Array]:
        """What is missing, (3,) or (6,) [m], turns weighted by `metres_per_radian`, and how the joints (n,) [rad] or
        [m] change that, (3, n) or (6, n)."""
        pose, jacobian = kinematics.tool_and_jacobian(positions)
        missing = self.position - pose.position
        if not self.has_turn:
            return missing, jacobian[:3]
        turning = jacobian[3:]
        if self.pointing is not None:
            axis = pose.rotation @ self.pointing.axis
            turning = turning - np.outer(axis, axis @ turning)
        weighted = np.vstack((jacobian[:3], self.metres_per_radian * turning))
        return np.concatenate((missing, self.metres_per_radian * self.turn(pose.rotation))), weighted

    def beyond_tolerances(self, error: Array, jacobian: Array) -> tuple[Array, Array]:
        """The error (3,) or (6,) [m] and its Jacobian (3, n) or (6, n), as of `error_and_jacobian`, reduced to what is
        missing to the edge of the tolerances; zero within them."""
        error, jacobian = error.copy(), jacobian.copy()
        _shrink(error, jacobian, slice(0, 3), EDGE * self.position_tolerance)
        if self.has_turn:
            _shrink(error, jacobian, slice(3, 6), EDGE * self.rotation_tolerance * self.metres_per_radian)
        return error, jacobian

    def turn(self, rotation: Array) -> Array:
        """(3,) [rad] the rotation vector, in the base frame, that the tool is away from how it is to be turned."""
        if self.rotation is not None:
            vector: Array = pin.log3(self.rotation @ rotation.T)
            return vector
        if self.pointing is not None:
            return turn_between(rotation @ self.pointing.axis, self.pointing.direction)
        return np.zeros(3)

    def misses(self, pose: FramePose) -> tuple[float, float]:
        """[m] and [rad] that `pose` is away."""
        return float(np.linalg.norm(self.position - pose.position)), float(np.linalg.norm(self.turn(pose.rotation)))

    def is_exact(self, error: Array) -> bool:
        """True if `error` (3,) or (6,) [m], as of `error_and_jacobian`, is within the tolerances of an exact
        solution."""
        return self._is_within(error, POSITION_TOLERANCE, ROTATION_TOLERANCE)

    def is_at_edge(self, error: Array) -> bool:
        """True if `error` (3,) or (6,) [m], as of `beyond_tolerances`, is within the share 1 - `EDGE` of the
        tolerances."""
        position = max(POSITION_TOLERANCE, (1.0 - EDGE) * self.position_tolerance)
        return self._is_within(error, position, max(ROTATION_TOLERANCE, (1.0 - EDGE) * self.rotation_tolerance))

    def is_met(self, error: Array) -> bool:
        """True if `error` (3,) or (6,) [m], as of `error_and_jacobian`, is within the tolerances."""
        position = max(POSITION_TOLERANCE, self.position_tolerance)
        return self._is_within(error, position, max(ROTATION_TOLERANCE, self.rotation_tolerance))

    def _is_within(self, error: Array, position: float, rotation: float) -> bool:
        if math.sqrt(float(error[:3] @ error[:3])) > position:
            return False
        return len(error) == 3 or math.sqrt(float(error[3:] @ error[3:])) <= rotation * self.metres_per_radian


def turn_between(first: Array, second: Array) -> Array:
    """The shortest rotation vector (3,) [rad] from one unit vector to the other; any of them for opposite ones."""
    normal = np.array(
        (
            first[1] * second[2] - first[2] * second[1],
            first[2] * second[0] - first[0] * second[2],
            first[0] * second[1] - first[1] * second[0],
        )
    )
    sine, cosine = math.sqrt(float(normal @ normal)), float(first @ second)
    if sine > 1e-9:
        scaled: Array = normal * (math.atan2(sine, cosine) / sine)
        return scaled
    return normal if cosine > 0.0 else math.pi * any_normal(first)


def any_normal(axis: Array) -> Array:
    """Some unit vector (3,) perpendicular to `axis`."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    normal: Array = other - axis * float(axis @ other)
    return normal / float(np.linalg.norm(normal))


def _shrink(error: Array, jacobian: Array, rows: slice, tolerance: float) -> None:
    """Takes `tolerance` off the length of these rows of the error, in place, with the exact derivative of that."""
    length = float(np.linalg.norm(error[rows]))
    if length <= tolerance:
        error[rows], jacobian[rows] = 0.0, 0.0
        return
    share, along = tolerance / length, error[rows] / length
    jacobian[rows] = (1.0 - share) * jacobian[rows] + share * np.outer(along, along @ jacobian[rows])
    error[rows] *= 1.0 - share
