"""Goals, plans, and refusals that explain themselves."""

from __future__ import annotations

from enum import IntEnum, StrEnum

from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import Message, Vector, has_finite_sum
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.reasons import Reason
from gemelo.schemas.scene import Contact, SceneObject


class PoseGoal(Message, frozen=True, kw_only=True, tag="pose"):
    """A tool pose in `frame` (empty: the base): a position, and as much of an orientation as is asked for."""

    position: Vector = ()  # (3,) [m]
    orientation: Vector = ()  # (x, y, z, w); empty: any
    frame: str = ""
    free_axis: Vector = ()  # (3,) in the tool frame: with an orientation, turning about it is free
    tool_axis: Vector = ()  # (3,) in the tool frame: this axis is to point along `direction`; then no orientation
    direction: Vector = ()  # (3,) in `frame`
    position_tolerance: float = 0.0  # [m] 0: exact
    orientation_tolerance: float = 0.0  # [rad] 0: exact


class JointGoal(Message, frozen=True, kw_only=True, tag="joints"):
    """Values of some or all joints; the others keep theirs."""

    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]


class NamedGoal(Message, frozen=True, kw_only=True, tag="named"):
    """A group state of the SRDF."""

    name: str = ""


class WaypointGoal(Message, frozen=True, kw_only=True, tag="waypoints"):
    """Goals to be passed in order; the arm stops at the last one only, where `blend` allows it."""

    points: tuple[PoseGoal | JointGoal | NamedGoal, ...] = ()
    blend: float = 0.0  # [m] of the tool around a point within which it may be cut


Goal = PoseGoal | JointGoal | NamedGoal | WaypointGoal


MOST_ATTEMPTS = 1000


class FreeMotion(Message, frozen=True, kw_only=True, tag="free"):
    """Any way that touches nothing."""

    planner_id: str = ""  # a name of `planners.PLANNERS`; "": the default
    seed: int = 0  # the same seed, the same plan
    attempts: int = 1  # to 1000: as many times as usual is looked for a shorter way, by the native planner


class PointToPoint(Message, frozen=True, kw_only=True, tag="ptp"):
    """The straight line of the joints, or a refusal."""


class LinearMotion(Message, frozen=True, kw_only=True, tag="lin"):
    """The tool on a straight line, its orientation turning evenly."""

    speed: float = 0.0  # [m/s] of the tool; 0: as fast as the joints can
    acceleration: float = 0.0  # [m/s^2] of the tool; 0: as the joints can
    max_step: float = 0.0  # [m] between checked points; 0: the planner's own
    jump_threshold: float = 0.0  # [rad] or [m] a joint may move between them; 0: the planner's own
    least_fraction: float = 1.0  # of the way that must be possible; less is refused


class CircularMotion(Message, frozen=True, kw_only=True, tag="circ"):
    """The tool on an arc to the goal."""

    interim: Vector = ()  # (3,) [m] a point on the arc, in the goal's frame
    center: Vector = ()  # (3,) [m] or its centre: then the shorter arc
    speed: float = 0.0  # [m/s] of the tool; 0: as fast as the joints can
    acceleration: float = 0.0  # [m/s^2] of the tool; 0: as the joints can
    max_step: float = 0.0  # [m] between checked points; 0: the planner's own
    jump_threshold: float = 0.0  # [rad] or [m] a joint may move between them; 0: the planner's own
    least_fraction: float = 1.0  # of the way that must be possible; less is refused


Motion = FreeMotion | PointToPoint | LinearMotion | CircularMotion


class Timing(StrEnum):
    """How a path gets its time."""

    JERK_LIMITED = "jerk_limited"  # ruckig
    TIME_OPTIMAL = "time_optimal"  # toppra, without a jerk limit


class StepPolicy(StrEnum):
    """What becomes of a trajectory that asks more of the steppers than they have."""

    SLOW_DOWN = "slow_down"
    REFUSE = "refuse"


class PlanRequest(Message, frozen=True, kw_only=True):
    """What to plan; scaling is in (0, 1], and 0 is refused."""

    goal: Goal = NamedGoal()
    start: JointState | None = None  # absent: where the arm is now
    velocity_scaling: float = 1.0
    acceleration_scaling: float = 1.0
    allowed_time: float = 1.0  # [s]
    clearance: float | None = None  # [m] to keep between what may not touch; absent: the robot's own
    motion: Motion = FreeMotion()
    timing: Timing = Timing.JERK_LIMITED
    step_policy: StepPolicy = StepPolicy.SLOW_DOWN
    request_id: str = ""  # the client's own, for `plan/progress` and `plan/cancel`; empty: the planner makes one


class PlanCode(IntEnum):
    """The codes of moveit_msgs/MoveItErrorCodes that apply."""

    SUCCESS = 1
    FAILURE = 99999
    PLANNING_FAILED = -1
    TIMED_OUT = -6
    PREEMPTED = -7  # cancelled
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
    configuration: Vector = ()  # [rad] or [m] of all joints, where the arm would touch something
    nearest_free: Vector = ()  # [rad] or [m] of all joints, the nearest to a start that touches at which nothing does
    message: str = ""  # one sentence for a person
    remedy: str = ""
    why: Reason | None = None  # both as data


class StepMargin(Message, frozen=True, kw_only=True):
    """How near a trajectory comes to what one stepper can do."""

    name: str = ""
    peak_rate: float = 0.0  # [steps/s]
    rate_limit: float = 0.0  # [steps/s] of driver, tick and configuration
    share: float = 0.0  # of the limit that binds, pull-out torque included: 1 is all
    limited_by: str = ""  # "step rate", "pulse width" or "pull-out torque"

    def __post_init__(self) -> None:
        """As of any message, by one look at all numbers together: a plan has one of each joint."""
        if not has_finite_sum((self.peak_rate, self.rate_limit, self.share)):
            super().__post_init__()


class PlanningTimes(Message, frozen=True, kw_only=True):
    """Where the time went [s]."""

    ik: float = 0.0
    search: float = 0.0
    smoothing: float = 0.0
    timing: float = 0.0
    verification: float = 0.0


class PlanResponse(Message, frozen=True, kw_only=True):
    """A verified, timed trajectory, or a refusal."""

    code: PlanCode = PlanCode.FAILURE
    trajectory: JointTrajectory = JointTrajectory()
    refusal: Refusal | None = None
    planning_time: float = 0.0  # [s]
    duration: float = 0.0  # [s] of the trajectory
    tool_goal: Vector = ()  # (3,) [m] where the tool will be
    fraction: float = 1.0  # of a Cartesian way that the trajectory goes, or, with a refusal, could have gone
    stopped_by: Refusal | None = None  # why it goes no further
    margins: tuple[StepMargin, ...] = ()
    slowed: float = 1.0  # the time scale that step_policy SLOW_DOWN has used; 1: none
    times: PlanningTimes = PlanningTimes()
    planner_id: str = ""  # that found the way
    scene_version: int | None = None  # of the planning scene it is free of; absent: of a planner that knows none
    scene_epoch: int | None = None  # of the same scene; a goal carries both


class PlanInputs(Message, frozen=True, kw_only=True):
    """What the planner has made its next answer from, beside the question: enough to make the same answer again."""

    stamp: int = 0  # [ns] UNIX time of the answer
    number: int = 0  # of the answer since the planner started, from 1
    planned: bool = False  # false: refused or cancelled before any process had planned it
    present: JointState | None = None  # the newest joint state when the plan began
    age: float = 0.0  # [s] of that state
    scene_version: int = 0  # of the planning scene
    scene_epoch: int = 0
    jaws: tuple[SceneObject, ...] = ()  # the gripper's, which stand in no scene
    elapsed: float = 0.0  # [s] that the plan took; near the time allowed, the clock may have ended a search


class SceneVersion(Message, frozen=True, kw_only=True):
    """Which scene something was made in: the scene itself is on `scene`."""

    version: int = 0
    epoch: int = 0
    jaws: tuple[SceneObject, ...] = ()  # the gripper's, which stand in no scene


class AnswerInputs(Message, frozen=True, kw_only=True):
    """What the planner has made an answer to `ik`, `fk`, `state_validity` or `scene/edit` from, beside the question."""

    stamp: int = 0  # [ns] UNIX time just before the answer; of `scene/edit` that of the changed scene
    request: str = ""  # its key
    number: int = 0  # of the answer to this request since the planner started, from 1
    present: JointState | None = None  # the newest joint state
    age: float = 0.0  # [s] of that state
    scene: SceneVersion = SceneVersion()  # of `scene/edit` the one before it, with the jaws as they are after it


class PlanCancel(Message, frozen=True, kw_only=True):
    """End a plan that waits or is being made; its own answer is then PREEMPTED."""

    request_id: str = ""


class PlanCancelResult(Message, frozen=True, kw_only=True):
    """Whether there was such a plan, and a sentence that says what becomes of it."""

    found: bool = False
    message: str = ""
    why: Reason | None = None  # `message` as data


class PlanPhase(StrEnum):
    """What a plan is at."""

    WAITING = "waiting"  # for a process that is free, or takes in the scene
    IK = "ik"
    SEARCH = "search"
    SMOOTHING = "smoothing"
    TIMING = "timing"
    VERIFICATION = "verification"


class PlanProgress(Message, frozen=True, kw_only=True):
    """How one plan stands, 10 times a second once it has lasted 0.1 s."""

    stamp: int = 0  # [ns] UNIX time
    request_id: str = ""
    phase: PlanPhase = PlanPhase.WAITING
    elapsed: float = 0.0  # [s] since it was asked for, waiting included
    allowed: float = 0.0  # [s] for all but the waiting


class PlannedPath(Message, frozen=True, kw_only=True):
    """The way the tool will take in the base frame, for display."""

    stamp: int = 0  # [ns] UNIX time
    frame: str = ""
    points: tuple[tuple[float, float, float], ...] = ()  # [m]
    name: tuple[str, ...] = ()  # joints
    positions: tuple[Vector, ...] = ()  # [rad] or [m] a row for every point
    times: Vector = ()  # [s] from the start, of every point


class IkRequest(Message, frozen=True, kw_only=True):
    """Joint values for a tool pose."""

    goal: PoseGoal = PoseGoal()
    near: JointState | None = None  # absent: where the arm is now
    solutions: int = 1  # at most so many distinct ones, the nearest first
    avoid_collisions: bool = True


class IkSolution(Message, frozen=True, kw_only=True):
    """One configuration."""

    position: Vector = ()  # [rad] or [m]
    distance: float = 0.0  # [s] that the slowest joint takes from `near`


class IkResponse(Message, frozen=True, kw_only=True):
    """The configurations, or why there is none."""

    code: PlanCode = PlanCode.FAILURE
    name: tuple[str, ...] = ()
    solutions: tuple[IkSolution, ...] = ()
    refusal: Refusal | None = None


class ValidityRequest(Message, frozen=True, kw_only=True):
    """A configuration to check; joints that are not named stand as they do now."""

    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]


class ValidityResponse(Message, frozen=True, kw_only=True):
    """Whether an arm at rest there is within its limits and keeps the clearance; the refusal says what does not."""

    code: PlanCode = PlanCode.FAILURE
    refusal: Refusal | None = None
    contacts: tuple[Contact, ...] = ()  # the pairs nearer than the clearance


class FkRequest(Message, frozen=True, kw_only=True):
    """Poses of links for joint values; joints that are not named stand as they do now."""

    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m]
    links: tuple[str, ...] = ()  # empty: the tool


class FkResponse(Message, frozen=True, kw_only=True):
    """The poses in the base frame, or why there is none."""

    code: PlanCode = PlanCode.FAILURE
    links: tuple[str, ...] = ()
    poses: tuple[Transform, ...] = ()
    refusal: Refusal | None = None


class PoseTarget(Message, frozen=True, kw_only=True):
    """A streamed pose of the tool in the base; the newest one wins. The arm stops when no more come."""

    stamp: int = 0  # [ns] UNIX time of the sender
    position: Vector = ()  # (3,) [m]
    orientation: Vector = ()  # unit quaternion (x, y, z, w); empty: the tool stays turned as it was at the first target


class JogCommand(Message, frozen=True, kw_only=True):
    """How to move now; to be said again within 0.1 s, or the arm stops. Joint speeds, or a twist of the tool."""

    stamp: int = 0  # [ns] UNIX time
    name: tuple[str, ...] = ()  # joints
    velocity: Vector = ()  # [rad/s] or [m/s]
    linear: Vector = ()  # (3,) [m/s] of the tool in `frame`
    angular: Vector = ()  # (3,) [rad/s]
    frame: str = ""  # empty: the base; the tool's own name: the tool


class JogLimit(Message, frozen=True, kw_only=True):
    """What slows a jog: the check, the thing, how it stands now and the limit."""

    check: str = ""  # "joint limit", "collision", "contact", "singularity", "speed limit", "reach", "command"
    subject: str = ""  # joint or pair of links and objects
    value: float | None = None  # [rad] or [m] of the joint, [m] between the pair, share of the manipulability
    limit: float | None = None
    message: str = ""  # for a person
    why: Reason | None = None  # the same as data


class JogStatus(Message, frozen=True, kw_only=True):
    """What becomes of the jog commands, 10 times a second while there are some."""

    stamp: int = 0  # [ns] UNIX time
    active: bool = False
    scale: float = 1.0  # of the commanded speed that is left
    limited_by: str = ""  # the sentences of `limits`, or why there is no jogging; empty: nothing
    manipulability: float = 0.0
    limits: tuple[JogLimit, ...] = ()
    client: str = ""  # the node that it is about, while somebody holds control; empty: everybody
    check: str = ""  # "control": somebody else holds it
    why: Reason | None = None  # there is no jogging, as data; absent where `limits` say what slows it


class StreamPath(Message, frozen=True, kw_only=True):
    """What the gateway is about to send of a stream of targets: the next tenth of a second, and the stop behind it."""

    stamp: int = 0  # [ns] UNIX time
    session: int = 0  # of the gateway
    number: int = 0  # in this session
    name: tuple[str, ...] = ()
    positions: tuple[Vector, ...] = ()  # [rad] or [m] from where it goes on, 25 ms apart at most
    margin: float = 0.0  # [m] that is to stay free; 0: the robot's own clearance


class StreamVerdict(Message, frozen=True, kw_only=True):
    """The planner's answer to one `StreamPath`."""

    stamp: int = 0  # [ns] UNIX time
    session: int = 0  # of the gateway, as in the path
    number: int = 0
    free: bool = False
    limit: JogLimit | None = None  # what is in the way


class JogTaken(Message, frozen=True, kw_only=True, tag="taken"):
    """A command that the jog has taken."""

    now: float = 0.0  # [s] of the planner's monotonic clock
    command: JogCommand = JogCommand()
    client: str = ""  # the node that has said it
    begins: bool = False  # after a silence in which the jog has stood: nothing before it counts


class JogTick(Message, frozen=True, kw_only=True, tag="tick"):
    """One period of the jog, and a checksum of what it has said in it."""

    now: float = 0.0  # [s] of the planner's monotonic clock
    stamp: int = 0  # [ns] UNIX time
    present: JointState | None = None  # the newest joint state
    age: float = 0.0  # [s] of that state
    goal_is_active: bool = False
    not_ready: str = ""  # why the device does not move
    scene: SceneVersion | None = None  # None: as in the tick before
    told_to: str = ""  # the node that a status is about
    said: str = ""  # BLAKE2 of target and status in msgpack, without reasons as data; empty: neither
    why: Reason | None = None  # `not_ready` as data


class JogInputs(Message, frozen=True, kw_only=True):
    """What the planner has jogged from for half a second: enough to jog the same way again."""

    stamp: int = 0  # [ns] UNIX time
    number: int = 0  # since the planner started, from 0
    inputs: tuple[JogTaken | JogTick, ...] = ()  # in their order
