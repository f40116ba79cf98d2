"""Plans: asked of the planner, shown while they are made, cancelled by Ctrl-C, and refused with the nearest goal.

With `targets` the only place that knows the planner's messages.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue

import msgspec
from msgspec.structs import replace

from gemelo.api.arguments import Joints, Target, ToolGoal
from gemelo.api.errors import Error, Interrupted, Lost, Refused
from gemelo.api.session import Session, answer_of
from gemelo.api.targets import as_target, named_joints
from gemelo.api.units import Pose, pose_from
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.clock import token
from gemelo.libraries.runtime.requests.client import PendingCall
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.motion import JointTrajectory
from gemelo.schemas.planning import (
    FkRequest,
    IkRequest,
    IkResponse,
    JointGoal,
    PlanCancel,
    PlanCode,
    PlanProgress,
    PlanRequest,
    PlanResponse,
    PoseGoal,
    Refusal,
    StepMargin,
    ValidityRequest,
)
from gemelo.schemas.reasons import Reason, Remedy, because, plain, remedy
from gemelo.schemas.scene import Contact
from gemelo.schemas.text_file import NotUtf8, read_text
from gemelo.schemas.topics import DEVICE_STATE, FK, IK, PLAN, PLAN_CANCEL, PLAN_PROGRESS, STATE_VALIDITY

MARGIN = 2.0  # [s] that a planner may take beyond its allowed time before it counts as gone
TO_CANCEL = 0.5  # [s] for its answer to a cancel
KINEMATICS = 10.0  # [s] for ik and fk
COMING_TO_REST = 1.0  # [s] chosen: the slowest joint of both arms stops from full speed in 0.6 s
LOOK_AGAIN = 0.02  # [s] until the planner is asked again, about two of its joint states

OnPlanProgress = Callable[[PlanProgress], object]


@dataclass(frozen=True, repr=False)
class Plan:
    """A verified trajectory that has not been executed, and what is known of it.

    >>> plan = arm.plan(named="left")
    >>> plan
    <Plan rm1: named='left', ... s>
    >>> plan.duration > 0.0, plan.end["brazo_joint"] == plan.trajectory.points[-1].positions[0]
    (True, True)
    """

    robot: str
    target: Target  # the arguments that it was made of; empty where it was made of a `PlanRequest`
    response: PlanResponse  # everything that the planner has said

    @property
    def duration(self) -> float:
        """[s] that it takes at full speed.

        >>> 0.1 < arm.plan(named="left").duration < 60.0
        True
        """
        return self.response.duration

    @property
    def trajectory(self) -> JointTrajectory:
        """Timed points: positions, velocities and accelerations of all joints.

        >>> arm.plan(named="left").trajectory.joint_names == arm.joint_names
        True
        """
        return self.response.trajectory

    @property
    def margins(self) -> dict[str, StepMargin]:
        """By joint, how near it comes to what its stepper can do; `share` 1 is all.

        >>> all(0.0 <= margin.share <= 1.0 for margin in arm.plan(named="left").margins.values())
        True
        """
        return {margin.name: margin for margin in self.response.margins}

    @property
    def end(self) -> dict[str, float]:
        """Joint values [rad] or [m] where it ends: `arm.plan(from_joints=plan.end, ...)` goes on from there.

        >>> arm.plan(named="home", from_joints=arm.plan(named="left").end).duration > 0.0
        True
        """
        last = self.trajectory.points[-1].positions
        return dict(zip(self.trajectory.joint_names, last, strict=True))

    @property
    def planner(self) -> str:
        """The planner that found the path.

        >>> arm.plan(named="left").planner
        'straight'
        """
        return self.response.planner_id

    @property
    def planning_time(self) -> float:
        """[s] that the planner took.

        >>> arm.plan(named="left").planning_time < 5.0
        True
        """
        return self.response.planning_time

    def save(self, path: str) -> None:
        """Writes it as JSON, for `Plan.load`.

        >>> arm.plan(named="left").save(folder + "/plan.json")
        """
        with open(path, "wb") as file:
            file.write(
                msgspec.json.encode({"robot": self.robot, "target": _plain(self.target), "response": self.response})
            )

    @classmethod
    def load(cls, path: str) -> Plan:
        """A plan that was saved; raises `gemelo.Error` where the file holds none.

        >>> arm.plan(named="left").save(folder + "/plan.json")
        >>> gemelo.Plan.load(folder + "/plan.json")
        <Plan rm1: named='left', ... s>
        """
        try:
            saved = msgspec.json.decode(read_text(Path(path)), type=SavedPlan)
        except (OSError, NotUtf8, msgspec.MsgspecError) as error:
            raise Error(because("client.plan.no_file", path=str(path), error=str(error))) from error
        return cls(saved.robot, Target(**saved.target), saved.response)  # type: ignore[typeddict-item]

    def __repr__(self) -> str:
        return f"<Plan {self.robot}: {words_of(self.target) or 'as requested'}, {self.duration:.2f} s>"


class SavedPlan(msgspec.Struct, frozen=True, kw_only=True):
    """The file that `Plan.save` writes."""

    robot: str
    target: dict[str, object]
    response: PlanResponse


class Configurations(list[dict[str, float]]):
    """What `arm.ik` found: joint values [rad] or [m] by name, the nearest first, and how far each is.

    >>> found = arm.ik(position=(0.25, 0.15, 0.10), solutions=2)
    >>> len(found) == len(found.distances), found.distances[0] <= found.distances[-1]
    (True, True)
    """

    def __init__(self, response: IkResponse) -> None:
        super().__init__(dict(zip(response.name, found.position, strict=True)) for found in response.solutions)
        self.response = response  # everything that the planner has said
        self.distances = tuple(found.distance for found in response.solutions)  # [s] that the slowest joint takes


def make_plan(session: Session, asked: PlanRequest, target: Target, on_progress: OnPlanProgress | None = None) -> Plan:
    """A verified trajectory; raises `Refused` or `Lost`. Ctrl-C ends it, and nothing moves: `Interrupted`.

    A plan begins at rest: an arm that is just coming to rest is waited for, `COMING_TO_REST` at most.
    """
    until = session.node.monotonic() + COMING_TO_REST
    while True:
        request = replace(asked, request_id=token(session.clock))
        response = _ask(session, request, on_progress)
        if not _is_moving_start(response) or session.node.monotonic() > until:
            break
        session.wait_for(lambda: False, LOOK_AGAIN)  # the end of a jog, of a stream or of a stop
    if response.refusal is not None:
        _require_no_homing(session, response.refusal)
        raise refused(session.description, response.refusal, request, target, response.code)
    if not response.trajectory.points:
        raise Refused(because("client.plan.no_trajectory", answer=response.code.name), code=response.code)
    return Plan(session.description.name, target, response)


def _require_no_homing(session: Session, refusal: Refusal) -> None:
    """A start that cannot be planned from is no fault of the joints' while they look for their switches: raises
    `Refused`."""
    if refusal.check not in OF_THE_START:
        return
    state = session.latest(DEVICE_STATE)
    session.wait_for(lambda: state.message is not None, LOOK_AGAIN * 3)
    if state.message is not None and state.message.mode is DeviceMode.HOMING:
        reason = because("client.plan.homing")
        said = because("client.refused", reason)
        raise Refused(said, check="homing", reason=reason, code=PlanCode.INVALID_ROBOT_STATE)


def find_configurations(session: Session, request: IkRequest, target: ToolGoal) -> Configurations:
    """Joint values [rad] or [m] that bring the tool there, the nearest first; raises `Refused`."""
    response = session.call(IK, request, KINEMATICS)
    if response.refusal is not None:
        raise refused(
            session.description, response.refusal, PlanRequest(goal=request.goal), as_target(target), response.code
        )
    return Configurations(response)


def find_poses(session: Session, joints: Joints | None, links: tuple[str, ...]) -> dict[str, Pose]:
    """By link, its pose in the base frame for joint values; joints that are not named stand as they do now."""
    values = named_joints(session.description, joints, "joints") if joints is not None else {}
    request = FkRequest(name=tuple(values), position=tuple(values.values()), links=links)
    response = session.call(FK, request, KINEMATICS)
    if response.refusal is not None:
        raise refused(session.description, response.refusal, PlanRequest(), Target(), response.code)
    return {link: pose_from(pose) for link, pose in zip(response.links, response.poses, strict=True)}


def require_valid(session: Session, joints: Joints) -> None:
    """Raises `Refused` where the arm may not stand, with the nearest joint values at which it may."""
    values = named_joints(session.description, joints, "joints")
    request = ValidityRequest(name=tuple(values), position=tuple(values.values()))
    response = session.call(STATE_VALIDITY, request, KINEMATICS)
    if response.refusal is not None:
        goal = PlanRequest(goal=JointGoal(name=request.name, position=request.position))
        raise refused(
            session.description, response.refusal, goal, Target(joints=joints), response.code, response.contacts
        )


def refused(
    arm: ArmDescription,
    refusal: Refusal,
    request: PlanRequest,
    target: Target,
    code: int,
    contacts: tuple[Contact, ...] = (),
) -> Refused:
    """The refusal as an exception, with the nearest goal as arguments."""
    nearest = _nearest(arm, refusal, request, target)
    return Refused(
        whole_reason(refusal, remedy("nearest_that_can", arguments=words_of(nearest)) if nearest else None),
        check=refusal.check,
        subject=refusal.subject,
        value=refusal.value,
        limit=refusal.limit,
        nearest=nearest,
        remedy=refusal.remedy,
        configuration=_by_joint(arm, refusal.configuration),
        nearest_free=_by_joint(arm, refusal.nearest_free),
        code=code,
        reason=refusal.why or refusal.message,
        refusal=refusal,
        contacts=contacts,
    )


def whole_reason(refusal: Refusal, nearest: Remedy | None) -> Reason:
    """The refusal with its check before it, and `nearest`, as the reader would write it, in place of its remedies."""
    why = refusal.why or plain(refusal.message)
    would_do = why.remedies if refusal.why is not None or not refusal.remedy else (remedy("do", what=refusal.remedy),)
    would_do = would_do if nearest is None else (nearest,)
    cause = replace(why, remedies=())
    if not refusal.check:
        return because("refused.plan", cause, *would_do)
    return because("refused.plan.check", cause, *would_do, check=refusal.check)


def words_of(target: Mapping[str, object]) -> str:
    """The arguments as they would be written, numbers rounded to 0.1 mm."""
    return ", ".join(f"{name}={_short(value)}" for name, value in target.items())


def _nearest(arm: ArmDescription, refusal: Refusal, request: PlanRequest, target: Target) -> Target:
    """The nearest goal that can, in the form of the target; empty where there is none."""
    values, goal = refusal.nearest, request.goal
    sizes = (3, 6, 7) if isinstance(goal, PoseGoal) else (len(arm.joints), len(getattr(goal, "name", ())))
    if not values or refusal.check in NOT_THE_GOAL or len(values) not in sizes:
        return Target()
    kept = {name: value for name, value in target.items() if name not in GOALS}
    if isinstance(goal, PoseGoal):
        found: dict[str, object] = {"position": tuple(round(value, 6) for value in values[:3])}
        if values[3:]:
            found["along" if goal.tool_axis else "orientation"] = values[3:]
        return Target(**{**kept, **found})  # type: ignore[typeddict-item]
    names = goal.name if isinstance(goal, JointGoal) and len(goal.name) == len(values) else arm.joint_names
    return Target(**{**kept, "joints": dict(zip(names, values, strict=False))})  # type: ignore[typeddict-item]


OF_THE_START = ("start state", "moving start")  # checks of where the arm is, not of where it is to go
NOT_THE_GOAL = ("start state",)  # checks whose nearest value is of something else
GOALS = ("named", "joints", "position", "orientation", "rpy", "pose", "offset", "along")


def _by_joint(arm: ArmDescription, values: tuple[float, ...]) -> dict[str, float]:
    return dict(zip(arm.joint_names, values, strict=True)) if values else {}


def _short(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}" if abs(value) < 1e-4 else f"{value:.4f}".rstrip("0").rstrip(".")
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name!r}: {_short(each)}" for name, each in value.items()) + "}"
    if isinstance(value, tuple | list):
        return "(" + ", ".join(_short(each) for each in value) + ")"
    return repr(value)


def _plain(target: Target) -> dict[str, object]:
    """What JSON can hold of it."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in target.items()}


def _is_moving_start(response: PlanResponse) -> bool:
    return response.refusal is not None and response.refusal.check == "moving start"


def _ask(session: Session, request: PlanRequest, on_progress: OnPlanProgress | None) -> PlanResponse:
    """The planner's answer; at Ctrl-C the plan is cancelled, and `Interrupted` raised with what the planner says."""
    heard: SimpleQueue[PlanProgress] = SimpleQueue()
    timeout = request.allowed_time + MARGIN
    call: PendingCall[PlanRequest, PlanResponse] | None = None

    def hear(progress: PlanProgress) -> None:
        heard.put(progress)
        session.notify()

    def tell() -> None:
        while on_progress is not None and not heard.empty():
            progress = heard.get()
            if progress.request_id == request.request_id:
                on_progress(progress)

    shown = session.node.subscribe(PLAN_PROGRESS, hear) if on_progress is not None else None
    try:
        call = session.ask(PLAN, request, timeout)
        session.wait_for(lambda: call.is_over, timeout, tell if on_progress is not None else None)
        return answer_of(call)
    except Lost:
        _cancel(session, request)  # it may be waiting behind the plans of others
        raise
    except KeyboardInterrupt:
        raise _interrupted(session, request, call, tell) from None
    finally:
        if shown is not None:
            shown.close()


def _interrupted(
    session: Session,
    request: PlanRequest,
    call: PendingCall[PlanRequest, PlanResponse] | None,
    tell: Callable[[], None],
) -> Interrupted:
    """Cancels, and waits for the planner's last word; a second Ctrl-C leaves at once."""
    tell()
    _cancel(session, request)
    said = because("client.plan.canceled")
    with suppress(Lost, Refused):
        if call is not None and session.wait_for(lambda: call.is_over, MARGIN, tell):
            refusal = answer_of(call).refusal
            said = (refusal.why or plain(refusal.message)) if refusal is not None else because("client.plan.just_made")
    return Interrupted(because("client.plan.interrupted", replace(said, remedies=())))


def _cancel(session: Session, request: PlanRequest) -> None:
    """A planner that cannot be cancelled is left to its allowed time."""
    with suppress(Lost, Refused):
        session.call(PLAN_CANCEL, PlanCancel(request_id=request.request_id), TO_CANCEL)
