"""Targets as arguments: checked here, and turned into the goal and the motion of a plan request."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import cast

from msgspec.structs import asdict, replace

from gemelo.api.arguments import Joints as Joints
from gemelo.api.arguments import Target as Target
from gemelo.api.arguments import ToolGoal
from gemelo.api.arguments import Waypoint as Waypoint
from gemelo.api.errors import BadArgument
from gemelo.api.units import Pose
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.frames.transforms import from_rpy
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    MOST_ATTEMPTS,
    CircularMotion,
    FreeMotion,
    Goal,
    IkRequest,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.reasons import Remedy, because, remedy
from gemelo.schemas.robot import LEAST_CLEARANCE, MOST_CLEARANCE

LookUp = Callable[[str, str], Pose]  # (target, source): where the frame `source` is in `target` now

LARGEST = 10.0  # [m] from the base; what is farther was meant in mm
FASTEST = 5.0  # [m/s] of the tool; what is faster was meant in mm/s
LONGEST_PLAN = 3600.0  # [s]
ALLOWED, ALLOWED_OF_A_POINT, MOST_ALLOWED = 5.0, 0.01, 120.0  # [s] for a plan, and for each point that it passes
GOALS = ("named", "joints", "position", "pose", "offset")  # arguments that say where to
FULL = 6  # joints that an arm has at least if it can turn its tool as it likes
TYPED_DIGITS = 3  # chosen: behind the point, of an angle or a length that a person types


def as_target(goal: ToolGoal) -> Target:
    """The same arguments, to which others may be added."""
    return cast(Target, dict(goal))


def not_connected(_target: str, _source: str) -> Pose:
    """The `LookUp` where no arm is connected; raises `BadArgument`."""
    raise BadArgument(because("argument.offset.not_connected", argument="offset", needed="position"))


def request_of(arm: ArmDescription, target: Target, look_up: LookUp) -> PlanRequest:
    """The planner's request; raises `BadArgument` for what cannot be meant."""
    _require_known(target, Target)
    speed = _share("speed", target.get("speed", 1.0))
    start = target.get("from_joints")
    return PlanRequest(
        goal=_by_way_of(goal_of(arm, target, look_up), arm, target),
        start=None if start is None else joint_state(arm, start, "from_joints"),
        velocity_scaling=speed,
        acceleration_scaling=_share("acceleration", target.get("acceleration", speed)),
        allowed_time=_positive("allowed_time", target.get("allowed_time", _usual_time_of(target)), "s", LONGEST_PLAN),
        clearance=_clearance(target),
        motion=_motion_of(target),
        timing=Timing.TIME_OPTIMAL if target.get("time_optimal") else Timing.JERK_LIMITED,
    )


def usual_time(points: int) -> float:
    """[s] that a plan by so many points on the way is allowed where nothing is said, as far as a planner grants it."""
    return min(ALLOWED + ALLOWED_OF_A_POINT * points, MOST_ALLOWED)


def _usual_time_of(target: Target) -> float:
    via = target.get("via", ())
    return usual_time(len(via) if isinstance(via, Sequence) else 0)


def ik_request(
    arm: ArmDescription, target: ToolGoal, look_up: LookUp, near: Joints | None, solutions: int, touching: bool
) -> IkRequest:
    """The planner's request for configurations; raises `BadArgument`."""
    _require_known(target, ToolGoal)
    goal = goal_of(arm, as_target(target), look_up)
    assert isinstance(goal, PoseGoal)
    return IkRequest(
        goal=goal,
        near=None if near is None else joint_state(arm, near, "near"),
        solutions=solutions,
        avoid_collisions=not touching,
    )


def goal_of(arm: ArmDescription, target: Target, look_up: LookUp) -> PoseGoal | JointGoal | NamedGoal:
    """The one goal among the arguments."""
    given = tuple(name for name in GOALS if name in target)
    if not given:
        raise BadArgument(because("argument.goal.none", goals=GOALS))
    if len(given) > 1:
        raise BadArgument(because("argument.goal.several", goals=GOALS, given=given))
    if given[0] in ("named", "joints"):
        _refuse_with(target, given[0], (*ToolGoal.__annotations__, "through", "center"))
    if "named" in target:
        return named_goal(arm, target["named"])
    if "joints" in target:
        state = joint_state(arm, target["joints"], "joints")
        return JointGoal(name=state.name, position=state.position)
    return _pose_goal(arm, target, look_up)


def named_goal(arm: ArmDescription, name: str) -> NamedGoal:
    """A named state of the SRDF; raises `BadArgument` with the nearest name."""
    if name not in arm.state_names:
        raise BadArgument(because("argument.named.unknown", nearest(name, arm.state_names), name=name))
    return NamedGoal(name=name)


def joint_state(arm: ArmDescription, joints: Joints, owner: str) -> JointState:
    """Joint values [rad] or [m] by the names of the arm; raises `BadArgument`."""
    values = named_joints(arm, joints, owner)
    for name, value in values.items():
        _require_unit(arm, name, value)
    return JointState(name=tuple(values), position=tuple(values.values()))


def named_joints(arm: ArmDescription, joints: Joints, owner: str) -> dict[str, float]:
    """Finite numbers [rad] or [m] by the names of the arm's joints; raises `BadArgument`."""
    if not isinstance(joints, Mapping):
        values = vector(owner, joints, len(arm.joints), "every_joint")
        return dict(zip(arm.joint_names, values, strict=True))
    if not joints:
        raise BadArgument(because("argument.joints.none", argument=owner, joint=arm.joint_names[0]))
    for name in joints:
        require_joint(arm, name)
    return {name: joint_number(name, value) for name, value in joints.items()}


def require_joint(arm: ArmDescription, name: str) -> None:
    """Raises `BadArgument` with the nearest name where the arm has no such joint."""
    if name not in arm.joint_names:
        hint = nearest(str(name), arm.joint_names)
        raise BadArgument(because("argument.joint.unknown", hint, robot=arm.name, joint=str(name)))


def joint_number(joint: str, value: float) -> float:
    """`value` as a finite number, in the joint's unit; raises `BadArgument`."""
    found = _as_float(value)
    if found is None:
        raise BadArgument(because("argument.joint.not_a_number", joint=joint, value=repr(value)))
    if not math.isfinite(found):
        raise BadArgument(because("argument.joint.not_finite", joint=joint, value=str(found)))
    return found


def number(owner: str, value: float) -> float:
    """`value` as a finite number, in the unit of its owner; raises `BadArgument`."""
    found = _as_float(value)
    if found is None:
        raise BadArgument(because("argument.not_a_number", argument=owner, value=repr(value)))
    if not math.isfinite(found):
        raise BadArgument(because("argument.not_finite", argument=owner, value=str(found)))
    return found


def _as_float(value: object) -> float | None:
    """None for what is no number."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return None


def vector(owner: str, values: Iterable[float], size: int, meaning: str) -> tuple[float, ...]:
    """`values` as `size` finite numbers, in the unit of their owner; raises `BadArgument`."""

    def wrong(given: str) -> BadArgument:
        return BadArgument(because("argument.numbers", argument=owner, count=size, meaning=meaning, given=given))

    try:
        found = tuple(values)
    except TypeError:
        raise wrong(repr(values)) from None
    if len(found) != size:
        raise wrong(str(len(found)))
    return tuple(number(f"{owner}[{index}]", value) for index, value in enumerate(found))


def point(owner: str, values: Iterable[float]) -> tuple[float, float, float]:
    """A point (x, y, z) [m] that is not in another unit; raises `BadArgument`."""
    x, y, z = vector(owner, values, 3, "xyz")
    largest = max((x, y, z), key=abs)
    if abs(largest) > LARGEST:
        hint = remedy("in_millimetres", value=largest)
        raise BadArgument(because("argument.point.far", hint, argument=owner, value=largest))
    return x, y, z


def quaternion(owner: str, values: Iterable[float]) -> tuple[float, float, float, float]:
    """A unit quaternion (x, y, z, w); raises `BadArgument`."""
    x, y, z, w = vector(owner, values, 4, "unit_quaternion")
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if abs(length - 1.0) > 1e-3:
        raise BadArgument(because("argument.quaternion.length", argument=owner, length=length))
    return x / length, y / length, z / length, w / length


def turned(owner: str, values: Iterable[float]) -> tuple[float, float, float, float]:
    """Roll, pitch, yaw [rad] as a quaternion; raises `BadArgument`."""
    angles = vector(owner, values, 3, "roll_pitch_yaw")
    largest = max(angles, key=abs)
    if abs(largest) > math.tau:
        hint = remedy("in_degrees", value=largest)
        raise BadArgument(because("argument.turn.large", hint, argument=owner, value=largest))
    return from_rpy(*angles)


def _pose_goal(arm: ArmDescription, target: Target, look_up: LookUp) -> PoseGoal:
    turns = tuple(name for name in ("orientation", "rpy", "pose", "along") if name in target)
    if len(turns) > 1:
        raise BadArgument(because("argument.turn.several", given=turns))
    if "axis" in target and "along" not in target:
        raise BadArgument(because("argument.axis.alone", argument="axis", needed="along"))
    if "offset" in target:
        return _offset_goal(arm, target, look_up)
    pose = target.get("pose")
    orientation: tuple[float, ...] = ()
    if pose is not None or "orientation" in target:
        orientation = quaternion("orientation", pose.orientation if pose is not None else target["orientation"])
    elif "rpy" in target:
        orientation = turned("rpy", target["rpy"])
    return PoseGoal(
        position=point("position", pose.position if pose is not None else target["position"]),
        orientation=orientation,
        frame=_link(arm, target.get("frame", "")),
        **_axes(target),
        position_tolerance=number("position_tolerance", target.get("position_tolerance", 0.0)),
        orientation_tolerance=number("orientation_tolerance", target.get("orientation_tolerance", 0.0)),
    )


def _axes(target: Target) -> dict[str, tuple[float, ...]]:
    """The directions among the arguments, each (3,)."""
    axes = {}
    if "along" in target:
        axes["direction"] = vector("along", target["along"], 3, "direction")
        axes["tool_axis"] = vector("axis", target.get("axis", (0.0, 0.0, 1.0)), 3, "tool_axis")
    if "free_axis" in target:
        axes["free_axis"] = vector("free_axis", target["free_axis"], 3, "tool_axis")
    return axes


def _offset_goal(arm: ArmDescription, target: Target, look_up: LookUp) -> PoseGoal:
    """From where the tool is now. An arm of less than six joints keeps the direction of its tool's z axis alone."""
    now = look_up(arm.base_frame, arm.tool_frame)
    frame = _link(arm, target.get("frame", ""))
    axes = look_up(arm.base_frame, frame) if frame else Pose((0.0, 0.0, 0.0))
    step = axes.axis(point("offset", target["offset"]))
    goal = Target(position=now.offset(*step).position)
    for key in ("position_tolerance", "orientation_tolerance"):
        if key in target:
            goal[key] = target[key]
    if "along" in target or "orientation" in target or "rpy" in target:
        raise BadArgument(because("argument.offset.turned", argument="offset", needed="position"))
    if len(arm.joints) >= FULL:
        goal["orientation"] = now.orientation
    else:
        goal["along"] = now.axis()
    return _pose_goal(arm, goal, look_up)


def _by_way_of(goal: PoseGoal | JointGoal | NamedGoal, arm: ArmDescription, target: Target) -> Goal:
    """By the points of via=; positions among them are turned as the goal is."""
    if "via" not in target:
        if _is_given(target, "blend"):
            raise BadArgument(because("argument.not_with.without", argument="blend", needed="via"))
        return goal
    _refuse_with(target, "via", ("through", "center"))
    like = goal if isinstance(goal, PoseGoal) else PoseGoal()
    points = tuple(_waypoint(each, arm, like) for each in target["via"])
    blend = target.get("blend", 0.0)
    return WaypointGoal(points=(*points, goal), blend=_positive("blend", blend, "m", LARGEST) if blend else 0.0)


def _waypoint(given: Waypoint, arm: ArmDescription, like: PoseGoal) -> PoseGoal | JointGoal | NamedGoal:
    if isinstance(given, str):
        return named_goal(arm, given)
    if isinstance(given, Mapping):
        state = joint_state(arm, given, "via")
        return JointGoal(name=state.name, position=state.position)
    if isinstance(given, Pose):
        return PoseGoal(
            position=point("via", given.position), orientation=quaternion("via", given.orientation), frame=like.frame
        )
    return replace(like, position=point("via", given))


def _motion_of(target: Target) -> Motion:
    """The motion among the arguments."""
    given = tuple(name for name in ("line", "ptp", "through", "center") if target.get(name))
    if len(given) > 1:
        raise BadArgument(because("argument.path.several", given=given))
    kind = given[0] if given else "free"
    if kind in ("free", "ptp"):
        for name in ("tool_speed", "tool_acceleration", "least_fraction", "max_step", "jump"):
            if _is_given(target, name):
                others = ("line", "through", "center")
                raise BadArgument(because("argument.not_with.motion", argument=name, kind=kind, others=others))
    if kind != "free":
        _refuse_with(target, kind, ("planner", "seed", "attempts"))
    if kind == "free":
        attempts = target.get("attempts", 1)
        if not 1 <= attempts <= MOST_ATTEMPTS:
            raise BadArgument(
                because("argument.count", argument="attempts", value=attempts, least=1, most=MOST_ATTEMPTS)
            )
        return FreeMotion(planner_id=target.get("planner", ""), seed=target.get("seed", 0), attempts=attempts)
    if kind == "ptp":
        return PointToPoint()
    values = {name: _positive(name, target[name], unit, most) for name, unit, most in TOOL_LIMITS if name in target}  # type: ignore[literal-required]
    line = LinearMotion(
        speed=values.get("tool_speed", 0.0),
        acceleration=values.get("tool_acceleration", 0.0),
        max_step=values.get("max_step", 0.0),
        jump_threshold=values.get("jump", 0.0),
        least_fraction=values.get("least_fraction", 1.0),
    )
    if kind == "line":
        return line
    interim = point("through", target["through"]) if kind == "through" else ()
    center = point("center", target["center"]) if kind == "center" else ()
    return CircularMotion(interim=interim, center=center, **asdict(line))


TOOL_LIMITS = (
    ("tool_speed", "m/s", FASTEST),
    ("tool_acceleration", "m/s^2", 100.0 * FASTEST),
    ("max_step", "m", LARGEST),
    ("jump", "rad or m", math.inf),
    ("least_fraction", "", 1.0),
)


def _require_known(target: Target | ToolGoal, kind: type) -> None:
    known = {name for base in (ToolGoal, kind) for name in base.__annotations__}
    for name in target:
        if name not in known:
            raise BadArgument(because("argument.unknown", nearest(name, known), argument=name))


def _refuse_with(target: Target, other: str, names: Iterable[str]) -> None:
    for name in names:
        if _is_given(target, name):
            raise BadArgument(because("argument.not_with", argument=name, other=other))


def _is_given(target: Target, name: str) -> bool:
    return target.get(name) is not None


def _link(arm: ArmDescription, name: str) -> str:
    if name and name not in arm.model.link_names:
        hint = nearest(name, arm.model.link_names)
        raise BadArgument(because("argument.link.unknown", hint, robot=arm.name, link=name))
    return name


def _share(name: str, value: float) -> float:
    found = number(name, value)
    if not 0.0 < found <= 1.0:
        raise BadArgument(because("argument.share", *per_cent(found), argument=name, value=found))
    return found


def _clearance(target: Target) -> float | None:
    """[m], or None: the robot's own."""
    if "clearance" not in target:
        return None
    found = number("clearance", target["clearance"])
    if not LEAST_CLEARANCE <= found <= MOST_CLEARANCE:
        hint = (remedy("in_millimetres", value=found),) if found > MOST_CLEARANCE else ()
        raise BadArgument(
            because(
                "argument.range", *hint,
                argument="clearance", value=found, least=LEAST_CLEARANCE, most=MOST_CLEARANCE, unit="m",
            )
        )  # fmt: skip
    return found


def _positive(name: str, value: float, unit: str, most: float) -> float:
    found = number(name, value)
    if not found > 0.0:
        raise BadArgument(because("argument.not_positive", argument=name, value=found, unit=unit))
    if found > most:
        hint = (remedy("in_millimetres", value=found),) if unit.startswith("m") else ()
        raise BadArgument(because("argument.too_much", *hint, argument=name, value=found, most=most, unit=unit))
    return found


def _require_unit(arm: ArmDescription, name: str, value: float) -> None:
    """Refuses what is out of the limits as it stands, and within them in degrees or millimetres.

    A value that was converted, as 400deg to 6.981317..., has more digits than a person types.
    """
    joint = arm.joint(name)
    factor, helper = (math.radians(1.0), "in_degrees") if joint.unit == "rad" else (0.001, "in_millimetres")
    lower, upper = (joint.lower, joint.upper) if math.isfinite(joint.lower) else (-math.tau, math.tau)
    if (
        not lower <= value <= upper
        and lower <= value * factor <= upper
        and abs(value) >= 2.0 * max(abs(lower), abs(upper))
        and value == round(value, TYPED_DIGITS)
    ):
        raise BadArgument(
            because(
                "argument.joint.other_unit", remedy(helper, value=value),
                joint=name, value=value, unit=joint.unit, lower=lower, upper=upper,
            )
        )  # fmt: skip


def require_within(arm: ArmDescription, values: Mapping[str, float], *, rounded: bool = False) -> None:
    """Raises `BadArgument` for a joint value [rad] or [m] beyond its limits; `rounded` to the joint's steps before."""
    for name, value in values.items():
        joint = arm.joint(name)
        if not joint.is_within(joint.rounded(value) if rounded else value):
            raise BadArgument(
                because(
                    "argument.joint.beyond", joint=name, value=value, unit=joint.unit,
                    lower=joint.lower, upper=joint.upper, nearest=joint.clamp(value),
                )
            )  # fmt: skip


def per_cent(value: float) -> tuple[Remedy, ...]:
    """The hint for a share that is written in per cent."""
    return (remedy("percent_is", value=value, share=value / 100.0),) if 2.0 <= value <= 100.0 else ()
