"""Goals as a client of ROS 2 sends them."""

from __future__ import annotations

from typing import Any

from gemelo.libraries.ros2.messages import duration_of, header_of
from gemelo.libraries.ros2.types import FOLLOW, make
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTolerance
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


def _tolerance(tolerance: JointTolerance) -> Any:
    return make(
        "control_msgs/msg/JointTolerance",
        name=tolerance.name,
        position=tolerance.position,
        velocity=tolerance.velocity,
        acceleration=tolerance.acceleration,
    )
