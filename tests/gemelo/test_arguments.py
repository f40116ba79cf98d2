"""Invalid arguments are refused by a sentence with the remedy, and nothing is asked of the planner."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gemelo
from gemelo.api.arguments import Target
from gemelo.api.jog import jog_command
from gemelo.api.planning import refused
from gemelo.api.streaming import targets_of
from gemelo.api.targets import as_target, request_of
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.planning import (
    CircularMotion,
    JointGoal,
    LinearMotion,
    NamedGoal,
    PlanRequest,
    PointToPoint,
    PoseGoal,
    Refusal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.reasons import FrontEnd, Reason, because, remedy, say
from tests.table import table

HERE = gemelo.Pose((0.2, 0.1, 0.15), (1.0, 0.0, 0.0, 0.0))


def request(arm: ArmDescription, **target: Any) -> PlanRequest:
    return request_of(arm, Target(**target), lambda target, source: HERE)


BAD = [
    ({}, "none is given"),
    ({"named": "ready", "position": (0.2, 0.1, 0.1)}, "not both named= and position="),
    ({"joints": {"brazo_joint": 0.1}, "position": (0.2, 0.1, 0.1)}, "not both joints= and position="),
    ({"postion": (0.2, 0.1, 0.1)}, 'no argument "postion"; did you mean "position"?'),
    ({"named": "redy"}, 'no named state "redy"; did you mean "ready"?'),
    ({"joints": {"brazo": 0.1}}, 'rm1 has no joint "brazo"; did you mean "brazo_joint"?'),
    ({"joints": {}}, "names no joint"),
    ({"joints": (0.1, 0.2)}, "takes 3 numbers (one for every joint), not 2"),
    ({"joints": {"brazo_joint": 30}}, "if it is in degrees, write gemelo.deg(30)"),
    ({"joints": {"efector_joint": 40}}, "if it is in millimetres, write gemelo.mm(40)"),
    ({"joints": {"brazo_joint": math.nan}}, 'joint "brazo_joint" is nan: it must be finite'),
    ({"joints": {"brazo_joint": "much"}}, "'much' is not a number"),
    ({"position": (0.2, math.inf, 0.1)}, "position[1] is inf: it must be finite"),
    ({"position": (0.2, 0.1)}, "takes 3 numbers (x, y, z in m), not 2"),
    ({"position": 0.2}, "takes 3 numbers (x, y, z in m), not 0.2"),
    ({"position": (250, 150, 100)}, "if it is in millimetres, write gemelo.mm(250)"),
    ({"position": (0.2, 0.1, 0.1), "frame": "hand"}, 'rm1 has no link "hand"'),
    ({"position": (0.2, 0.1, 0.1), "orientation": (0, 0, 0, 2)}, "a quaternion of length 2.0000, not 1"),
    ({"position": (0.2, 0.1, 0.1), "rpy": (180, 0, 0)}, "if it is in degrees, write gemelo.deg(180)"),
    ({"position": (0.2, 0.1, 0.1), "rpy": (0, 0, 0), "along": (0, 0, 1)}, "not by rpy= and along="),
    ({"position": (0.2, 0.1, 0.1), "axis": (0, 0, 1)}, "say with along="),
    ({"named": "ready", "frame": "base_link"}, "frame= does not go with named"),
    ({"named": "ready", "speed": 50}, "not in (0, 1], a share of the joints' limits; 50 per cent is 0.5"),
    ({"named": "ready", "speed": 0}, "speed=0 is not in (0, 1]"),
    ({"named": "ready", "acceleration": -1}, "acceleration=-1 is not in (0, 1]"),
    ({"named": "ready", "allowed_time": 0}, "allowed_time=0 is not above 0"),
    ({"named": "ready", "clearance": 4}, "clearance=4 m is not from 0.0005 to 0.05 m; if it is in millimetres, write"),
    ({"named": "ready", "clearance": 0.0004}, "clearance=0.0004 m is not from 0.0005 to 0.05 m"),
    ({"named": "ready", "attempts": 0}, "attempts=0 is not from 1 to 1000"),
    ({"named": "ready", "ptp": True, "attempts": 3}, "attempts= does not go with ptp="),
    ({"named": "ready", "blend": 0.01}, "blend= does not go with a goal without via="),
    ({"named": "ready", "tool_speed": 0.1}, "tool_speed= does not go with a free motion"),
    ({"named": "ready", "ptp": True, "line": True}, "one path at a time, not line= and ptp="),
    ({"position": (0.2, 0.1, 0.1), "line": True, "tool_speed": 30}, "write gemelo.mm(30)"),
    ({"position": (0.2, 0.1, 0.1), "line": True, "seed": 3}, "seed= does not go with line="),
    ({"position": (0.2, 0.1, 0.1), "line": True, "least_fraction": 1.5}, "least_fraction=1.5  is more than 1"),
    ({"position": (0.2, 0.1, 0.1), "via": [(0.2, 0.1)], "blend": 0.1}, "via= takes 3 numbers"),
    ({"position": (0.2, 0.1, 0.1), "via": ["redy"]}, 'did you mean "ready"?'),
    ({"offset": (0, 0, 0.1), "rpy": (0, 0, 0)}, "offset= leaves the tool turned as it is"),
    ({"offset": (0, 0, 50)}, "write gemelo.mm(50)"),
]


@table(("target", "said"), BAD, ids=[said for _, said in BAD])
def test_an_argument_that_cannot_be_meant_is_refused_with_the_remedy(
    rm1: ArmDescription, target: dict[str, Any], said: str
) -> None:
    with pytest.raises(gemelo.BadArgument) as refusal:
        request(rm1, **target)
    assert said in str(refusal.value)
    assert refusal.value.reason.code.startswith("argument.")


def test_arguments_become_the_goal_that_they_name(rm1: ArmDescription) -> None:
    assert request(rm1, named="ready").goal == NamedGoal(name="ready")
    assert request(rm1, joints={"brazo_joint": 1}).goal == JointGoal(name=("brazo_joint",), position=(1.0,))
    assert request(rm1, joints=(0.1, 0.2, 0.05)).goal == JointGoal(name=rm1.joint_names, position=(0.1, 0.2, 0.05))
    goal = request(rm1, position=(0.2, 0.1, 0.1), along=(0, 0, -1), frame="brazo_link").goal
    assert goal == PoseGoal(
        position=(0.2, 0.1, 0.1), tool_axis=(0.0, 0.0, 1.0), direction=(0.0, 0.0, -1.0), frame="brazo_link"
    )
    assert request(rm1, pose=HERE).goal == PoseGoal(position=HERE.position, orientation=HERE.orientation)


def test_the_clearance_is_the_robots_own_unless_it_is_given(rm1: ArmDescription) -> None:
    assert request(rm1, named="ready").clearance is None
    assert request(rm1, named="ready", clearance=gemelo.mm(1)).clearance == 0.001


def test_arguments_become_the_motion_that_they_name(rm1: ArmDescription) -> None:
    goal = {"position": (0.2, 0.1, 0.1)}
    assert request(rm1, **goal, ptp=True).motion == PointToPoint()
    assert request(rm1, **goal, line=True, tool_speed=0.03).motion == LinearMotion(speed=0.03)
    assert request(rm1, **goal, through=(0.2, 0, 0.1)).motion == CircularMotion(interim=(0.2, 0.0, 0.1))
    assert request(rm1, **goal, center=(0.2, 0, 0.1)).motion == CircularMotion(center=(0.2, 0.0, 0.1))
    points = request(rm1, **goal, via=["ready", (0.3, 0.0, 0.1), {"brazo_joint": 0.1}, HERE], blend=0.01).goal
    assert points == WaypointGoal(
        points=(
            NamedGoal(name="ready"),
            PoseGoal(position=(0.3, 0.0, 0.1)),
            JointGoal(name=("brazo_joint",), position=(0.1,)),
            PoseGoal(position=HERE.position, orientation=HERE.orientation),
            PoseGoal(position=(0.2, 0.1, 0.1)),
        ),
        blend=0.01,
    )
    asked = request(rm1, named="ready", speed=0.5, time_optimal=True, from_joints={"brazo_joint": 0.1})
    assert (asked.velocity_scaling, asked.acceleration_scaling, asked.timing) == (0.5, 0.5, Timing.TIME_OPTIMAL)
    assert asked.start is not None
    assert asked.start.position == (0.1,)


def test_an_offset_is_from_where_the_tool_is_and_keeps_what_the_arm_can_keep(rm1: ArmDescription) -> None:
    goal = request(rm1, offset=(0.0, 0.0, -0.05)).goal
    assert isinstance(goal, PoseGoal)
    assert goal.position == pytest.approx((0.2, 0.1, 0.1))
    assert (goal.direction, goal.orientation) == ((0.0, 0.0, -1.0), ())  # three joints: its axis, not its yaw
    in_tool = request(rm1, offset=(0.0, 0.0, 0.05), frame="efector_link").goal
    assert isinstance(in_tool, PoseGoal)
    assert in_tool.position == pytest.approx((0.2, 0.1, 0.1))  # the tool's z looks down


JOGS: list[tuple[Callable[[ArmDescription], object], str]] = [
    (lambda arm: jog_command(arm, None, None, ""), "by one of joints= (speeds by name) and twist="),
    (lambda arm: jog_command(arm, {"brazo_joint": 0.1}, (0, 0, 0.1), ""), "by one of"),
    (lambda arm: jog_command(arm, {"brazo_joint": 30}, None, ""), "if it is in deg/s, write gemelo.deg(30)"),
    (lambda arm: jog_command(arm, None, (50, 0, 0), ""), "if it is in mm/s, write gemelo.mm(50)"),
    (lambda arm: jog_command(arm, None, (0, 0), ""), "takes 3 numbers (m/s) or 6 (m/s and rad/s), not 2"),
    (lambda arm: jog_command(arm, None, (0, 0, math.nan), ""), "twist[2] is nan"),
    (lambda arm: jog_command(arm, None, (0, 0, 0.1), "brazo_link"), "along the axes of base_link or efector_link"),
]


ROW = {"brazo_joint": 0.1}
BAD_STREAMS = [
    ((ROW, {"brazo_joint": 30}, (), 0.0), "argument.jog.fast"),
    ((ROW, {"efector_joint": 0.1}, (), 0.0), "argument.stream.joints"),
    ((ROW, None, [ROW], 0.0), "argument.stream.period"),
    ((ROW, None, [ROW] * 50, 0.2), "argument.stream.period"),
    ((ROW, None, [ROW] * 129, 0.01), "argument.stream.many"),
    ((ROW, None, [{"efector_joint": 0.1}], 0.1), "argument.stream.joints"),
    ((ROW, None, [ROW, {"brazo_joint": 3.5}], 0.1), "argument.joint.beyond"),
    ((ROW, None, [ROW, (0.1, 0.2)], 0.1), "argument.numbers"),
]


@table(("given", "code"), BAD_STREAMS)
def test_a_stream_that_cannot_be_meant_is_refused(rm1: ArmDescription, given: tuple[Any, ...], code: str) -> None:
    with pytest.raises(gemelo.BadArgument) as refusal:
        targets_of(rm1, *given)
    assert refusal.value.reason.code == code


def test_a_stream_s_velocity_and_chunk_are_in_the_order_of_its_joints(rm1: ArmDescription) -> None:
    first, later = {"brazo_joint": 0.1, "efector_joint": 0.02}, {"efector_joint": 0.03, "brazo_joint": 0.2}
    targets = targets_of(rm1, first, {"efector_joint": 0.0, "brazo_joint": 0.3}, [later, first], 0.1)
    assert targets.velocity == (0.3, 0.0)
    assert [(each.time, each.position) for each in targets.ahead] == [(0.1, (0.2, 0.03)), (0.2, (0.1, 0.02))]


@table(("ask", "said"), JOGS, ids=[said for _, said in JOGS])
def test_a_jog_that_cannot_be_meant_is_refused(
    rm1: ArmDescription, ask: Callable[[ArmDescription], object], said: str
) -> None:
    with pytest.raises(gemelo.BadArgument) as refusal:
        ask(rm1)
    assert said in str(refusal.value)
    assert refusal.value.reason.code.startswith("argument.")


MEANT: list[tuple[dict[str, Any], Reason]] = [
    ({"named": "redy"}, because("argument.named.unknown", remedy("did_you_mean", name="ready"), name="redy")),
    (
        {"position": (0.25, 0.1, 120.0)},
        because("argument.point.far", remedy("in_millimetres", value=120.0), argument="position", value=120.0),
    ),
    (
        {"named": "ready", "speed": 50},
        because("argument.share", remedy("percent_is", value=50.0, share=0.5), argument="speed", value=50.0),
    ),
    (
        {"position": (0.2, 0.1, 0.1), "line": True, "max_step": 0.0},
        because("argument.not_positive", argument="max_step", value=0.0, unit="m"),
    ),
    ({"named": "ready", "rpy": (0, 0, 0)}, because("argument.not_with", argument="rpy", other="named")),
]


@table(("target", "reason"), MEANT, ids=[reason.code for _, reason in MEANT])
def test_a_refused_argument_is_data(rm1: ArmDescription, target: dict[str, Any], reason: Reason) -> None:
    with pytest.raises(gemelo.BadArgument) as refusal:
        request(rm1, **target)
    assert refusal.value.reason == reason


POINT_IN_MM = because("argument.point.far", remedy("in_millimetres", value=120.0), argument="position", value=120.0)


@table(
    ("language", "front_end", "said"),
    [
        ("en", FrontEnd.SCRIPT, "position= has 120 m: if it is in millimetres, write gemelo.mm(120)"),
        ("en", FrontEnd.COMMAND, "--to has 120 m: if it is in millimetres, write 120mm"),
        ("en", FrontEnd.FILE, 'position has 120 m: if it is in millimetres, write "120mm"'),
        ("es", FrontEnd.COMMAND, "--to tiene 120 m, que es demasiado: si está en milímetros, escriba 120mm"),
        ("es", FrontEnd.PAGE, "La posición tiene 120 m, que es demasiado: si está en milímetros, escriba 120mm"),
    ],
)
def test_an_argument_is_named_as_the_reader_has_it(language: str, front_end: FrontEnd, said: str) -> None:
    assert say(POINT_IN_MM, language, front_end) == said
    in_a_file = because("file.line", POINT_IN_MM, file="tour.toml", line=4)
    assert ('write "120mm"' in say(in_a_file, "en", front_end)) is (front_end is not FrontEnd.PAGE)


@given(value=st.floats(allow_nan=True, allow_infinity=True))
def test_no_number_gets_through_that_a_message_would_not_take(rm1: ArmDescription, value: float) -> None:
    for target in (
        {"joints": {"brazo_joint": value}},
        {"position": (value, 0.1, 0.1)},
        {"named": "ready", "speed": value},
    ):
        try:
            asked = request(rm1, **target)
        except gemelo.BadArgument:
            continue
        msgspec.msgpack.encode(asked)
        assert math.isfinite(value)


@given(value=st.floats(min_value=-2.9, max_value=2.9))
def test_what_is_within_the_limits_is_never_taken_for_another_unit(rm1: ArmDescription, value: float) -> None:
    goal = request(rm1, joints={"brazo_joint": value}).goal
    assert goal == JointGoal(name=("brazo_joint",), position=(value,))


def test_the_nearest_goal_of_a_refusal_is_arguments_again(rm1: ArmDescription) -> None:
    target = Target(position=(0.6, 0.1, 0.1), speed=0.5, frame="brazo_link", along=(0.0, 0.0, 1.0))
    asked = request(rm1, **target)
    refusal = Refusal(check="reach", message="too far", nearest=(0.4, 0.1, 0.1, 0.0, 0.0, -1.0), remedy="go nearer")
    error = refused(rm1, refusal, asked, target, -31)
    assert error.nearest == {
        "position": (0.4, 0.1, 0.1), "speed": 0.5, "frame": "brazo_link", "along": (0.0, 0.0, -1.0)
    }  # fmt: skip
    assert "nearest that can: speed=0.5, frame='brazo_link', position=(0.4, 0.1, 0.1)" in str(error)
    request(rm1, **error.nearest)
    start = Refusal(check="start state", message="beyond", nearest=(0.2,), remedy="jog back")
    assert refused(rm1, start, asked, target, -18).nearest == {}
    assert str(refused(rm1, start, asked, target, -18)).endswith("beyond; jog back")
    assert (str(error.reason), error.refusal) == ("too far", refusal)


def test_a_refusal_without_a_nearest_goal_ends_with_its_remedy(rm1: ArmDescription) -> None:
    refusal = Refusal(check="unknown link", message='rm1 has no link "x"', remedy="name another")
    error = refused(rm1, refusal, PlanRequest(), Target(), -31)
    assert error.nearest == {}
    assert str(error) == 'refused (unknown link): rm1 has no link "x"; name another'


def test_as_target_copies(rm1: ArmDescription) -> None:
    goal = gemelo.ToolGoal(position=(0.1, 0.2, 0.3))
    as_target(goal)["line"] = True
    assert "line" not in goal
