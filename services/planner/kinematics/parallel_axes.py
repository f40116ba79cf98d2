"""Inverse kinematics in closed form for arms of three parallel axes, two that turn and one that slides: SCARA arms.

Seen along the axes the arm is two links in a plane, whatever the order of its joints: the law of cosines gives the two
elbows, and the slide the height. Points of the plane are complex numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.services.planner.kinematics.closed_form import chain_order
from gemelo.services.planner.kinematics.joint_ranges import FullTurns, one_turn
from gemelo.services.planner.kinematics.targets import any_normal

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
JOINTS = 3  # of the arms that are solved here
SAMPLES = 8  # configurations at which the answers are held against the kinematics
AGREEMENT = 1e-9  # [m] chosen: rounding of three joints, a hundred times over
LEAST = 1e-6  # [m] a link that is shorter is none; chosen: far above rounding, far below a link
STRETCHED = 1e-9  # how far a cosine may be beyond 1 by rounding


class ParallelAxes:
    """All configurations of one arm for a position of the tool; joint values are (3,) in the arm's order."""

    def __init__(self, arm: ArmDescription, pose: FramePose, jacobian: Array, order: tuple[int, int, int]) -> None:
        """The tool's pose and Jacobian (6, 3) at zero; `order` is of the shoulder, the elbow and the slide."""
        self._turns = FullTurns(arm)
        self._first, self._second, self._slide = order
        axis = jacobian[3:, self._first]
        across = any_normal(axis)
        self._plane = np.array((across, np.cross(axis, across)))
        self._sense = round(float(jacobian[3:, self._second] @ axis))  # of the elbow: 1, or -1 against the shoulder
        self._along = jacobian[:3, self._slide]
        self._height = float(pose.position @ self._along)
        # With v the tool's velocity when a joint turns at 1 rad/s: tool + axis x v lies on the joint's axis.
        on_axes = pose.position + np.cross(jacobian[3:].T, jacobian[:3].T)
        self._shoulder, elbow = self._seen(on_axes[self._first]), self._seen(on_axes[self._second])
        self._upper, self._fore = elbow - self._shoulder, self._seen(pose.position) - elbow

    def configurations(self, position: Array, near: Array) -> Array:
        """Joint values (m, 3) [rad] and [m] within the limits, with every full turn, in no order, for the tool's
        `position` (3,) [m] in the base frame. Where the shoulder may turn freely, it stays as in `near` (3,)."""
        out, upper, fore = self._seen(position) - self._shoulder, self._upper, self._fore
        if not math.hypot(out.real, out.imag) <= 2.0 * (abs(upper) + abs(fore)):  # whose square may be no number
            return np.empty((0, JOINTS))
        cosine = (abs(out) ** 2 - abs(upper) ** 2 - abs(fore) ** 2) / (2.0 * abs(upper) * abs(fore))
        if abs(cosine) > 1.0 + STRETCHED:
            return np.empty((0, JOINTS))
        bend, straight = math.acos(min(max(cosine, -1.0), 1.0)), _angle(fore) - _angle(upper)
        branches = []
        for elbow in (bend - straight, -bend - straight):
            reach = upper + fore * complex(math.cos(elbow), math.sin(elbow))
            configuration = near.copy()
            if min(abs(reach), abs(out)) > LEAST:
                configuration[self._first] = _angle(out) - _angle(reach)
            configuration[self._second] = self._sense * elbow
            configuration[self._slide] = float(position @ self._along) - self._height
            branches.append(configuration)
        return self._turns.within_limits(np.array(branches), near)

    @property
    def shorter(self) -> float:
        """[m] the length of the shorter link."""
        return min(abs(self._upper), abs(self._fore))

    def _seen(self, point: Array) -> complex:
        x, y = self._plane @ point
        return complex(x, y)


def parallel_axes(arm: ArmDescription, kinematics: Kinematics) -> ParallelAxes | None:
    """The arm's closed form, or None where its joints are others."""
    if sorted(joint.unit for joint in arm.joints) != ["m", "rad", "rad"]:
        return None
    first, second = (joint for joint in chain_order(arm) if arm.joints[joint].unit == "rad")
    slide = JOINTS - first - second
    pose, jacobian = kinematics.tool_and_jacobian(np.zeros(JOINTS))
    axes = np.array((jacobian[3:, first], jacobian[3:, second], jacobian[:3, slide]))
    if not np.allclose(np.abs(axes @ axes.T), 1.0, atol=AGREEMENT):
        return None  # not parallel, or a mimic moves with one of them
    solver = ParallelAxes(arm, pose, jacobian, (first, second, slide))
    return solver if solver.shorter > LEAST and _agrees(arm, kinematics, solver) else None


def _agrees(arm: ArmDescription, kinematics: Kinematics, solver: ParallelAxes) -> bool:
    """True if random configurations are among those of their own position."""
    lower, upper = one_turn(arm)
    for configuration in np.random.default_rng(1).uniform(lower, upper, (SAMPLES, JOINTS)):
        found = solver.configurations(kinematics.tool(configuration).position, configuration)
        if not len(found) or min(float(np.abs(each - configuration).max()) for each in found) > AGREEMENT:
            return False
    return True


def _angle(point: complex) -> float:
    return math.atan2(point.imag, point.real)
