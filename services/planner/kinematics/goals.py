"""Joint values of a requested goal: named, joint and pose goals, each with its own refusals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gemelo.libraries.arm.frames.transforms import IDENTITY, Rigid, from_message
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import Goal, JointGoal, NamedGoal, PlanCode, PoseGoal, WaypointGoal
from gemelo.schemas.reasons import because, remedy
from gemelo.services.planner.collision.clearance import DistanceChecker
from gemelo.services.planner.kinematics.ik import InverseKinematics
from gemelo.services.planner.kinematics.joint_ranges import FullTurns
from gemelo.services.planner.kinematics.pose_goals import target_of
from gemelo.services.planner.kinematics.task_space import task_space
from gemelo.services.planner.kinematics.unreachable import UnreachableRefusals
from gemelo.services.planner.request.deadline import Deadline
from gemelo.services.planner.request.refusals import beyond_limit, malformed, timed_out, unknown_name
from gemelo.services.planner.request.start_state import are_usable, require_parallel, require_unwound

Array = NDArray[np.float64]
Start = tuple[float, ...]

# Tuning constants: chosen, where a line does not say measured or standard.
MOST_OTHER_WAYS = 7  # of a configuration, which are tried beside it
INVALID = PlanCode.INVALID_GOAL_CONSTRAINTS


class Goals:
    """Joint values for every kind of goal, nearest to the start first."""

    def __init__(self, arm: ArmDescription, kinematics: Kinematics, checker: DistanceChecker | None = None) -> None:
        """`checker` says what touches; without one it is the arm alone."""
        self._arm = arm
        self._kinematics = kinematics
        self.task_space = task_space(arm, kinematics)
        self._ik = InverseKinematics(arm, kinematics)
        self._turns = FullTurns(arm)
        self._unreachable = UnreachableRefusals(
            arm, kinematics, self._ik, self.task_space, checker or kinematics.collisions
        )

    def travel(self, first: Start, second: Start) -> float:
        """[s] that the slowest joint takes between two configurations at full speed."""
        return self._ik.travel(np.array(first), np.array(second))

    def candidates(
        self, goal: Goal, start: Start, deadline: Deadline, standing: Start | None = None
    ) -> Iterator[Start]:
        """Configurations (n,) [rad] or [m] that fulfil the goal, lazily; raises `PlanRefused` where there is none.

        A link's frame is where the arm has it when it stands in `standing`: at the start, where that is absent.
        """
        match goal:
            case NamedGoal():
                return iter([self._named(goal, start)])
            case JointGoal():
                return iter([self._joints(goal, start)])
            case PoseGoal():
                return self._poses(goal, self.frame(goal, standing or start), start, deadline)
            case WaypointGoal():
                raise malformed(INVALID, "goal", because("plan.waypoints.here", remedy("first_point")))

    def other_ways_round(self, configurations: Sequence[Start], start: Start) -> list[Start]:
        """Where the arm stands as in one of the `configurations` (n,) [rad] or [m], with joints without limits a full
        turn away; the fastest to reach from `start` (n,) first."""
        if not self._turns.has_endless:
            return []
        near = np.array(start)
        rows = [
            tuple(row.tolist())
            for configuration in configurations
            for row in self._turns.other_ways_round(np.array(configuration), near, MOST_OTHER_WAYS)
        ]
        return sorted(rows, key=lambda row: self.travel(start, row))

    def _named(self, goal: NamedGoal, start: Start) -> Start:
        values = self._arm.named_state(goal.name, start)
        if values is None:
            raise unknown_name(INVALID, "unknown state", goal.name, self._arm.state_names, self._arm.srdf_path.name)
        return self._within_limits(self._arm.joint_names, values)

    def _joints(self, goal: JointGoal, start: Start) -> Start:
        if goal.name == self._arm.joint_names and are_usable(self._arm, goal.position):
            return goal.position
        if not goal.name:
            raise malformed(INVALID, "joints", because("plan.goal.no_joint", remedy("name_a_joint")))
        require_parallel(goal.name, goal.position, "joint_goal")
        for name in goal.name:
            if name not in self._arm.joint_names:
                raise unknown_name(INVALID, "unknown joint", name, self._arm.joint_names, self._arm.name)
        values = dict(zip(goal.name, self._within_limits(goal.name, goal.position), strict=True))
        return tuple(values.get(name, value) for name, value in zip(self._arm.joint_names, start, strict=True))

    def _within_limits(self, names: tuple[str, ...], positions: Vector) -> Vector:
        """`positions` [rad] or [m], those at a limit that only rounding misses; raises `PlanRefused` for one beyond."""
        joints = [self._arm.joint(name) for name in names]
        nearest = tuple(joint.clamp(position) for joint, position in zip(joints, positions, strict=True))
        for joint, position in zip(joints, positions, strict=True):
            require_unwound(INVALID, joint, position)
            if not joint.is_within(joint.rounded(position)):
                raise beyond_limit(self._arm, joint, position, nearest)
        return nearest

    def _poses(self, goal: PoseGoal, frame: Rigid, start: Start, deadline: Deadline) -> Iterator[Start]:
        target = target_of(goal, frame)
        near = np.array(start)
        if not self.task_space.allows(target):
            raise self._unreachable.refusal(goal, target, frame, near, deadline)
        found = False
        for positions in self._ik.solutions(target, near, deadline):
            found = True
            yield tuple(positions.tolist())
        if found:
            return
        if deadline.has_passed():
            raise timed_out()
        raise self._unreachable.refusal(goal, target, frame, near, deadline)

    def frame(self, goal: PoseGoal, start: Start) -> Rigid:
        """The goal's frame in the base, with the joints at `start` (n,) [rad] or [m]; raises `PlanRefused` for an
        unknown frame."""
        if goal.frame in ("", self._arm.base_frame):
            return IDENTITY
        links = self._kinematics.link_poses(start)
        if goal.frame not in links:
            raise unknown_name(PlanCode.FRAME_TRANSFORM_FAILURE, "unknown frame", goal.frame, links, self._arm.name)
        return from_message(links[goal.frame])

    def shown_point(self, goal: PoseGoal, start: Start, configuration: Array, deadline: Deadline) -> Vector:
        """The tool's pose in `configuration` (n,) [rad] or [m], in the goal's form and frame: position (3,) [m], then
        the orientation or the direction, if the goal has one. A position alone is rounded to a point that can be
        reached."""
        return self._unreachable.shown(goal, configuration, self.frame(goal, start), deadline)
