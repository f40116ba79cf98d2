"""Refusals of a plan: each names the check, the thing, its value, its limit and what would do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum

from gemelo.libraries.arm.errors import nearest_name, suggestion
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import MOST_POINTS
from gemelo.schemas.planning import PlanCode, PlanResponse, Refusal
from gemelo.schemas.robot import LEAST_CLEARANCE, MOST_CLEARANCE

Point = Sequence[float]

# Tuning constants: chosen, where a line does not say measured or standard.
LEAST_SCALING = 1e-300  # with less, a time is no longer a number
LONGEST_NAME = 64  # characters of a name that is not known, which a person is shown


class PlanRefused(Exception):
    """A refusal on its way out of the planner; `fraction` of a Cartesian path could have been gone."""

    def __init__(self, code: PlanCode, refusal: Refusal, fraction: float = 0.0) -> None:
        super().__init__(refusal.message)
        self.code = code
        self.refusal = refusal
        self.fraction = fraction


class SearchFailure(StrEnum):
    """Reason why a search found no path."""

    TIMED_OUT = "timed out"
    START_TOUCHES = "start touches"
    GOAL_TOUCHES = "goal touches"


def timed_out() -> PlanRefused:
    """The refusal (TIMED_OUT) of a plan that used up the time it was allowed."""
    return malformed(
        PlanCode.TIMED_OUT,
        "allowed_time",
        "no plan was found within the time allowed",
        "allow more time, or ask for a goal nearer to where the arm is",
        check="allowed time",
    )


def too_long(points: int) -> PlanRefused:
    """The refusal of a plan whose trajectory has more points than a goal may have."""
    return PlanRefused(
        PlanCode.PLANNING_FAILED,
        Refusal(
            check="points",
            subject="trajectory",
            value=float(points),
            limit=float(MOST_POINTS),
            message=f"the trajectory has {points} points, more than the {MOST_POINTS} that are followed",
            remedy="split the path, and plan its parts one after the other",
        ),
    )


def too_large(reason: str) -> PlanResponse:
    """The answer in place of one that cannot be sent, as `reason` says with its size and limit."""
    size, _, remedy = reason.partition("; ")
    return PlanResponse(
        code=PlanCode.PLANNING_FAILED,
        refusal=Refusal(check="size", subject="trajectory", message=f"the plan is too large: {size}", remedy=remedy),
    )


def scaling_refused(which: str, value: float) -> PlanRefused:
    """The refusal of the scaling `which`, whose dimensionless `value` is not in (0, 1] or too small."""
    must = f"below {LEAST_SCALING:g} no path ends" if 0.0 < value < 1.0 else "it must be above 0 and at most 1"
    return PlanRefused(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        Refusal(
            check="scaling",
            subject=which,
            value=value if value == value and abs(value) < 1e300 else None,
            limit=1.0,
            nearest=(1.0 if value > 1.0 else 0.1,),
            message=f"{which} is {value}: {must}",
            remedy=f"give {which} in (0, 1]; 1 is the arm's full speed",
        ),
    )


def clearance_refused(value: float) -> PlanRefused:
    """The refusal of a clearance of `value` [m], which no plan may keep."""
    least, most = 1000.0 * LEAST_CLEARANCE, 1000.0 * MOST_CLEARANCE
    nearest = min(max(value, LEAST_CLEARANCE), MOST_CLEARANCE)
    return PlanRefused(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        Refusal(
            check="clearance",
            subject="clearance",
            value=value,
            limit=nearest,
            nearest=(nearest,),
            message=f"clearance is {1000.0 * value:g} mm: it must be from {least:g} mm to {most:g} mm",
            remedy=f"ask for {1000.0 * nearest:g} mm, or for none: then the robot's own counts",
        ),
    )


def unknown_name(code: PlanCode, check: str, name: str, known: Iterable[str], where: str) -> PlanRefused:
    """A joint, state or frame that is not there."""
    names = sorted(known)
    name = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    near = nearest_name(name, names)
    meant = suggestion(name, names) if near else ""  # else the remedy names them all
    return PlanRefused(
        code,
        Refusal(
            check=check,
            subject=name,
            message=f'{where} has no {check.removeprefix("unknown ")} "{name}"{meant}',
            remedy=f'use "{near}"' if near else f"use one of {', '.join(names)}",
        ),
    )


def malformed(code: PlanCode, subject: str, message: str, remedy: str, check: str = "request") -> PlanRefused:
    """A request that says too little, too much or two things at once."""
    return PlanRefused(code, Refusal(check=check, subject=subject, message=message, remedy=remedy))


def beyond_limit(arm: ArmDescription, joint: Joint, value: float, nearest: Vector) -> PlanRefused:
    """The refusal of a goal whose `value` [rad] or [m] is beyond the joint's limit; `nearest` [rad] or [m] has all
    joints of the goal within their limits."""
    limit = joint.clamp(value)
    side = "above its upper" if value > joint.upper else "below its lower"
    off = f"{abs(value - limit):.4g} {joint.unit}"  # value and limit may look alike in few digits
    return PlanRefused(
        PlanCode.INVALID_GOAL_CONSTRAINTS,
        Refusal(
            check="joint limit",
            subject=joint.name,
            value=value,
            limit=limit,
            nearest=nearest,
            message=f'joint "{joint.name}": {value:.6g} {joint.unit} is {off} {side} limit of {limit:g} {joint.unit}'
            f" ({arm.urdf_path.name})",
            remedy=f"the nearest is {limit:g} {joint.unit}",
        ),
    )


def start_beyond_limit(joint: Joint, value: float) -> PlanRefused:
    """The refusal of a start whose `value` [rad] or [m] is beyond the joint's limit."""
    limit = joint.clamp(value)
    return PlanRefused(
        PlanCode.INVALID_ROBOT_STATE,
        Refusal(
            check="start state",
            subject=joint.name,
            value=value,
            limit=limit,
            nearest=(limit,),
            message=f'the start of "{joint.name}" is {value:.6g} {joint.unit}, beyond its limit of {limit:g}',
            remedy="move the joint back by hand and reference the arm again with `gemelo reference`",
        ),
    )


def moving_start(joint: Joint, velocity: float, limit: float) -> PlanRefused:
    """The refusal of a start in which the joint's `velocity` is above `limit`, both [rad/s] or [m/s]: plans begin at
    rest."""
    return PlanRefused(
        PlanCode.INVALID_ROBOT_STATE,
        Refusal(
            check="moving start",
            subject=joint.name,
            value=velocity,
            limit=limit,
            message=f'"{joint.name}" moves at {velocity:.4g} {joint.unit}/s; a plan begins at rest'
            f" (below {limit:.4g} {joint.unit}/s)",
            remedy="wait until the arm stands, or cancel what it does",
        ),
    )


def stale_state(age: float | None, limit: float) -> PlanRefused:
    """The refusal where the newest joint state has an `age` [s] above `limit` [s], or None has come: the present
    configuration is not known."""
    told = "no joint state has come yet" if age is None else f"the newest joint state is {age:.3f} s old"
    return PlanRefused(
        PlanCode.ROBOT_STATE_STALE,
        Refusal(
            check="joint state",
            subject="joint_states",
            value=age,
            limit=limit,
            message=f"{told}, so where the arm is now is not known (at most {limit:g} s)",
            remedy="see that stepper_gateway runs and the device is online (`gemelo state`), or give a start state",
        ),
    )


def in_collision(
    code: PlanCode,
    where: str,
    pairs: Sequence[tuple[str, str]],
    margin: float,
    nearest: Vector,
    remedy: str,
    configuration: Vector = (),
    objects: Mapping[str, str] | None = None,
    distance: float | None = None,
) -> PlanRefused:
    """The refusal of `configuration` (n,) [rad] or [m], in which two links, or a link and one of the scene's `objects`
    (their kinds by name), do not keep `margin` [m]; the first two are `distance` [m] apart; `nearest` is in the goal's
    own form."""
    known = objects or {}
    shown = [[f"{known[name]} {name}" if name in known else name for name in pair] for pair in pairs]
    named = " and ".join(f"{first} with {second}" for first, second in shown)
    is_own = not any(name in known for pair in pairs for name in pair)
    near = f"would be nearer than {1000 * margin:.2g} mm" if margin > 0.0 else "touch"
    apart = "" if distance is None or margin <= 0.0 else f": {_apart(distance)}"
    return PlanRefused(
        code,
        Refusal(
            check="self-collision" if is_own else "collision",
            subject=" / ".join(pairs[0]),
            value=distance,
            limit=margin,
            nearest=nearest,
            configuration=configuration,
            message=f"{where}, {named} {near}{apart}",
            remedy=remedy,
        ),
    )


def _apart(distance: float) -> str:
    """How near [m] two things are, in words."""
    return f"{1000.0 * distance:.2g} mm apart" if distance > 0.0 else "they touch"


def no_path_around(why: SearchFailure, blocked: PlanRefused) -> PlanRefused:
    """No search has found a path around what is on the straight one."""
    told, subject, configuration = (
        f"{blocked.refusal.message}; and",
        blocked.refusal.subject,
        blocked.refusal.configuration,
    )
    if why is SearchFailure.TIMED_OUT:
        return PlanRefused(
            PlanCode.TIMED_OUT,
            Refusal(
                check="allowed time",
                subject=subject,
                configuration=configuration,
                message=f"{told} no path around it was found within the time allowed",
                remedy="allow more time, go via another configuration, or make room",
            ),
        )
    where = "the start" if why is SearchFailure.START_TOUCHES else "every configuration of the goal"
    return PlanRefused(
        PlanCode.PLANNING_FAILED,
        Refusal(
            check="clearance",
            subject=subject,
            value=blocked.refusal.value,
            limit=blocked.refusal.limit,
            configuration=configuration,
            message=f"{told} {where} is too near to something for the native planner, which is cautious",
            remedy='ask for planner_id "RRTConnect", which looks at the exact shapes',
        ),
    )


def not_verified(why: str) -> PlanRefused:
    """A trajectory was made, and may not be executed."""
    return PlanRefused(
        PlanCode.PLANNING_FAILED,
        Refusal(
            check="verification",
            message=f"the timed trajectory did not pass its verification: {why}",
            remedy="a larger scaling or a goal farther away; if it stays, report this as a defect",
        ),
    )


def out_of_reach(arm: ArmDescription, goal: Point, nearest: Point, shown: Vector, held: Sequence[str]) -> PlanRefused:
    """The refusal of a tool position `goal` (3,) [m] in the base frame; `nearest` (3,) [m] in the base frame can be
    reached, and `shown` is the same in the goal's own form and frame."""
    missing = [a - b for a, b in zip(goal, nearest, strict=True)]
    distance = sum(value * value for value in missing) ** 0.5
    axis = max(range(3), key=lambda index: abs(missing[index]))
    is_one_axis = abs(missing[axis]) > 0.98 * distance
    limits = f", held by {', '.join(held)}" if held else ""
    return PlanRefused(
        PlanCode.NO_IK_SOLUTION,
        Refusal(
            check="reach",
            subject="xyz"[axis] if is_one_axis else "tool position",
            value=goal[axis] if is_one_axis else distance,
            limit=nearest[axis] if is_one_axis else 0.0,
            nearest=shown,
            message=f"{arm.tool_frame} cannot be at {_point(goal)} m: {1000 * distance:.1f} mm out of reach{limits}",
            remedy=f"the nearest point it can be at is {_point(shown)} m",
        ),
    )


def _point(values: Sequence[float]) -> str:
    return " ".join(f"{value:.4f}" for value in values)
