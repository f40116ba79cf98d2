"""Requests that nobody can mean end in a refusal that names the thing, its value and what would do; and soon."""

from __future__ import annotations

import math
import time

import msgspec
import pytest

from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    CircularMotion,
    FreeMotion,
    Goal,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanCode,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    WaypointGoal,
)
from gemelo.schemas.scene import PlanningScene
from tests.planner.judging import asked, planner_of, require_refused, require_sound, show
from tests.profiles import count
from tests.table import table

ARMS = pytest.mark.parametrize("name", ["rm1", "parol6"])
LONG = "x" * 100_000
HUGE, TINY = 1e300, 5e-324
READY = NamedGoal(name="home")
NEAR = PoseGoal(position=(0.25, 0.1, 0.15))
SOON = 30.0  # [s] for what is allowed one: this machine may have other things to do
LONGEST = 2_000  # characters that a person may be told


def planned(name: str, request: PlanRequest) -> str:
    """The refusal's words, or "" for a plan, which then is sound."""
    planner = planner_of(name)
    show(planner, PlanningScene())
    began = time.monotonic()
    response = planner.plan(request, None, clock=time.monotonic)
    assert time.monotonic() - began < SOON
    if response.code is PlanCode.SUCCESS:
        require_sound(planner, request, response)
        return ""
    refusal = require_refused(response)
    words = f"{refusal.subject}: {refusal.message}; {refusal.remedy}"
    assert len(words) < LONGEST
    assert "nan" not in words.lower().replace("planner", "")
    return words


def whole(name: str, goal: Goal = READY, **options: object) -> PlanRequest:
    planner = planner_of(name)
    return asked(planner, planner.arm.named_states["ready"], goal, **{"allowed_time": 1.0, **options})


@ARMS
@table("field", ["velocity_scaling", "acceleration_scaling"])
@table("value", [HUGE, -HUGE, -TINY, 0.0, 1.0 + 1e-12])
def test_no_scaling_but_a_share_will_do(name: str, field: str, value: float):
    words = planned(name, whole(name, **{field: value}))
    assert words.startswith(field)
    assert "(0, 1]" in words


@ARMS
@table("field", ["velocity_scaling", "acceleration_scaling"])
@table(("value", "words"), [(TINY, "no path ends"), (1e-300, "86400 s"), (1e-12, "86400 s")])
def test_a_scaling_with_which_nothing_ends_is_refused(name: str, field: str, value: float, words: str):
    assert words in planned(name, whole(name, **{field: value}))


@ARMS
@table("motion", [FreeMotion(), PointToPoint(), LinearMotion()])
@table("time", [HUGE, 120.1, 0.0, -TINY, -HUGE])
def test_too_much_time_and_none_are_refused(name: str, motion: Motion, time: float):
    assert planned(name, whole(name, motion=motion, allowed_time=time)).startswith("allowed_time")


@ARMS
@table("motion", [FreeMotion(), PointToPoint(), LinearMotion()])
def test_hardly_any_time_ends_in_time(name: str, motion: Motion):
    goal = JointGoal(name=planner_of(name).arm.joint_names[:1], position=(0.1,))
    words = planned(name, whole(name, goal, motion=motion, allowed_time=TINY))
    assert words == "" or words.startswith("allowed_time")


@ARMS
@table(
    ("goal", "thing"),
    [
        (NamedGoal(name=""), '""'),
        (NamedGoal(name=LONG), "xxx"),
        (JointGoal(name=("",), position=(0.0,)), '""'),
        (JointGoal(name=(LONG,), position=(0.0,)), "xxx"),
        (JointGoal(name=("a",) * 5000, position=(0.0,) * 5000), '"a"'),
        (PoseGoal(position=(HUGE, 0.0, 0.0)), "1e+300"),
        (PoseGoal(position=(1e6, -1e6, 1e6)), "1000000"),
        (PoseGoal(position=(0.0,) * 5000), "5000"),
        (PoseGoal(position=()), "0"),
        (PoseGoal(position=NEAR.position, orientation=(0.0, 0.0, 0.0, 0.0)), "length is 0"),
        (PoseGoal(position=NEAR.position, orientation=(HUGE, HUGE, HUGE, HUGE)), "1e+300"),
        (PoseGoal(position=NEAR.position, orientation=(TINY, 0.0, 0.0, 0.0)), "length is 4.941e-324"),
        (PoseGoal(position=NEAR.position, orientation=(0.0, 0.0, 0.0, 1.0), free_axis=(0.0, 0.0, 0.0)), "free_axis"),
        (PoseGoal(position=NEAR.position, tool_axis=(0.0, 0.0, TINY), direction=(0.0, 0.0, 1.0)), "tool_axis"),
        (PoseGoal(position=NEAR.position, tool_axis=(0.0, 0.0, 1.0), direction=(HUGE, HUGE, 0.0)), "direction"),
        (PoseGoal(position=NEAR.position, position_tolerance=-HUGE), "position_tolerance"),
        (PoseGoal(position=NEAR.position, orientation_tolerance=-TINY), "orientation_tolerance"),
        (PoseGoal(position=NEAR.position, frame=LONG), "xxx"),
        (WaypointGoal(points=(NEAR,), blend=HUGE), "blend"),
        (WaypointGoal(points=(NEAR,), blend=-TINY), "blend"),
        (WaypointGoal(), "waypoint"),
    ],
)
@table("motion", [FreeMotion(), LinearMotion()])
def test_a_goal_that_cannot_be_is_named(name: str, goal: Goal, thing: str, motion: Motion):
    assert thing in planned(name, whole(name, goal, motion=motion))


@ARMS
@table("value", [HUGE, -HUGE, 1e9])
def test_a_joint_that_is_to_go_to_the_moon_is_named_with_its_limit(name: str, value: float):
    joint = planner_of(name).arm.joints[1]
    words = planned(name, whole(name, JointGoal(name=(joint.name,), position=(value,))))
    assert words.startswith(joint.name)
    assert f"{value:.6g}" in words
    assert f"{joint.clamp(value):g}" in words


@ARMS
@table(
    ("motion", "thing"),
    [
        (LinearMotion(speed=-HUGE), "speed"),
        (LinearMotion(speed=TINY), "86400 s"),
        (LinearMotion(speed=1e-9), "86400 s"),
        (LinearMotion(acceleration=TINY), "86400 s"),
        (LinearMotion(max_step=TINY), "max_step"),
        (LinearMotion(max_step=1e-8), "max_step"),
        (LinearMotion(jump_threshold=TINY), "jump"),
        (LinearMotion(jump_threshold=-HUGE), "jump_threshold"),
        (LinearMotion(least_fraction=HUGE), "least_fraction"),
        (LinearMotion(least_fraction=-TINY), "least_fraction"),
        (CircularMotion(interim=(HUGE, HUGE, HUGE)), "interim"),
        (CircularMotion(interim=(1e9, 0.0, 0.0)), "interim"),
        (CircularMotion(interim=(0.0,) * 5000), "5000"),
        (CircularMotion(center=(HUGE, 0.0, 0.0)), "center"),
        (CircularMotion(center=(0.0, TINY, 0.0)), "center"),
        (FreeMotion(planner_id=LONG), "xxx"),
        (FreeMotion(planner_id="NATIVE "), "native"),
    ],
)
def test_a_motion_that_cannot_be_is_named(name: str, motion: Motion, thing: str):
    planner = planner_of(name)
    begin = planner.kinematics.tool(planner.arm.named_states["ready"]).position.tolist()
    goal = PoseGoal(position=(begin[0] - 0.01, begin[1] + 0.02, begin[2]))
    assert thing in planned(name, whole(name, goal, motion=motion))


@ARMS
@table("motion", [LinearMotion(speed=HUGE), LinearMotion(acceleration=HUGE), LinearMotion(max_step=HUGE)])
def test_as_fast_as_nothing_can_be_is_as_fast_as_the_joints_can(name: str, motion: Motion):
    planner = planner_of(name)
    begin = planner.kinematics.tool(planner.arm.named_states["ready"]).position.tolist()
    goal = PoseGoal(position=(begin[0] - 0.01, begin[1] + 0.02, begin[2]))
    assert planned(name, whole(name, goal, motion=motion)) == ""


@pytest.mark.scaled
@ARMS
@table("motion", [FreeMotion(), PointToPoint(), LinearMotion()])
@table("blend", [0.0, 0.01])
def test_thousands_of_waypoints_are_gone_by_or_refused_in_time(name: str, motion: Motion, blend: float):
    planner = planner_of(name)
    x, y, z = planner.kinematics.tool(planner.arm.named_states["ready"]).position.tolist()
    points = tuple(PoseGoal(position=(x - 0.01, y + 0.02 * math.sin(i), z)) for i in range(count(quick=200, full=2000)))
    words = planned(name, whole(name, WaypointGoal(points=points, blend=blend), motion=motion))
    assert "allow" in words or "waypoints" in words or words == ""


@ARMS
@table(
    ("start", "thing"),
    [
        (JointState(name=(LONG,), position=(0.0,)), "xxx"),
        (JointState(name=("a",) * 5000, position=(0.0,) * 5000), '"a"'),
        (JointState(name=("a",), position=()), "1 names and 0 positions"),
        (JointState(), "joint state"),
    ],
)
def test_a_start_that_cannot_be_is_named(name: str, start: JointState, thing: str):
    assert thing in planned(name, PlanRequest(goal=READY, start=start))


@ARMS
@table("value", [HUGE, -HUGE, 1e9])
def test_a_start_on_the_moon_is_named(name: str, value: float):
    arm = planner_of(name).arm
    start = JointState(name=arm.joint_names, position=(0.0, value, *[0.0] * (len(arm.joints) - 2)))
    assert planned(name, PlanRequest(goal=READY, start=start)).startswith(arm.joint_names[1])


@table("value", [math.nan, math.inf, -math.inf])
@table(
    "path",
    [
        ("velocity_scaling",),
        ("acceleration_scaling",),
        ("allowed_time",),
        ("goal", "position"),
        ("goal", "orientation"),
        ("goal", "free_axis"),
        ("goal", "tool_axis"),
        ("goal", "direction"),
        ("goal", "position_tolerance"),
        ("goal", "orientation_tolerance"),
        ("motion", "speed"),
        ("motion", "acceleration"),
        ("motion", "max_step"),
        ("motion", "jump_threshold"),
        ("motion", "least_fraction"),
        ("start", "position"),
        ("start", "velocity"),
    ],
)
def test_what_is_no_number_never_becomes_a_request(path: tuple[str, ...], value: float):
    """Neither built here nor come over the bus."""
    request = PlanRequest(goal=NEAR, motion=LinearMotion(), start=JointState(name=("a",), position=(0.0,)))
    plain = msgspec.to_builtins(request)
    inner = plain if len(path) == 1 else plain[path[0]]
    is_list = isinstance(inner[path[-1]], (list, tuple))
    inner[path[-1]] = [value, 0.0, 0.0] if is_list else value
    with pytest.raises((ValueError, msgspec.ValidationError), match=rf"{path[-1]}.*finite"):
        msgspec.msgpack.decode(msgspec.msgpack.encode(plain), type=PlanRequest)
