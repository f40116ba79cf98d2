"""Trajectories and the action that follows them, as trajectory_msgs and control_msgs have them."""

from __future__ import annotations

import math
from enum import IntEnum

from gemelo.schemas.message import Message, Vector
from gemelo.schemas.reasons import Reason

MOST_POINTS = (
    100_000  # of a trajectory; chosen: half an hour at the gateway's own knots, and the device follows no more
)


class TrajectoryPoint(Message, frozen=True, kw_only=True):
    """One point of a trajectory; `velocities` and `accelerations` may be empty.

    The fields present choose the interpolation: positions only is linear, with velocities cubic,
    with accelerations quintic.
    """

    positions: Vector = ()  # [rad] or [m]
    velocities: Vector = ()  # [rad/s] or [m/s]
    accelerations: Vector = ()  # [rad/s^2] or [m/s^2]
    time_from_start: float = 0.0  # [s]

    def __post_init__(self) -> None:
        """As of any message, by one look at all numbers together: a trajectory has hundreds of points."""
        try:
            if math.isfinite(sum(self.positions + self.velocities + self.accelerations, self.time_from_start)):
                return
        except (TypeError, OverflowError):
            pass
        super().__post_init__()


class JointTrajectory(Message, frozen=True, kw_only=True):
    """Timed points for `joint_names`; every point lists the joints in that order."""

    stamp: int = 0  # [ns] UNIX time by stepper_gateway's clock, as in joint_states, at which it is to start; 0: now
    joint_names: tuple[str, ...] = ()
    points: tuple[TrajectoryPoint, ...] = ()


class JointTolerance(Message, frozen=True, kw_only=True):
    """The tolerance of joint `name`: 0 means the default, -1 means no bound, another negative value is refused."""

    name: str = ""
    position: float = 0.0  # [rad] or [m]
    velocity: float = 0.0  # [rad/s] or [m/s]; the default is no bound
    acceleration: float = 0.0  # [rad/s^2] or [m/s^2]; a bound is refused: no acceleration is measured


class FollowJointTrajectoryGoal(Message, frozen=True, kw_only=True):
    """A trajectory to execute and how exactly."""

    trajectory: JointTrajectory = JointTrajectory()
    path_tolerance: tuple[JointTolerance, ...] = ()
    goal_tolerance: tuple[JointTolerance, ...] = ()
    goal_time_tolerance: float = 0.0  # [s] 0 is the default of the gateway, which is finite
    scene_version: int | None = None  # of the planning scene it is free of; absent: not planned in one
    scene_epoch: int | None = None  # of the same scene; absent: not known, the version alone is compared
    after: str = ""  # goal under way at whose end this one begins, without a pause; empty: it begins at once


class FollowJointTrajectoryFeedback(Message, frozen=True, kw_only=True):
    """The progress of an execution, 20 times a second."""

    stamp: int = 0  # [ns] UNIX time
    joint_names: tuple[str, ...] = ()
    desired: TrajectoryPoint = TrajectoryPoint()
    actual: TrajectoryPoint = TrajectoryPoint()
    error: TrajectoryPoint = TrajectoryPoint()  # desired - actual
    index: int = 0  # of the trajectory point that is being approached
    points: int = 0  # how many points the trajectory has
    elapsed: float = 0.0  # [s] along the trajectory
    duration: float = 0.0  # [s] of the whole trajectory


class FollowErrorCode(IntEnum):
    """The codes of control_msgs/FollowJointTrajectory, and ours below -10."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5
    CANCELED = -10
    PREEMPTED = -11
    DEVICE_FAILED = -12
    SCENE_CHANGED = -13
    NOT_IN_CONTROL = -14  # somebody else holds control


class FollowJointTrajectoryResult(Message, frozen=True, kw_only=True):
    """The result of an execution; success means that the executed steps were read back, unless it is not verified."""

    error_code: FollowErrorCode = FollowErrorCode.SUCCESSFUL
    error_string: str = ""
    joint_names: tuple[str, ...] = ()
    commanded_steps: tuple[int, ...] = ()  # [steps] absolute, at the end
    executed_steps: tuple[int, ...] = ()  # [steps] absolute, as the device reported it
    max_following_error: Vector = ()  # [steps] largest |commanded - executed| on the way
    final_error: Vector = ()  # [steps] goal - executed at the end; commanded - executed where another goal followed
    duration: float = 0.0  # [s] from acceptance to result
    verified: bool = True  # false: all was sent, and what was executed is not known; the executed steps are empty then
    why: Reason | None = None  # `error_string` as data
