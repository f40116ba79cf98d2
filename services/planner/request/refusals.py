"""Refusals of a plan: each names the check, the thing, its value, its limit and what would do."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from enum import StrEnum

from gemelo.libraries.arm.errors import nearest_name
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.libraries.arm.model.jaws import JAWS
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import MOST_POINTS
from gemelo.schemas.planning import PlanCode, PlanResponse, Refusal
from gemelo.schemas.reasons import Reason, Remedy, Value, because, remedy, say_apart
from gemelo.schemas.robot import LEAST_CLEARANCE, MOST_CLEARANCE

Point = Sequence[float]

# Tuning constants: chosen, where a line does not say measured or standard.
LEAST_SCALING = 1e-300  # with less, a time is no longer a number
LONGEST_NAME = 64  # characters of a name that is not known, which a person is shown

UNKNOWN = {  # by check
    "unknown joint": "plan.unknown.joint",
    "unknown state": "plan.unknown.state",
    "unknown frame": "plan.unknown.frame",
    "unknown link": "plan.unknown.link",
    "unknown planner": "plan.unknown.planner",
}


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


def refusal_of(
    why: Reason,
    check: str,
    subject: str = "",
    value: float | None = None,
    limit: float | None = None,
    nearest: Vector = (),
    configuration: Vector = (),
) -> Refusal:
    """`why` in the form in which it travels: with the English sentence, and what would do.

    `value` and `limit` are in the unit of the check; `configuration` (n,) [rad] or [m] is where something touches, and
    `nearest` in the goal's own form.
    """
    message, would_do = say_apart(why)
    return Refusal(
        check=check,
        subject=subject,
        value=value,
        limit=limit,
        nearest=nearest,
        configuration=configuration,
        message=message,
        remedy=would_do,
        why=why,
    )


def without_remedies(refusal: Refusal) -> Reason:
    """Its reason, as a cause of another one that has remedies of its own."""
    why = refusal.why or Reason()
    return Reason(code=why.code, values=why.values, causes=why.causes)


def malformed(code: PlanCode, subject: str, why: Reason, check: str = "request") -> PlanRefused:
    """A request that says too little, too much or two things at once."""
    return PlanRefused(code, refusal_of(why, check, subject))


def timed_out() -> PlanRefused:
    """The refusal (TIMED_OUT) of a plan that used up the time it was allowed."""
    why = because("plan.time.over", remedy("more_time"), remedy("nearer_goal"))
    return malformed(PlanCode.TIMED_OUT, "allowed_time", why, "allowed time")


def failed(why: Reason) -> PlanResponse:
    """The answer of a planner that could not make a plan at all."""
    return PlanResponse(code=PlanCode.FAILURE, refusal=refusal_of(why, "planner", "worker"))


def too_long(points: int) -> PlanRefused:
    """The refusal of a plan whose trajectory has more points than a goal may have."""
    why = because("plan.points.too_many", remedy("plan_in_parts"), count=points, limit=MOST_POINTS)
    refusal = refusal_of(why, "points", "trajectory", float(points), float(MOST_POINTS))
    return PlanRefused(PlanCode.PLANNING_FAILED, refusal)


def too_large(size: int, limit: int) -> PlanResponse:
    """The answer in place of one that cannot be sent, of `size` [bytes] where `limit` is the most."""
    why = because("plan.size", remedy("plan_in_parts"), size=size, limit=limit)
    refusal = refusal_of(why, "size", "trajectory", float(size), float(limit))
    return PlanResponse(code=PlanCode.PLANNING_FAILED, refusal=refusal)


def scaling_refused(which: str, value: float) -> PlanRefused:
    """The refusal of the scaling `which`, whose dimensionless `value` is not in (0, 1] or too small."""
    would_do = remedy("scaling_within", which=which)
    why = because("plan.scaling", would_do, which=which, value=value)
    if 0.0 < value < 1.0:
        why = because("plan.scaling.endless", would_do, which=which, value=value, least=LEAST_SCALING)
    shown = value if value == value and abs(value) < 1e300 else None
    nearest = (1.0 if value > 1.0 else 0.1,)
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal_of(why, "scaling", which, shown, 1.0, nearest))


def clearance_refused(value: float) -> PlanRefused:
    """The refusal of a clearance of `value` [m], which no plan may keep."""
    nearest = min(max(value, LEAST_CLEARANCE), MOST_CLEARANCE)
    why = because(
        "plan.clearance.range",
        remedy("ask_clearance", clearance=nearest),
        remedy("own_clearance"),
        value=value,
        least=LEAST_CLEARANCE,
        most=MOST_CLEARANCE,
    )
    refusal = refusal_of(why, "clearance", "clearance", value, nearest, (nearest,))
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal)


def unknown_name(code: PlanCode, check: str, name: str, known: Iterable[str], where: str) -> PlanRefused:
    """A joint, state, frame, link or planner that is not there."""
    names = tuple(sorted(known))
    name = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    near = nearest_name(name, names)
    would_do = remedy("use_name", name=near) if near else remedy("use_one_of", names=names)
    return PlanRefused(code, refusal_of(because(UNKNOWN[check], would_do, where=where, name=name), check, name))


def beyond_limit(arm: ArmDescription, joint: Joint, value: float, nearest: Vector) -> PlanRefused:
    """The refusal of a goal whose `value` [rad] or [m] is beyond the joint's limit; `nearest` [rad] or [m] has all
    joints of the goal within their limits."""
    limit = joint.clamp(value)
    why = because(
        "plan.limit.position",
        remedy("nearest_value", value=limit, unit=joint.unit),
        joint=joint.name,
        value=value,
        beyond=abs(value - limit),  # value and limit may look alike in few digits
        side="upper" if value > joint.upper else "lower",
        limit=limit,
        unit=joint.unit,
        file=arm.urdf_path.name,
    )
    refusal = refusal_of(why, "joint limit", joint.name, value, limit, nearest)
    return PlanRefused(PlanCode.INVALID_GOAL_CONSTRAINTS, refusal)


def start_beyond_limit(joint: Joint, value: float) -> PlanRefused:
    """The refusal of a start whose `value` [rad] or [m] is beyond the joint's limit."""
    limit = joint.clamp(value)
    would_do = remedy("back_by_hand")
    why = because("plan.start.limit", would_do, joint=joint.name, value=value, limit=limit, unit=joint.unit)
    refusal = refusal_of(why, "start state", joint.name, value, limit, (limit,))
    return PlanRefused(PlanCode.INVALID_ROBOT_STATE, refusal)


def moving_start(joint: Joint, velocity: float, limit: float) -> PlanRefused:
    """The refusal of a start in which the joint's `velocity` is above `limit`, both [rad/s] or [m/s]: plans begin at
    rest."""
    would_do = remedy("wait_or_cancel")
    why = because("plan.start.moving", would_do, joint=joint.name, velocity=velocity, limit=limit, unit=joint.unit)
    refusal = refusal_of(why, "moving start", joint.name, velocity, limit)
    return PlanRefused(PlanCode.INVALID_ROBOT_STATE, refusal)


def stale_state(age: float | None, limit: float) -> PlanRefused:
    """The refusal where the newest joint state has an `age` [s] above `limit` [s], or None has come: the present
    configuration is not known."""
    would_do = remedy("see_device"), remedy("give_start")
    why = because("plan.state.none", *would_do)
    if age is not None:
        why = because("plan.state.stale", *would_do, age=age, limit=limit)
    return PlanRefused(PlanCode.ROBOT_STATE_STALE, refusal_of(why, "joint state", "joint_states", age, limit))


def in_collision(
    code: PlanCode,
    where: str,
    pairs: Sequence[tuple[str, str]],
    margin: float,
    nearest: Vector,
    would_do: Iterable[Remedy],
    configuration: Vector = (),
    objects: Mapping[str, str] | None = None,
    distance: float | None = None,
) -> PlanRefused:
    """The refusal, by the reason `where`, of `configuration` (n,) [rad] or [m], in which two links, or a link and one
    of the scene's `objects` (their kinds by name), do not keep `margin` [m]; the first two are `distance` [m] apart;
    `nearest` is in the goal's own form."""
    known = objects or {}
    is_own = not any(name in known for pair in pairs for name in pair)
    why = because(where, *near_pairs(pairs, known, margin, distance), *would_do)
    check = "self-collision" if is_own else "collision"
    refusal = refusal_of(why, check, " / ".join(pairs[0]), distance, margin, nearest, configuration)
    return PlanRefused(code, refusal)


def objects_in(pairs: Iterable[tuple[str, str]], links: Container[str]) -> dict[str, str]:
    """What is no link, where nothing is known of its kind."""
    return {name: "object" for pair in pairs for name in pair if name not in links}


def near_pairs(
    pairs: Sequence[tuple[str, str]], objects: Mapping[str, str], margin: float, distance: float | None
) -> list[Reason]:
    """Things that are nearer to one another than `margin` [m], or touch where that is 0; the first two are `distance`
    [m] apart, where that is known."""
    named = [_named(pair, objects) for pair in pairs]
    return [_nearest(named[0], margin, distance), *(because("plan.pair.also", **each) for each in named[1:])]


def _named(pair: tuple[str, str], objects: Mapping[str, str]) -> dict[str, Value]:
    first, second = ("jaw" if name in JAWS else objects.get(name, "link") for name in pair)
    return {"first": pair[0], "first_kind": first, "second": pair[1], "second_kind": second}


def _nearest(named: dict[str, Value], margin: float, distance: float | None) -> Reason:
    if margin <= 0.0 and distance is not None and distance <= 0.0:
        return because("plan.pair.touch", **named, depth=-distance)
    if distance is None:
        return because("plan.pair.near", **named, limit=margin)
    if distance <= 0.0:
        return because("plan.pair.inside", **named, limit=margin, depth=-distance)
    return because("plan.pair.apart", **named, limit=margin, distance=distance)


def no_path_around(why: SearchFailure, blocked: PlanRefused) -> PlanRefused:
    """No search has found a path around what is on the straight one."""
    line, cause = blocked.refusal, without_remedies(blocked.refusal)
    if why is SearchFailure.TIMED_OUT:
        reason = because(
            "plan.path.none_in_time", cause, remedy("more_time"), remedy("via_another"), remedy("make_room")
        )
        refusal = refusal_of(reason, "allowed time", line.subject, configuration=line.configuration)
        return PlanRefused(PlanCode.TIMED_OUT, refusal)
    where = "plan.path.start_near" if why is SearchFailure.START_TOUCHES else "plan.path.goals_near"
    reason = because(where, cause, remedy("exact_planner", name="RRTConnect"))
    refusal = refusal_of(reason, "clearance", line.subject, line.value, line.limit, configuration=line.configuration)
    return PlanRefused(PlanCode.PLANNING_FAILED, refusal)


def not_verified(why: Reason) -> PlanRefused:
    """A trajectory was made, and may not be executed."""
    reason = because("plan.verification", why, remedy("larger_scaling"), remedy("farther_goal"), remedy("report"))
    return PlanRefused(PlanCode.PLANNING_FAILED, refusal_of(reason, "verification"))


def out_of_reach(
    arm: ArmDescription, goal: Point, nearest: Point, shown: Vector, held: Sequence[Reason]
) -> PlanRefused:
    """The refusal of a tool position `goal` (3,) [m] in the base frame; `nearest` (3,) [m] in the base frame can be
    reached, and `shown` is the same in the goal's own form and frame; `held`: the joints at a limit."""
    missing = [a - b for a, b in zip(goal, nearest, strict=True)]
    distance = sum(value * value for value in missing) ** 0.5
    axis = max(range(3), key=lambda index: abs(missing[index]))
    is_one_axis = abs(missing[axis]) > 0.98 * distance
    x, y, z = goal
    why = because(
        "plan.reach.held" if held else "plan.reach",
        *held,
        remedy("nearest_point", x=shown[0], y=shown[1], z=shown[2]),
        tool=arm.tool_frame,
        x=x,
        y=y,
        z=z,
        distance=distance,
    )
    refusal = refusal_of(
        why,
        "reach",
        "xyz"[axis] if is_one_axis else "tool position",
        goal[axis] if is_one_axis else distance,
        nearest[axis] if is_one_axis else 0.0,
        shown,
    )
    return PlanRefused(PlanCode.NO_IK_SOLUTION, refusal)
