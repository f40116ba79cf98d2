"""Goals, plans, and refusals that explain themselves."""

from __future__ import annotations

from enum import IntEnum

from schemas.joints import JointState
from schemas.message import Message, Vector
from schemas.motion import JointTrajectory


class PoseGoal(Message, frozen=True, kw_only=True, tag="pose"):
    """Tool position and, for arms that can, orientation, in `frame` (empty: the base)."""

    position: Vector = ()  # (3,) [m]
    orientation: Vector = ()  # (x, y, z, w); empty: any
    frame: str = ""


class JointGoal(Message, frozen=True, kw_only=True, tag="joints"):
    """Values of some or all joints; the others keep theirs."""

    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]


class NamedGoal(Message, frozen=True, kw_only=True, tag="named"):
    """A group state of the SRDF."""

    name: str = ""


class PlanRequest(Message, frozen=True, kw_only=True):
    """What to plan; scaling is in (0, 1], and 0 is refused."""

    goal: PoseGoal | JointGoal | NamedGoal = NamedGoal()
    start: JointState | None = None  # absent: where the arm is now
    velocity_scaling: float = 1.0
    acceleration_scaling: float = 1.0
    allowed_time: float = 1.0  # [s]


class PlanCode(IntEnum):
    """The codes of moveit_msgs/MoveItErrorCodes that apply."""

    SUCCESS = 1
    FAILURE = 99999
    PLANNING_FAILED = -1
    TIMED_OUT = -6
    START_STATE_IN_COLLISION = -10
    GOAL_IN_COLLISION = -12
    GOAL_VIOLATES_PATH_CONSTRAINTS = -13
    INVALID_GOAL_CONSTRAINTS = -17
    INVALID_ROBOT_STATE = -18
    FRAME_TRANSFORM_FAILURE = -21
    ROBOT_STATE_STALE = -23
    NO_IK_SOLUTION = -31


class Refusal(Message, frozen=True, kw_only=True):
    """Why there is no plan: the check, the thing, its value and limit, and what would do."""

    check: str = ""  # for example "joint limit", "reach", "self-collision"
    subject: str = ""  # joint, link pair or pose axis
    value: float | None = None
    limit: float | None = None
    nearest: Vector = ()  # the nearest goal that can be reached, in the goal's own form
    message: str = ""  # one sentence for a person
    remedy: str = ""


class PlanResponse(Message, frozen=True, kw_only=True):
    """A verified, timed trajectory, or a refusal."""

    code: PlanCode = PlanCode.FAILURE
    trajectory: JointTrajectory = JointTrajectory()
    refusal: Refusal | None = None
    planning_time: float = 0.0  # [s]
    duration: float = 0.0  # [s] of the trajectory
    tool_goal: Vector = ()  # (3,) [m] where the tool will be


class PlannedPath(Message, frozen=True, kw_only=True):
    """The way the tool will take in the base frame, for eyes."""

    stamp: int = 0  # [ns] UNIX time
    frame: str = ""
    points: tuple[tuple[float, float, float], ...] = ()  # [m]
