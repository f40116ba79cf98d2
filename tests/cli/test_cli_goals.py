"""Goals from the command line's words, and refusals in words."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.device import ReferenceCommand
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import Goal, JointGoal, NamedGoal, PoseGoal, Refusal
from gemelo.tools.cli.bus.request_text import as_typed, refusal_reason
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.common.units import parse_joints
from gemelo.tools.cli.device.device import reference_request
from gemelo.tools.cli.main import parse
from gemelo.tools.cli.motion.move_report import MoveReport, summary, tool_error
from gemelo.tools.cli.motion.move_request import request_from

ARM = load_arm(Path(__file__).parents[2] / "urdf/rm1")


def goal_of(line: str) -> Goal:
    return request_from(parse(line.split()), ARM).goal


def test_the_command_line_becomes_a_pose_goal():
    assert goal_of("move --to 0.25 -0.15 -1e-3") == PoseGoal(position=(0.25, -0.15, -0.001))


def test_the_command_line_becomes_a_joint_goal():
    assert goal_of("move --joints brazo_joint=30deg q3=-40mm") == JointGoal(
        name=("brazo_joint", "efector_joint"), position=(pytest.approx(math.pi / 6), -0.04)
    )


def test_the_command_line_becomes_a_named_goal():
    assert goal_of("move --named ready") == NamedGoal(name="ready")
    with pytest.raises(CommandError, match='did you mean "ready"'):
        goal_of("move --named redy")


@pytest.mark.parametrize(
    "words",
    [
        ["move"],
        ["move", "--to", "1", "2"],
        ["move", "--to", "1", "2", "nan"],
        ["move", "--to", "1", "2", "3", "--named", "ready"],
        ["move", "--named", "ready", "--spede", "1"],
        ["mvoe"],
        [],
    ],
)
def test_what_cannot_be_understood_ends_with_two(words):
    with pytest.raises(SystemExit) as ended:
        parse(words)
    assert ended.value.code == ExitCode.USAGE


@pytest.mark.parametrize(
    ("share", "said"),
    [("0%", "0% is not above 0"), ("-10%", "-10% is not above 0"), ("101%", "101% is not above 0% and at most 100%")],
)
def test_a_speed_outside_its_range_is_refused(share, said):
    with pytest.raises(CommandError, match=f"--speed {said}"):
        goal_of(f"move --named ready --speed {share}")


def test_a_refusal_says_why_and_what_would_do():
    goal = PoseGoal(position=(2.0, 0.0, 0.1))
    refusal = Refusal(check="reach", message="2.000 m is out of reach", nearest=(0.4, 0.0, 0.1), remedy="come nearer")
    assert str(refusal_reason(refusal, goal, ARM)) == (
        "refused (reach): 2.000 m is out of reach; nearest that can: --to 0.4000 0.0000 0.1000"
    )


def test_a_refusal_without_a_nearest_goal_has_its_remedy():
    refusal = Refusal(check="state", message="the arm's state is 3 s old", remedy="look at `gemelo state`")
    text = str(refusal_reason(refusal, NamedGoal(name="ready"), ARM))
    assert text == "refused (state): the arm's state is 3 s old; look at `gemelo state`"


@given(st.floats(-2.9, 2.9), st.floats(0.0, 0.2))
def test_the_nearest_goal_can_be_typed_as_it_is_said(angle, travel):
    goal = JointGoal(name=("brazo_joint", "efector_joint"), position=(9.0, 9.0))
    words = as_typed(goal, (angle, travel), ARM).split()[1:]
    values = parse_joints(words, ARM.joints)
    assert values["brazo_joint"] == pytest.approx(angle, abs=1e-4)
    assert values["efector_joint"] == pytest.approx(travel, abs=1e-6)


def test_the_tool_error_of_one_step_of_the_lift_is_one_step_of_the_rack():
    trajectory = JointTrajectory(
        joint_names=ARM.joint_names, points=(TrajectoryPoint(positions=(0.6, -1.2, 0.08), time_from_start=1.0),)
    )
    assert tool_error(ARM, trajectory, {"efector_joint": 1.0}) == pytest.approx(math.tau * 0.0225 / 400, rel=1e-6)
    assert tool_error(ARM, trajectory, {}) == 0.0


def test_the_last_line_of_a_move():
    report = MoveReport(
        robot="rm1", status="SUCCEEDED", planned_s=0.00184, duration_s=3.2, took_s=3.214, final_error_m=4.2e-6,
        final_error_steps={"brazo_joint": 0.12, "efector_joint": -0.4},
    )  # fmt: skip
    assert summary(report, ARM) == (
        "planned in 1.8 ms, took 3.21 s, final error 0.004 mm, steps: brazo_joint +0.12, efector_joint -0.40"
    )
    assert report.exit_code is ExitCode.OK


@pytest.mark.parametrize(
    ("status", "interrupted", "code"),
    [("CANCELED", True, ExitCode.CANCELLED), ("CANCELED", False, ExitCode.FAILED), ("ABORTED", True, ExitCode.FAILED)],
)
def test_how_a_move_that_did_not_arrive_ends(status, interrupted, code):
    report = MoveReport(
        robot="rm1", status=status, succeeded=False, interrupted=interrupted, reason="boot id changed", planned_s=0.001,
        duration_s=1.0, stopped_at={"brazo_joint": math.radians(12.0)},
    )  # fmt: skip
    assert report.exit_code is code
    assert "brazo_joint 12.000 deg" in summary(report, ARM)


def test_a_reference_names_every_joint():
    request = reference_request(ARM, ["q1=90deg"])
    assert isinstance(request, ReferenceCommand)
    assert request.name == ARM.joint_names
    assert request.position == (pytest.approx(math.pi / 2), 0.0, 0.0)
