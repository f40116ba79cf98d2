"""Goals as a client of ROS 2 sends them."""

from __future__ import annotations

from typing import Any

from gemelo.libraries.ros2.messages import duration_of, header_of
from gemelo.libraries.ros2.types import FOLLOW, make
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTolerance, JointTrajectory, TrajectoryPoint
from gemelo.services.ros_bridge.core import point_of


def ros_goal(goal: FollowJointTrajectoryGoal) -> Any:
    """The goal of control_msgs/FollowJointTrajectory that says the same as ours."""
    trajectory = goal.trajectory
    return make(
        f"{FOLLOW}_Goal",
        trajectory=make(
            "trajectory_msgs/msg/JointTrajectory",
            header=header_of(trajectory.stamp),
            joint_names=list(trajectory.joint_names),
            points=[point_of(each) for each in trajectory.points],
        ),
        multi_dof_trajectory=make(
            "trajectory_msgs/msg/MultiDOFJointTrajectory", header=header_of(0), joint_names=[], points=[]
        ),
        path_tolerance=[_tolerance(each) for each in goal.path_tolerance],
        component_path_tolerance=[],
        goal_tolerance=[_tolerance(each) for each in goal.goal_tolerance],
        component_goal_tolerance=[],
        goal_time_tolerance=duration_of(goal.goal_time_tolerance),
    )


def quintic(
    names: tuple[str, ...], start: Vector, target: Vector, seconds: float, count: int
) -> FollowJointTrajectoryGoal:
    """As MoveIt sends it: `count` points of a quintic polynomial of so many `seconds` [s], with velocities and
    accelerations, from `start` to `target` [rad] or [m]."""
    way = [b - a for a, b in zip(start, target, strict=True)]

    def point(u: float) -> TrajectoryPoint:
        position = 10 * u**3 - 15 * u**4 + 6 * u**5
        velocity = (30 * u**2 - 60 * u**3 + 30 * u**4) / seconds
        acceleration = (60 * u - 180 * u**2 + 120 * u**3) / seconds**2
        return TrajectoryPoint(
            positions=tuple(a + d * position for a, d in zip(start, way, strict=True)),
            velocities=tuple(d * velocity for d in way),
            accelerations=tuple(d * acceleration for d in way),
            time_from_start=seconds * u,
        )

    points = tuple(point(index / (count - 1)) for index in range(count))
    return FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=names, points=points))


def _tolerance(tolerance: JointTolerance) -> Any:
    return make(
        "control_msgs/msg/JointTolerance",
        name=tolerance.name,
        position=tolerance.position,
        velocity=tolerance.velocity,
        acceleration=tolerance.acceleration,
    )
