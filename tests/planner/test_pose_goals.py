"""Pose goals in all their forms on both arms: met to tolerance and within limits, or refused with what is missing."""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path

import msgspec
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.planning import PlanCode, PoseGoal, Refusal
from gemelo.services.planner.kinematics.goals import Goals, Start
from gemelo.services.planner.request.deadline import NEVER
from gemelo.services.planner.request.refusals import PlanRefused
from tests.profiles import examples

ROOT = Path(__file__).parents[2] / "urdf"
FORMS = ("position", "pose", "free axis", "pointing")


class Bench:
    """One arm, and what it says to goals."""

    def __init__(self, name: str) -> None:
        self.arm: ArmDescription = load_arm(ROOT / name)
        self.kinematics = Kinematics(self.arm)
        self.goals = Goals(self.arm, self.kinematics)
        self.ready: Start = self.arm.named_states["ready"]

    def configurations(self, goal: PoseGoal, near: Start | None = None, most: int = 4) -> list[Start]:
        return list(islice(self.goals.candidates(goal, near or self.ready, NEVER), most))

    def refusal(self, goal: PoseGoal) -> tuple[PlanCode, Refusal]:
        with pytest.raises(PlanRefused) as caught:
            self.configurations(goal)
        return caught.value.code, caught.value.refusal


RM1, PAROL6 = Bench("rm1"), Bench("parol6")
BENCHES = {"rm1": RM1, "parol6": PAROL6}


def shares(count: int = 6) -> st.SearchStrategy[list[float]]:
    return st.lists(st.floats(0.0, 1.0), min_size=count, max_size=count)


def configuration_of(bench: Bench, where: list[float]) -> Start:
    """The configuration at these shares of the joints' ranges."""
    return tuple(j.lower + share * (j.upper - j.lower) for j, share in zip(bench.arm.joints, where, strict=False))


def quaternion(rotation: np.ndarray) -> tuple[float, ...]:
    turn = pin.Quaternion(rotation)
    return (turn.x, turn.y, turn.z, turn.w)


def goal_of(form: str, pose: FramePose, axis: np.ndarray) -> PoseGoal:
    """The pose in one of the forms."""
    position = tuple(pose.position.tolist())
    match form:
        case "position":
            return PoseGoal(position=position)
        case "pose":
            return PoseGoal(position=position, orientation=quaternion(pose.rotation))
        case "free axis":
            turned = pose.rotation @ pin.exp3(1.3 * axis)
            return PoseGoal(position=position, orientation=quaternion(turned), free_axis=tuple((2.0 * axis).tolist()))
        case _:
            direction = tuple((0.5 * pose.rotation @ axis).tolist())
            return PoseGoal(position=position, tool_axis=tuple(axis.tolist()), direction=direction)


def missing(form: str, wanted: FramePose, got: FramePose, axis: np.ndarray) -> tuple[float, float]:
    """[m] and [rad] between two poses, as far as the form asks."""
    far = float(np.linalg.norm(wanted.position - got.position))
    if form == "position":
        return far, 0.0
    if form == "pose":
        return far, float(np.linalg.norm(pin.log3(wanted.rotation.T @ got.rotation)))
    first, second = wanted.rotation @ axis, got.rotation @ axis
    return far, math.atan2(float(np.linalg.norm(np.cross(first, second))), float(first @ second))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", BENCHES)
@examples(quick=8, full=25)
@given(shares(), shares(), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_fk_of_ik_is_the_goal_in_every_form(
    name: str, form: str, where: list[float], near: list[float], axis: tuple[float, float, float]
):
    assume(math.hypot(*axis) > 0.1)
    bench, unit = BENCHES[name], np.array(axis) / math.hypot(*axis)
    pose = bench.kinematics.tool(configuration_of(bench, where))
    for configuration in bench.configurations(goal_of(form, pose, unit), configuration_of(bench, near), most=3):
        far, turned = missing(form, pose, bench.kinematics.tool(configuration), unit)
        assert far < 1e-6
        assert turned < 1e-5
        assert all(j.is_within(value) for j, value in zip(bench.arm.joints, configuration, strict=True))


@pytest.mark.parametrize("form", ["free axis", "pointing"])
@pytest.mark.parametrize("where", [(1.0, 0.0, 0.0, 0.0, 0.0, 0.375), (0.0, 1.0, 1.0, 0.0, 1.0, 0.5)])
def test_a_goal_that_one_configuration_alone_meets_in_a_corner_of_the_limits_is_found(
    form: str, where: tuple[float, ...]
):
    axis = np.array([0.0, -0.125, 1.0]) / math.hypot(0.125, 1.0)
    pose = PAROL6.kinematics.tool(configuration_of(PAROL6, [*where]))
    (configuration, *_) = PAROL6.configurations(goal_of(form, pose, axis), configuration_of(PAROL6, [0.0] * 6), most=1)
    far, turned = missing(form, pose, PAROL6.kinematics.tool(configuration), axis)
    assert far < 1e-6
    assert turned < 1e-5
    assert all(j.is_within(value) for j, value in zip(PAROL6.arm.joints, configuration, strict=True))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", BENCHES)
def test_solutions_are_distinct(name: str, form: str):
    bench = BENCHES[name]
    pose = bench.kinematics.tool(bench.ready)
    configurations = bench.configurations(goal_of(form, pose, np.array([0.0, 0.0, 1.0])), most=20)
    for index, configuration in enumerate(configurations):
        assert all(bench.goals.travel(configuration, other) > 1e-4 for other in configurations[:index])


@pytest.mark.parametrize("form", ["pose", "pointing"])
def test_the_closed_form_gives_the_nearest_first(form: str):
    configuration = (0.3, -1.2, 3.3, 1.5, 0.5, 1.0)  # its wrist may be flipped
    pose, near = PAROL6.kinematics.tool(configuration), tuple(value + 0.3 for value in configuration)
    configurations = PAROL6.configurations(goal_of(form, pose, np.array([0.0, 0.0, 1.0])), near, most=20)
    travels = [PAROL6.goals.travel(near, configuration) for configuration in configurations]
    assert len(travels) >= 2
    assert travels == sorted(travels)


def test_a_pose_is_met_in_a_frame_that_moves_with_the_arm():
    frame = "antebrazo_link"
    goal = PoseGoal(position=(0.15, 0.0, 0.0), frame=frame, tool_axis=(0.0, 0.0, 1.0), direction=(0.0, 0.0, -1.0))
    link = RM1.kinematics.link_poses(RM1.ready)[frame]
    turn = pin.Quaternion(np.array(link.rotation)).matrix()
    wanted = np.array(link.translation) + turn @ np.array(goal.position)
    got = RM1.kinematics.tool(RM1.configurations(goal)[0])
    assert np.allclose(got.position, wanted, atol=1e-6)
    assert np.allclose(got.rotation[:, 2], turn @ [0.0, 0.0, -1.0], atol=1e-6)


# rm1: three joints, so no tilt, and a yaw that follows from the position.


def test_rm1_takes_a_direction_straight_down():
    goal = PoseGoal(position=(0.25, 0.15, 0.1), tool_axis=(0.0, 0.0, 1.0), direction=(0.0, 0.0, -1.0))
    assert len(RM1.configurations(goal)) == 2


def test_rm1_takes_exactly_the_yaw_that_a_configuration_gives():
    pose = RM1.kinematics.tool((0.4, 1.1, 0.05))
    configurations = RM1.configurations(goal_of("pose", pose, np.zeros(3)))
    assert [pytest.approx((0.4, 1.1, 0.05), abs=1e-5)] == configurations


@pytest.mark.parametrize("degrees", [0.5, 20.0, 90.0])
def test_rm1_says_that_it_cannot_tilt_its_tool_and_by_how_much(degrees: float):
    pose = RM1.kinematics.tool((0.4, 1.1, 0.05))
    tilted = pin.exp3(np.array([math.radians(degrees), 0.0, 0.0])) @ pose.rotation
    code, refusal = RM1.refusal(PoseGoal(position=tuple(pose.position.tolist()), orientation=quaternion(tilted)))
    assert code is PlanCode.INVALID_GOAL_CONSTRAINTS
    assert (refusal.check, refusal.subject) == ("orientation", "tilt")
    assert refusal.value == pytest.approx(math.radians(degrees))
    assert f"rm1 cannot tilt its tool, and its yaw follows from the position: the goal is {degrees:g} deg" in (
        refusal.message
    )
    assert refusal.remedy == "ask for the position alone, or ask for the position + yaw"


def test_rm1_says_how_far_a_direction_is_from_those_that_its_tool_can_have():
    goal = PoseGoal(position=(0.25, 0.15, 0.1), tool_axis=(0.0, 0.0, 1.0), direction=(1.0, 0.0, -1.0))
    _, refusal = RM1.refusal(goal)
    assert refusal.subject == "tilt"
    assert refusal.value == pytest.approx(math.pi / 4.0)
    assert refusal.nearest == pytest.approx((0.25, 0.15, 0.1, 0.0, 0.0, -1.0), abs=1e-6)


def test_a_yaw_that_the_position_does_not_give_is_refused_with_the_nearest_one_that_it_does():
    pose = RM1.kinematics.tool((0.4, 1.1, 0.05))
    turned = pin.exp3(np.array([0.0, 0.0, 0.01])) @ pose.rotation
    goal = PoseGoal(position=tuple(pose.position.tolist()), orientation=quaternion(turned))
    code, refusal = RM1.refusal(goal)
    assert code is PlanCode.NO_IK_SOLUTION
    assert (refusal.check, refusal.subject) == ("orientation", "orientation")
    assert refusal.value == pytest.approx(0.01, abs=1e-4)
    assert refusal.nearest == pytest.approx((*pose.position, *quaternion(pose.rotation)), abs=1e-4)
    assert "orientation_tolerance of 0.01 rad" in refusal.remedy or "0.0101 rad" in refusal.remedy
    nearest = PoseGoal(position=refusal.nearest[:3], orientation=refusal.nearest[3:])
    assert RM1.configurations(nearest)


@pytest.mark.parametrize(("position", "orientation"), [(0.0011, 0.0101), (0.0011, 0.1), (0.02, 0.0101)])
def test_a_tolerance_takes_what_is_within_it(position: float, orientation: float):
    goal = slightly_out_of_reach(position, orientation)
    wanted = pin.Quaternion(np.array(goal.orientation)).matrix()
    configurations = RM1.configurations(goal)
    assert configurations
    for configuration in configurations:
        got = RM1.kinematics.tool(configuration)
        assert np.linalg.norm(got.position - goal.position) <= position
        assert np.linalg.norm(pin.log3(wanted.T @ got.rotation)) <= orientation


@pytest.mark.parametrize(("position", "orientation"), [(0.0009, 0.1), (0.02, 0.0099), (0.0, 0.0)])
def test_a_tolerance_takes_nothing_that_is_beyond_it(position: float, orientation: float):
    RM1.refusal(slightly_out_of_reach(position, orientation))


def slightly_out_of_reach(position_tolerance: float, orientation_tolerance: float) -> PoseGoal:
    """1 mm below where rm1's rack ends, and tilted by 0.01 rad."""
    pose = RM1.kinematics.tool((0.4, 1.1, 0.0))
    x, y, z = pose.position.tolist()
    tilted = pin.exp3(np.array([0.0, 0.01, 0.0])) @ pose.rotation
    return PoseGoal(
        position=(x, y, z - 0.001),
        orientation=quaternion(tilted),
        position_tolerance=position_tolerance,
        orientation_tolerance=orientation_tolerance,
    )


@pytest.mark.parametrize("name", BENCHES)
@examples(quick=5, full=15)
@given(shares(), st.tuples(*[st.floats(-1.0, 1.0)] * 4), st.booleans())
def test_the_nearest_pose_of_a_refusal_can_be_asked_for(
    name: str, where: list[float], turn: tuple[float, ...], is_pointing: bool
):
    assume(math.hypot(*turn) > 0.1 and math.hypot(*turn[:3]) > 0.1)
    bench = BENCHES[name]
    position = tuple(bench.kinematics.tool(configuration_of(bench, where)).position.tolist())
    asked = PoseGoal(position=position, orientation=tuple(value / math.hypot(*turn) for value in turn))
    if is_pointing:
        asked = PoseGoal(position=position, tool_axis=(0.0, 0.0, 1.0), direction=turn[:3])
    try:
        bench.configurations(asked, most=1)
        return
    except PlanRefused as refused:
        nearest = refused.refusal.nearest
    again = msgspec.structs.replace(asked, position=nearest[:3], orientation=nearest[3:])
    if is_pointing:
        again = msgspec.structs.replace(asked, position=nearest[:3], direction=nearest[3:])
    assert bench.configurations(again, most=1)


def test_where_exact_can_be_had_a_tolerance_does_not_make_it_worse():
    pose = PAROL6.kinematics.tool(PAROL6.ready)
    goal = PoseGoal(position=tuple(pose.position.tolist()), position_tolerance=0.05)
    near = tuple(value + 0.02 for value in PAROL6.ready)
    got = PAROL6.kinematics.tool(PAROL6.configurations(goal, near)[0])
    assert np.linalg.norm(got.position - pose.position) < 1e-6


def test_parol6_says_what_is_missing_at_the_edge_of_its_reach():
    stretched = PAROL6.kinematics.tool((0.0, -1.2, math.pi, 0.0, 0.0, math.pi))
    turned = pin.exp3(np.array([0.0, 2.5, 0.0])) @ stretched.rotation
    goal = PoseGoal(position=tuple(stretched.position.tolist()), orientation=quaternion(turned))
    code, refusal = PAROL6.refusal(goal)
    assert code is PlanCode.NO_IK_SOLUTION
    assert refusal.check == "orientation"
    assert refusal.value is not None
    assert 0.0 < refusal.value <= 2.5
    nearest = PoseGoal(position=refusal.nearest[:3], orientation=refusal.nearest[3:])
    assert PAROL6.configurations(nearest)


DOWN = (0.0, 0.0, -1.0)
HERE = (0.25, 0.15, 0.1)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("goal", "subject", "said"),
    [
        (PoseGoal(), "position", "position has 3 numbers, not 0"),
        (PoseGoal(position=(0.1, 0.2)), "position", "not 2"),
        (PoseGoal(position=(1e300, 0.0, 0.0)), "position", "1e+300 0 0 m is no place"),
        (PoseGoal(position=HERE, orientation=(0.0, 0.0, 1.0)), "orientation", "has 4 numbers, not 3"),
        (PoseGoal(position=HERE, orientation=(0.0, 0.0, 0.0, 0.0)), "orientation", "its length is 0"),
        (PoseGoal(position=HERE, orientation=(0.0, 0.0, 0.0, 2.0)), "orientation", "its length is 2"),
        (PoseGoal(position=HERE, orientation=(1e200, 0.0, 0.0, 1e200)), "orientation", "no unit quaternion"),
        (PoseGoal(position=HERE, free_axis=(0.0, 0.0, 1.0)), "free_axis", "a free_axis of 0 0 1, and no orientation"),
        (PoseGoal(position=HERE, orientation=UPRIGHT, free_axis=(0.0, 0.0, 0.0)), "free_axis", "it shows nowhere"),
        (PoseGoal(position=HERE, orientation=UPRIGHT, free_axis=(1.0,)), "free_axis", "has 3 numbers, not 1"),
        (PoseGoal(position=HERE, tool_axis=DOWN), "direction", "a tool_axis of 0 0 -1, and no direction"),
        (PoseGoal(position=HERE, direction=DOWN), "tool_axis", "a direction of 0 0 -1, and no tool_axis"),
        (PoseGoal(position=HERE, tool_axis=(0.0, 0.0, 0.0), direction=DOWN), "tool_axis", "0 0 0 has length 0"),
        (PoseGoal(position=HERE, tool_axis=DOWN, direction=(1e-12, 0.0, 0.0)), "direction", "it shows nowhere"),
        (PoseGoal(position=HERE, tool_axis=DOWN, direction=(1e308, 1e308, 0.0)), "direction", "1.414e+308"),
        (PoseGoal(position=HERE, orientation=UPRIGHT, tool_axis=DOWN, direction=DOWN), "orientation", "as well"),
        (PoseGoal(position=HERE, position_tolerance=-0.001), "position_tolerance", "-0.001 m, below 0"),
        (PoseGoal(position=HERE, orientation_tolerance=-0.1), "orientation_tolerance", "-0.1 rad, below 0"),
    ],
)
def test_what_contradicts_itself_is_refused_with_value_and_remedy(goal: PoseGoal, subject: str, said: str):
    code, refusal = PAROL6.refusal(goal)
    assert code is PlanCode.INVALID_GOAL_CONSTRAINTS
    assert refusal.subject == subject
    assert said in refusal.message
    assert refusal.remedy


def test_a_quaternion_that_is_only_too_long_is_told_as_it_should_be():
    _, refusal = PAROL6.refusal(PoseGoal(position=HERE, orientation=(0.0, 2.0, 0.0, 0.0)))
    assert refusal.remedy == "give x y z w of length 1, as 0 1 0 0"


@pytest.mark.parametrize("field", ["position", "orientation", "free_axis", "tool_axis", "direction"])
def test_what_is_not_a_number_cannot_get_in(field: str):
    with pytest.raises(ValueError, match=f"{field}\\[0\\]` is nan"):
        PoseGoal(**{field: (math.nan, 0.0, 0.0)})


@examples(quick=15, full=60)
@given(st.builds(
    PoseGoal,
    position=st.lists(st.floats(-1e12, 1e12), max_size=4).map(tuple) | st.just((0.2, 0.1, 0.2)),
    orientation=st.just(()) | st.lists(st.floats(-1e200, 1e200), max_size=4).map(tuple) | st.just(UPRIGHT),
    free_axis=st.just(()) | st.lists(st.floats(-1e200, 1e200), max_size=4).map(tuple),
    tool_axis=st.just(()) | st.lists(st.floats(-1e200, 1e200), max_size=4).map(tuple),
    direction=st.just(()) | st.lists(st.floats(-1e200, 1e200), max_size=4).map(tuple),
    position_tolerance=st.just(0.0) | st.floats(-1e300, 1e300),
    orientation_tolerance=st.just(0.0) | st.floats(-1e300, 1e300),
))  # fmt: skip
@example(PoseGoal(position=(1e200, 0.0, 0.1)))
@example(PoseGoal(position=(1.7e308, 1.7e308, -1.7e308)))
@example(PoseGoal(position=(0.2, 0.1, 0.1), position_tolerance=1e200))
@example(PoseGoal(position=(0.2, 0.1, 0.1), orientation=(0.0, 0.0, 0.0, 1.0), orientation_tolerance=1e200))
@example(PoseGoal(position=(9.2, 0.1, 0.1), position_tolerance=1e200))
@pytest.mark.parametrize("name", BENCHES)
def test_whatever_pose_is_asked_for_there_are_configurations_or_a_reason(name: str, goal: PoseGoal):
    bench = BENCHES[name]
    try:
        configurations = bench.configurations(goal, most=1)
    except PlanRefused as refused:
        refusal = refused.refusal
    else:
        assert configurations
        return
    assert refusal.message
    assert refusal.remedy
