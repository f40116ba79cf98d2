"""Messages of ours and of ROS 2: what goes there and back is what it was."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.ros2 import messages
from gemelo.libraries.ros2.types import FOLLOW, decode, encode
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.frames import FrameTransform, FrameTransforms, Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.schemas.reasons import because
from gemelo.services.ros_bridge import core
from tests.ros_bridge.ros_goals import ros_goal

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)
NAMES = st.text("abcdefghij_", min_size=1, max_size=12)
STAMPS = st.integers(0, 2**31 * messages.SECOND - 1)
NANOSECONDS = st.integers(0, 10**13).map(lambda each: each / messages.SECOND)


@st.composite
def goals_of_ours(draw: st.DrawFn) -> FollowJointTrajectoryGoal:
    names = tuple(draw(st.lists(NAMES, min_size=1, max_size=7, unique=True)))
    row = st.tuples(*[NUMBERS] * len(names))
    point = st.builds(
        TrajectoryPoint, positions=row, velocities=row | st.just(()), accelerations=row | st.just(()),
        time_from_start=NANOSECONDS,
    )  # fmt: skip
    tolerance = st.builds(JointTolerance, name=st.sampled_from(names), position=NUMBERS, velocity=NUMBERS)
    return FollowJointTrajectoryGoal(
        trajectory=JointTrajectory(joint_names=names, points=tuple(draw(st.lists(point, max_size=5)))),
        path_tolerance=tuple(draw(st.lists(tolerance, max_size=2))),
        goal_tolerance=tuple(draw(st.lists(tolerance, max_size=2))),
        goal_time_tolerance=draw(NANOSECONDS),
    )


@given(goals_of_ours())
def test_a_goal_goes_to_ros_and_back_in_bytes(goal):
    read = decode(f"{FOLLOW}_Goal", encode(ros_goal(goal)))
    assert core.follow_goal(read, lambda stamp: stamp) == goal


@given(st.lists(st.tuples(NAMES, NUMBERS, NUMBERS), max_size=8), STAMPS)
def test_a_joint_state_keeps_its_names_their_order_and_its_stamp(rows, stamp):
    names, positions, velocities = zip(*rows, strict=True) if rows else ((), (), ())
    state = JointState(stamp=stamp, name=names, position=positions, velocity=velocities)
    read = decode("sensor_msgs/msg/JointState", encode(messages.joint_state(state)))
    assert messages.nanoseconds(read.header.stamp) == stamp
    assert (tuple(read.name), tuple(read.position), tuple(read.velocity)) == (names, positions, velocities)
    assert len(read.effort) == 0


@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.tuples(NUMBERS, NUMBERS, NUMBERS, NUMBERS), STAMPS)
def test_frames_keep_translation_and_rotation_and_have_the_prefix(translation, rotation, stamp):
    transform = Transform(translation=translation, rotation=rotation)
    frame = FrameTransform(stamp=stamp, parent="base", child="tool", transform=transform)
    message = messages.frames(FrameTransforms(transforms=(frame,)), "rm1/")
    (read,) = decode("tf2_msgs/msg/TFMessage", encode(message)).transforms
    moved, turned = read.transform.translation, read.transform.rotation
    assert (read.header.frame_id, read.child_frame_id) == ("rm1/base", "rm1/tool")
    assert (moved.x, moved.y, moved.z) == translation
    assert (turned.x, turned.y, turned.z, turned.w) == rotation
    assert messages.nanoseconds(read.header.stamp) == stamp


@given(st.floats(-1e5, 1e5, allow_nan=False))
def test_a_duration_is_exact_to_the_nanosecond_also_below_zero(seconds):
    duration = messages.duration_of(seconds)
    assert 0 <= duration.nanosec < messages.SECOND
    assert messages.nanoseconds(duration) == round(seconds * messages.SECOND)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
@pytest.mark.parametrize("field", ["positions", "velocities", "accelerations"])
def test_a_number_that_is_none_makes_no_goal(field, bad):
    goal = ros_goal(FollowJointTrajectoryGoal(trajectory=JointTrajectory(
        joint_names=("a",), points=(TrajectoryPoint(positions=(0.0,), time_from_start=1.0),))))  # fmt: skip
    setattr(goal.trajectory.points[0], field, np.array([bad]))
    with pytest.raises(core.GoalNotTaken) as refused:
        core.follow_goal(decode(f"{FOLLOW}_Goal", encode(goal)), lambda stamp: stamp)
    assert refused.value.reason.code == "ros.goal.not_finite"


def test_an_effort_makes_no_goal():
    goal = ros_goal(FollowJointTrajectoryGoal(trajectory=JointTrajectory(
        joint_names=("a",), points=(TrajectoryPoint(positions=(0.0,)),))))  # fmt: skip
    goal.trajectory.points[0].effort = np.array([1.0])
    with pytest.raises(core.GoalNotTaken) as refused:
        core.follow_goal(goal, lambda stamp: stamp)
    assert refused.value.reason == because("ros.goal.effort", *refused.value.reason.remedies)


def test_the_start_of_a_goal_is_by_the_gateway_s_clock_and_without_it_there_is_none():
    ours = FollowJointTrajectoryGoal(trajectory=JointTrajectory(stamp=10**18, joint_names=("a",)))
    assert core.follow_goal(ros_goal(ours), lambda stamp: stamp + 5).trajectory.stamp == 10**18 + 5
    with pytest.raises(core.GoalNotTaken) as refused:
        core.follow_goal(ros_goal(ours), lambda stamp: None)
    assert refused.value.reason.code == "ros.goal.clock"
    now = FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=("a",)))
    assert core.follow_goal(ros_goal(now), lambda stamp: None) == now


def test_a_result_has_our_code_and_our_sentence():
    why = because("ros.diagnostics.silent")
    result = core.follow_result(FollowJointTrajectoryResult(error_code=FollowErrorCode.NOT_IN_CONTROL, why=why))
    assert (result.error_code, result.error_string) == (-14, str(why))


def test_a_goal_that_another_one_replaced_is_aborted_and_all_other_states_are_those_of_ros():
    found = {each: core.status_in_ros(each) for each in GoalStatusCode}
    assert found.pop(GoalStatusCode.PREEMPTED) == 6
    assert found == {each: int(each) for each in found}


def test_only_relative_addresses_of_meshes_get_a_base():
    urdf = '<a><mesh filename="meshes/a.glb"/><mesh scale="1 1 1" filename="package://x/b.stl"/></a>'
    found = messages.urdf_with_meshes(urdf, lambda each: f"file:///arm/{each}")
    assert found == urdf.replace('"meshes/a.glb"', '"file:///arm/meshes/a.glb"')
    assert messages.relative_meshes(urdf) == ("meshes/a.glb",)
