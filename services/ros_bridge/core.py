"""Goals of ROS 2 and ours: trajectories in, feedback and results out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from msgspec.structs import replace

from gemelo.libraries.ros2.messages import SECOND, duration_of, header_of, nanoseconds
from gemelo.libraries.ros2.types import FOLLOW, GRIPPER, ControlMsgs, make
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.schemas.planning import JogCommand
from gemelo.schemas.reasons import because, remedy

POINT = "trajectory_msgs/msg/JointTrajectoryPoint"


class GoalNotTaken(ReasonedError):
    """A goal of ROS that none of ours can be made of; the reason says what of it."""


def follow_goal(goal: Any, to_gateway: Callable[[int], int | None]) -> FollowJointTrajectoryGoal:
    """Ours, of a control_msgs/FollowJointTrajectory goal; the joints may stand in any order.

    `to_gateway(stamp)` is the same moment [ns] by the gateway's clock, None while that is not known. Raises
    `GoalNotTaken`: for joints with several degrees of freedom, for efforts and for numbers that are not finite.
    """
    if goal.multi_dof_trajectory.points or goal.component_path_tolerance or goal.component_goal_tolerance:
        raise GoalNotTaken(because("ros.goal.multi_dof", remedy("ros_joint_trajectory")))
    stamp = nanoseconds(goal.trajectory.header.stamp)
    start = to_gateway(stamp) if stamp else 0
    if start is None:
        raise GoalNotTaken(because("ros.goal.clock", remedy("ros_stamp")))
    try:
        return FollowJointTrajectoryGoal(
            trajectory=JointTrajectory(
                stamp=start,
                joint_names=tuple(goal.trajectory.joint_names),
                points=tuple(_point(each) for each in goal.trajectory.points),
            ),
            path_tolerance=tuple(map(_tolerance, goal.path_tolerance)),
            goal_tolerance=tuple(map(_tolerance, goal.goal_tolerance)),
            goal_time_tolerance=nanoseconds(goal.goal_time_tolerance) / SECOND,
        )
    except ValueError as error:
        raise GoalNotTaken(because("ros.goal.not_finite", error=str(error))) from error


def goal_of_trajectory(trajectory: Any) -> Any:
    """The goal of FollowJointTrajectory that a trajectory_msgs/JointTrajectory is, with the usual tolerances."""
    return make(
        f"{FOLLOW}_Goal",
        trajectory=trajectory,
        multi_dof_trajectory=make(
            "trajectory_msgs/msg/MultiDOFJointTrajectory", header=header_of(0), joint_names=[], points=[]
        ),
        path_tolerance=[],
        component_path_tolerance=[],
        goal_tolerance=[],
        component_goal_tolerance=[],
        goal_time_tolerance=duration_of(0.0),
    )


def joint_jog(message: Any, now: int) -> JogCommand | None:
    """Ours at `now` [ns], of control_msgs/JointJog; None for one that has displacements alone, which are no speed.

    Raises ValueError for a number that is not finite.
    """
    if not len(message.velocities):
        return None
    return JogCommand(stamp=now, name=tuple(message.joint_names), velocity=tuple(message.velocities.tolist()))


def twist_jog(message: Any, now: int, prefix: str) -> JogCommand:
    """Ours at `now` [ns], of geometry_msgs/TwistStamped [m/s, rad/s]; without a frame in that of the base.

    `prefix` is before the names of frames. Raises ValueError for a number that is not finite.
    """
    linear, angular = message.twist.linear, message.twist.angular
    return JogCommand(
        stamp=now,
        linear=(linear.x, linear.y, linear.z),
        angular=(angular.x, angular.y, angular.z),
        frame=message.header.frame_id.removeprefix(prefix),
    )


def _point(point: Any) -> TrajectoryPoint:
    if len(point.effort):
        raise GoalNotTaken(because("ros.goal.effort", remedy("ros_joint_trajectory")))
    return TrajectoryPoint(
        positions=tuple(point.positions.tolist()),
        velocities=tuple(point.velocities.tolist()),
        accelerations=tuple(point.accelerations.tolist()),
        time_from_start=nanoseconds(point.time_from_start) / SECOND,
    )


def _tolerance(tolerance: Any) -> JointTolerance:
    return JointTolerance(
        name=tolerance.name,
        position=tolerance.position,
        velocity=tolerance.velocity,
        acceleration=tolerance.acceleration,
    )


def completed(goal: FollowJointTrajectoryGoal, state: JointState | None) -> FollowJointTrajectoryGoal:
    """The goal for all joints of `state`: those that it does not name stay where they are."""
    trajectory = goal.trajectory
    named = set(trajectory.joint_names)
    rows = zip(state.name, state.position, strict=True) if state is not None else ()
    others = [(name, position) for name, position in rows if name not in named]
    if not others:
        return goal
    names, positions = zip(*others, strict=True)
    rest = (0.0,) * len(names)
    points = tuple(
        TrajectoryPoint(
            positions=each.positions + positions,
            velocities=each.velocities + rest if each.velocities else (),
            accelerations=each.accelerations + rest if each.accelerations else (),
            time_from_start=each.time_from_start,
        )
        for each in trajectory.points
    )
    return replace(goal, trajectory=replace(trajectory, joint_names=trajectory.joint_names + names, points=points))


def follow_feedback(goal_id: bytes, feedback: FollowJointTrajectoryFeedback, generation: ControlMsgs) -> Any:
    """The message of feedback of one goal, in the form of one generation of control_msgs."""
    index = {"index": feedback.index, "multi_dof_index": 0} if generation is ControlMsgs.NEWER else {}
    none = make(
        "trajectory_msgs/msg/MultiDOFJointTrajectoryPoint", generation,
        transforms=[], velocities=[], accelerations=[], time_from_start=duration_of(0.0),
    )  # fmt: skip
    progress = make(
        f"{FOLLOW}_Feedback",
        generation,
        header=header_of(feedback.stamp),
        joint_names=list(feedback.joint_names),
        desired=point_of(feedback.desired),
        actual=point_of(feedback.actual),
        error=point_of(feedback.error),
        multi_dof_joint_names=[],
        multi_dof_desired=none,
        multi_dof_actual=none,
        multi_dof_error=none,
        **index,
    )
    return make(f"{FOLLOW}_FeedbackMessage", generation, goal_id=uuid_of(goal_id), feedback=progress)


def point_of(point: TrajectoryPoint) -> Any:
    """trajectory_msgs/JointTrajectoryPoint."""
    return make(
        POINT,
        positions=_floats(point.positions),
        velocities=_floats(point.velocities),
        accelerations=_floats(point.accelerations),
        effort=_floats(()),
        time_from_start=duration_of(point.time_from_start),
    )


def uuid_of(goal_id: bytes) -> Any:
    """unique_identifier_msgs/UUID of 16 bytes."""
    return make("unique_identifier_msgs/msg/UUID", uuid=np.frombuffer(goal_id, dtype=np.uint8))


def follow_result(result: FollowJointTrajectoryResult) -> Any:
    """The result; our codes below -10 pass, with the sentence that says what they mean."""
    text = str(result.why) if result.why is not None else result.error_string
    return make(f"{FOLLOW}_Result", error_code=int(result.error_code), error_string=text)


def lost_result(text: str) -> Any:
    """Of a goal whose server fell silent; `text` says so."""
    return make(f"{FOLLOW}_Result", error_code=int(FollowErrorCode.DEVICE_FAILED), error_string=text)


def no_result() -> Any:
    """Of a goal that is not known."""
    return make(f"{FOLLOW}_Result", error_code=0, error_string="")


def gripper_goal(goal: Any) -> GripperCommandGoal:
    """Ours, of a control_msgs/GripperCommand goal [m, N]; raises `GoalNotTaken`."""
    try:
        return GripperCommandGoal(position=goal.command.position, max_effort=goal.command.max_effort)
    except ValueError as error:
        raise GoalNotTaken(because("ros.goal.not_finite", error=str(error))) from error


def gripper_feedback(goal_id: bytes, feedback: GripperCommandFeedback) -> Any:
    """The message of feedback of one goal."""
    return make(
        f"{GRIPPER}_FeedbackMessage", goal_id=uuid_of(goal_id), feedback=_gripped(f"{GRIPPER}_Feedback", feedback)
    )


def gripper_result(result: GripperCommandResult | None) -> Any:
    """The result; of a goal that is not known or was lost, nothing reached."""
    return _gripped(f"{GRIPPER}_Result", result or GripperCommandResult())


def _gripped(kind: str, at: GripperCommandFeedback | GripperCommandResult) -> Any:
    return make(kind, position=at.position, effort=at.effort, stalled=at.stalled, reached_goal=at.reached_goal)


def status_in_ros(status: GoalStatusCode) -> int:
    """The number of action_msgs/GoalStatus, which has none for a goal that another one replaced: aborted."""
    return int(GoalStatusCode.ABORTED if status is GoalStatusCode.PREEMPTED else status)


def _floats(values: Vector) -> Any:
    return np.array(values, dtype=np.float64)
