"""From what was asked to joint values: named, joint and pose goals, each with the refusals that belong to it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import product

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from schemas.message import Vector
from schemas.planning import Goal, JointGoal, NamedGoal, PlanCode, PoseGoal, WaypointGoal
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.arm.transforms import IDENTITY, Point, Rigid, compose, from_message, inverse
from services.planner.clearance import CLEARANCE, last_free
from services.planner.ik import InverseKinematics
from services.planner.refusals import NoPlan, beyond_limit, malformed, out_of_reach, unknown_name
from services.planner.start import require_parallel
from services.planner.targets import POSITION_TOLERANCE, Target

Array = NDArray[np.float64]
Clock = Callable[[], bool]
Start = tuple[float, ...]

INVALID = PlanCode.INVALID_GOAL_CONSTRAINTS
FULL_POSE_JOINTS = 6  # an arm with fewer cannot choose its tool's orientation as well
PRINTED = 1e-4  # [m] to which the nearest point is rounded that a person is told
NEAREST_TRIED = 6  # postures


class Goals:
    """Joint values for every kind of goal, nearest to the start first."""

    def __init__(self, arm: Arm, kinematics: Kinematics) -> None:
        self._arm = arm
        self._kinematics = kinematics
        self._ik = InverseKinematics(arm, kinematics)

    def candidates(self, goal: Goal, start: Start, is_late: Clock) -> Iterator[Start]:
        """Postures that fulfil the goal, lazily; raises `NoPlan` where there is none."""
        match goal:
            case NamedGoal():
                return iter([self._named(goal)])
            case JointGoal():
                return iter([self._joints(goal, start)])
            case PoseGoal():
                return self._poses(goal, start, is_late)
            case WaypointGoal():
                raise malformed(
                    INVALID, "goal", "this planner takes one goal at a time", "ask for the first point alone"
                )

    def _named(self, goal: NamedGoal) -> Start:
        values = self._arm.named_states.get(goal.name)
        if values is None:
            where = f"{self._arm.srdf_path.name} of {self._arm.name}"
            raise unknown_name(INVALID, "unknown state", goal.name, self._arm.named_states, where)
        self._require_limits(self._arm.joint_names, values)
        return values

    def _joints(self, goal: JointGoal, start: Start) -> Start:
        if not goal.name:
            raise malformed(INVALID, "joints", "the goal names no joint", "name at least one joint and its position")
        require_parallel(goal.name, goal.position, "the joint goal")
        for name in goal.name:
            if name not in self._arm.joint_names:
                raise unknown_name(INVALID, "unknown joint", name, self._arm.joint_names, self._arm.name)
        self._require_limits(goal.name, goal.position)
        values = dict(zip(goal.name, goal.position, strict=True))
        return tuple(values.get(name, value) for name, value in zip(self._arm.joint_names, start, strict=True))

    def _require_limits(self, names: tuple[str, ...], positions: Vector) -> None:
        joints = [self._arm.joint(name) for name in names]
        nearest = tuple(joint.clamp(position) for joint, position in zip(joints, positions, strict=True))
        for joint, position in zip(joints, positions, strict=True):
            if not joint.is_within(position):
                raise beyond_limit(self._arm, joint, position, nearest)

    def _poses(self, goal: PoseGoal, start: Start, is_late: Clock) -> Iterator[Start]:
        frame = self._frame(goal, start)
        target = self._target(goal, frame)
        near = np.array(start)
        found = False
        for positions in self._ik.solutions(target, near, is_late):
            found = True
            yield tuple(positions.tolist())
        if found:
            return
        if is_late():
            raise timed_out()
        raise self._unreachable(target, frame, near, is_late)

    def _frame(self, goal: PoseGoal, start: Start) -> Rigid:
        """The goal's frame in the base."""
        if goal.frame in ("", self._arm.base_frame):
            return IDENTITY
        links = self._kinematics.link_poses(start)
        if goal.frame not in links:
            raise unknown_name(PlanCode.FRAME_TRANSFORM_FAILURE, "unknown frame", goal.frame, links, self._arm.name)
        return from_message(links[goal.frame])

    def _target(self, goal: PoseGoal, frame: Rigid) -> Target:
        if len(goal.position) != 3:
            raise malformed(
                INVALID, "position", f"a tool position has 3 numbers, not {len(goal.position)}", "give x y z in m"
            )
        x, y, z = goal.position
        if not goal.orientation:
            return Target(np.array(compose(frame, ((x, y, z), IDENTITY[1]))[0]))
        if len(self._arm.joints) < FULL_POSE_JOINTS:
            raise malformed(
                INVALID,
                "orientation",
                f"{self._arm.name} has {len(self._arm.joints)} joints: it can place its tool, but not choose how the "
                "tool is turned",
                "leave the orientation empty; the tool's position is then all that counts",
                check="orientation",
            )
        if len(goal.orientation) != 4 or abs(float(np.linalg.norm(goal.orientation)) - 1.0) > 1e-3:
            raise malformed(INVALID, "orientation", "the orientation is no unit quaternion", "give x y z w of length 1")
        a, b, c, d = goal.orientation
        point, turn = compose(frame, ((x, y, z), (a, b, c, d)))
        return Target(np.array(point), pin.Quaternion(np.array(turn)).normalized().matrix())

    def _unreachable(self, target: Target, frame: Rigid, near: Array, is_late: Clock) -> NoPlan:
        """The refusal of a point that no posture reaches, with the nearest that one does."""
        best = self._nearest_free(target, near, is_late)
        point = self._kinematics.tool(best).position
        if float(np.linalg.norm(point - target.position)) <= POSITION_TOLERANCE:
            return malformed(
                PlanCode.NO_IK_SOLUTION,
                "orientation",
                f"{self._arm.tool_frame} can be at this point, but not turned like that",
                "leave the orientation empty, or turn the tool less",
                check="orientation",
            )
        shown = self._printable(point, best, frame, is_late)
        return out_of_reach(self._arm, target.position.tolist(), point.tolist(), shown, self._held(best))

    def _nearest_free(self, target: Target, near: Array, is_late: Clock) -> Array:
        """The best posture after each has been drawn back towards the start until nothing touches."""
        postures = self._ik.nearest(target, near, is_late)[:NEAREST_TRIED]
        free = [last_free(self._kinematics.collisions, near, posture) for posture in postures]
        return min(free, key=lambda q: float(np.linalg.norm(self._kinematics.tool(q).position - target.position)))

    def shown_point(self, goal: PoseGoal, start: Start, posture: Array, is_late: Clock) -> Vector:
        """Where the tool is in `posture`, in the goal's frame and reachable as printed."""
        return self._printable(self._kinematics.tool(posture).position, posture, self._frame(goal, start), is_late)

    def _printable(self, point: Array, posture: Array, frame: Rigid, is_late: Clock) -> Vector:
        """The nearest point to `point` that has few decimals in the goal's frame and can be reached like that."""
        local = np.array(compose(inverse(frame), (_triple(point), IDENTITY[1]))[0])
        corners = [np.floor(local / PRINTED) + np.array(corner) for corner in product((0, 1), repeat=3)]
        for corner in sorted(corners, key=lambda corner: float(np.linalg.norm(corner * PRINTED - local))):
            x, y, z = (round(value, 4) for value in (corner * PRINTED).tolist())
            back = np.array(compose(frame, ((x, y, z), IDENTITY[1]))[0])
            attempt = self._ik.descend(Target(back), posture)
            if is_late() or (
                attempt.is_solution and self._kinematics.collisions.distance(attempt.positions) > CLEARANCE
            ):
                return (x, y, z)
        return tuple(local.tolist())

    def _held(self, posture: Array) -> list[str]:
        """The joints that stand at a limit, in words."""
        held = []
        for joint, value in zip(self._arm.joints, posture.tolist(), strict=True):
            for side, limit in (("lower", joint.lower), ("upper", joint.upper)):
                if abs(value - limit) < 1e-9:
                    held.append(f"{joint.name} at its {side} limit of {limit:g} {joint.unit}")
        return held


def _triple(point: Array) -> Point:
    x, y, z = point.tolist()
    return x, y, z


def timed_out() -> NoPlan:
    """The search used up the time it was allowed."""
    return malformed(
        PlanCode.TIMED_OUT,
        "allowed_time",
        "no plan was found within the time allowed",
        "allow more time, or ask for a goal nearer to where the arm is",
        check="allowed time",
    )
