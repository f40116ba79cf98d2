"""The task space of an arm: which turns of its tool it can choose, read from its joints before any goal is asked.

The rotations of the tool over all configurations are read from the Jacobian; where they are turns about one axis only,
how far a goal is from them is plain geometry."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason, Remedy, because, remedy
from gemelo.services.planner.kinematics.targets import ROTATION_TOLERANCE, ToolTarget

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
SAMPLES = 32  # chosen: a direction that none of so many configurations can move, the arm does not have
RANK = 1e-6  # singular value [m] or [rad] per joint below which a direction is none
UPRIGHT = 1.0 - 1e-6  # cosine to the vertical from which a turn is called yaw


@dataclass(frozen=True)
class TaskSpace:
    """`axes` (r, 3): the directions in the base frame about which the tool can be turned at all, over all
    configurations.

    `chosen`: how many of these turns can be chosen beside a position. `rotation` (3, 3): the tool's in some
    configuration."""

    arm: str
    joints: int
    axes: Array
    chosen: int
    rotation: Array

    @property
    def is_full(self) -> bool:
        """True if every orientation can be asked for beside a position."""
        return self.chosen == 3

    @property
    def why(self) -> Reason:
        """What the arm can do with its tool."""
        turns = len(self.axes)
        if self.is_full:
            return because("plan.turns.all", robot=self.arm)
        if turns == 0:
            return because("plan.turns.none", robot=self.arm)
        if turns == 1 and self.chosen == 1:
            return because("plan.turns.vertical" if self._is_upright else "plan.turns.one_axis", robot=self.arm)
        if turns == 1:
            return because("plan.turns.no_tilt" if self._is_upright else "plan.turns.follows_axis", robot=self.arm)
        if self.chosen == 0:
            return because("plan.turns.follow", robot=self.arm, joints=self.joints)
        return because("plan.turns.some", robot=self.arm, joints=self.joints, count=self.chosen)

    @property
    def remedies(self) -> tuple[Remedy, ...]:
        """What to ask for instead."""
        turns = len(self.axes)
        if turns == 0 or (self.chosen == 0 and turns > 1):
            return (remedy("position_alone"),)
        if turns == 1:
            return remedy("position_alone"), remedy("position_and_yaw" if self._is_upright else "position_and_turn")
        if self.chosen == 1:
            return remedy("position_alone"), remedy("orientation_tolerance")
        return remedy("position_and_axis"), remedy("free_axis")

    @property
    def turning(self) -> str:
        """The name of what the arm lacks."""
        return "tilt" if self._is_upright else "orientation"

    def allows(self, target: ToolTarget) -> bool:
        """True if any configuration at all, wherever the tool then is, turns it like that."""
        return self.missing_tilt(target) <= max(ROTATION_TOLERANCE, target.rotation_tolerance)

    def missing_tilt(self, target: ToolTarget) -> float:
        """[rad] at least between the target and the nearest orientation of any configuration; 0 where that is not
        known."""
        if not target.has_turn or len(self.axes) > 1:
            return 0.0
        if len(self.axes) == 0:
            return float(np.linalg.norm(target.turn(self.rotation)))
        axis = self.axes[0]
        in_tool = self.rotation.T @ axis
        if target.pointing is not None:
            there = angle_between(axis, target.pointing.direction)
            return abs(there - angle_between(in_tool, target.pointing.axis))
        assert target.rotation is not None
        return angle_between(axis, target.rotation @ in_tool)

    @property
    def _is_upright(self) -> bool:
        return len(self.axes) == 1 and abs(float(self.axes[0][2])) > UPRIGHT


def task_space(arm: ArmDescription, kinematics: Kinematics) -> TaskSpace:
    """Read from the Jacobians of some configurations within the limits; those at a stretch do not hide what others
    can."""
    lower = [max(joint.lower, -math.pi) for joint in arm.joints]
    upper = [min(joint.upper, math.pi) for joint in arm.joints]
    configurations = np.random.default_rng(1).uniform(lower, upper, (SAMPLES, len(arm.joints)))
    jacobians = [kinematics.jacobian(configuration) for configuration in configurations]
    _, values, rows = np.linalg.svd(np.hstack([jacobian[3:] for jacobian in jacobians]).T)
    axes = rows[: int(np.sum(values > RANK))]
    chosen = max(_rank(jacobian) - _rank(jacobian[:3]) for jacobian in jacobians)
    return TaskSpace(arm.name, len(arm.joints), axes, chosen, kinematics.tool(configurations[0]).rotation)


def angle_between(first: Array, second: Array) -> float:
    """[rad] between two unit vectors (3,), exact for small angles too: `first` to `second`."""
    return math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


def _rank(jacobian: Array) -> int:
    return int(np.linalg.matrix_rank(jacobian, tol=RANK))
