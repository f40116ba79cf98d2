"""Goals of ROS 2 at the whole twin: accepted, followed, cancelled, refused, replaced, and ended with their client."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gemelo.libraries.ros2.messages import header_of
from gemelo.libraries.ros2.types import FOLLOW, GRIPPER, ControlMsgs, make, ros_type
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.topics import DEVICE_SHAFT
from gemelo.services.ros_bridge.core import uuid_of
from tests.ros_bridge.ros_goals import quintic, ros_goal
from tests.ros_bridge.twins import ACTION, RosTwin, client_token, ros_twin, uuid

FEEDBACK = f"{FOLLOW}_FeedbackMessage"
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[RosTwin]:
    with ros_twin(tmp_path) as found:
        yield found


def reach(ros: RosTwin, name: str = "left", seconds: float = 4.0, reverse: bool = False) -> FollowJointTrajectoryGoal:
    """To a named configuration in so many seconds [s]; `reverse`: with the joints in the other order."""
    arm = ros.twin.arm
    rows = list(zip(arm.joint_names, arm.named_states[name], strict=True))
    names, positions = zip(*(reversed(rows) if reverse else rows), strict=True)
    point = TrajectoryPoint(positions=tuple(positions), time_from_start=seconds)
    return FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=names, points=(point,)))


def at(ros: RosTwin) -> dict[str, float]:
    return dict(ros.arm.joints)


def off(ros: RosTwin, wanted: dict[str, float]) -> float:
    """[steps] by which the joint that is farthest off is, rounding of the last digit apart."""
    joints = {joint.name: joint.steps.per_unit for joint in ros.twin.arm.joints}
    return max(round(abs(at(ros)[name] - value) * joints[name], 6) for name, value in wanted.items())


def test_a_goal_is_accepted_followed_with_feedback_and_its_result_is_held_until_the_end(ros: RosTwin) -> None:
    of_jazzy = ros.client.subscribe(f"{ACTION}/feedback", FEEDBACK)
    newer = ros_type(FEEDBACK, ControlMsgs.NEWER)
    of_newer = ros.client.subscribe(f"{ACTION}/feedback", FEEDBACK, type_=newer)
    assert ros.send_goal(uuid(1), reach(ros, reverse=True)).accepted
    asked = ros.ask_result(uuid(1))
    assert ros.run_until(lambda: len(of_jazzy) > 10)
    assert not asked.is_over
    result = ros.answer(asked, 0.02)
    assert (result.status, result.result.error_code, result.result.error_string) == (SUCCEEDED, 0, "")
    assert off(ros, dict(zip(ros.twin.arm.joint_names, ros.twin.arm.named_states["left"], strict=True))) <= 0.5
    assert ros.run_until(lambda: len(of_newer) == len(of_jazzy))
    first = of_jazzy[0].message
    assert bytes(first.goal_id.uuid) == uuid(1)
    assert set(first.feedback.joint_names) == set(ros.twin.arm.joint_names)
    assert ros.result(uuid(1)).status == SUCCEEDED


def test_the_status_says_how_each_goal_stands_to_late_joiners_too(ros: RosTwin) -> None:
    assert ros.send_goal(uuid(1), reach(ros)).accepted
    heard = ros.client.subscribe(f"{ACTION}/status", "action_msgs/msg/GoalStatusArray", latched=True)
    assert ros.run_until(lambda: heard)
    assert [each.status for each in heard[0].message.status_list] == [2]
    ros.result(uuid(1))
    assert ros.run_until(lambda: [each.status for each in heard[-1].message.status_list] == [SUCCEEDED])


def test_a_goal_that_is_sent_again_is_decided_once(ros: RosTwin) -> None:
    first = ros.send_goal(uuid(1), reach(ros))
    again = ros.send_goal(uuid(1), reach(ros, "ready"))
    assert again.accepted
    assert (again.stamp.sec, again.stamp.nanosec) == (first.stamp.sec, first.stamp.nanosec)
    assert ros.result(uuid(1)).status == SUCCEEDED
    assert off(ros, dict(zip(ros.twin.arm.joint_names, ros.twin.arm.named_states["left"], strict=True))) <= 0.5


def test_a_cancel_lets_the_arm_decelerate_and_the_result_says_so(ros: RosTwin) -> None:
    assert ros.send_goal(uuid(1), reach(ros)).accepted
    asked = ros.ask_result(uuid(1))
    ros.clock.sleep(1.0)
    cancelled = ros.cancel(uuid(1))
    assert (cancelled.return_code, len(cancelled.goals_canceling)) == (0, 1)
    result = ros.answer(asked)
    assert (result.status, result.result.error_code) == (CANCELED, -10)
    assert ros.cancel(uuid(1)).return_code == 3
    assert ros.cancel(uuid(9)).return_code == 2
    everything = ros.cancel()
    assert (everything.return_code, len(everything.goals_canceling)) == (0, 0)


def test_without_a_name_all_goals_are_cancelled(ros: RosTwin) -> None:
    assert ros.send_goal(uuid(1), reach(ros)).accepted
    assert len(ros.cancel().goals_canceling) == 1
    assert ros.result(uuid(1)).status == CANCELED


def test_a_refusal_is_a_sentence_in_rosout_and_in_diagnostics(ros: RosTwin) -> None:
    log = ros.client.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    diagnostics = ros.client.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    goal = reach(ros)
    point = TrajectoryPoint(positions=(99.0, *goal.trajectory.points[0].positions[1:]), time_from_start=4.0)
    beyond = FollowJointTrajectoryGoal(
        trajectory=JointTrajectory(joint_names=goal.trajectory.joint_names, points=(point,))
    )
    assert not ros.send_goal(uuid(1), beyond).accepted
    assert ros.run_until(lambda: any("a goal of ROS was refused" in each.message.msg for each in log))
    assert ros.run_until(lambda: any("99" in each.message.status[2].message for each in diagnostics))
    unknown = ros.result(uuid(1))
    assert unknown.status == 0


def test_a_path_through_what_stands_there_is_refused_before_anything_moves(ros: RosTwin) -> None:
    before = at(ros)
    there = dict(zip(ros.twin.arm.joint_names, ros.twin.arm.named_states["left"], strict=True))
    ros.arm.scene.add_box("wall", (0.05, 0.05, 0.05), at=ros.arm.fk(there).position)
    log = ros.client.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    assert not ros.send_goal(uuid(1), reach(ros)).accepted
    assert ros.run_until(lambda: any("wall" in each.message.msg for each in log))
    assert at(ros) == before


def test_a_new_goal_replaces_the_one_under_way_which_is_aborted_with_a_sentence(ros: RosTwin) -> None:
    assert ros.send_goal(uuid(1), reach(ros)).accepted
    asked = ros.ask_result(uuid(1))
    ros.clock.sleep(0.5)
    assert ros.send_goal(uuid(2), reach(ros, "home")).accepted
    result = ros.answer(asked)
    assert (result.status, result.result.error_code) == (ABORTED, -11)
    assert result.result.error_string
    assert ros.result(uuid(2)).status == SUCCEEDED


def test_a_goal_that_names_some_joints_leaves_the_others_where_they_are(ros: RosTwin) -> None:
    before, name = at(ros), ros.twin.arm.joint_names[0]
    point = TrajectoryPoint(positions=(0.3,), time_from_start=3.0)
    assert ros.send_goal(uuid(1), FollowJointTrajectoryGoal(
        trajectory=JointTrajectory(joint_names=(name,), points=(point,)))).accepted  # fmt: skip
    assert ros.result(uuid(1)).status == SUCCEEDED
    assert off(ros, before | {name: 0.3}) <= 0.5


def test_a_goal_has_control_and_gives_it_back_and_a_holder_is_named_in_the_refusal(ros: RosTwin) -> None:
    assert ros.send_goal(uuid(1), reach(ros)).accepted
    assert ros.arm.control.holder == "ROS 2"
    ros.result(uuid(1))
    assert ros.run_until(lambda: not ros.arm.control.held)
    log = ros.client.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    with ros.arm.take_control("ana"):
        assert not ros.send_goal(uuid(2), reach(ros, "home")).accepted
        assert ros.run_until(lambda: any("ana" in each.message.msg for each in log))
    assert ros.send_goal(uuid(3), reach(ros, "home")).accepted
    assert ros.result(uuid(3)).status == SUCCEEDED


def test_the_death_of_a_client_cancels_its_goal_and_drops_its_questions(ros: RosTwin) -> None:
    token, gid = client_token(ros.client)
    declared = ros.client.declare_client(token)
    own = ros.client.subscribe(f"{ACTION}/status", "action_msgs/msg/GoalStatusArray", latched=True)
    assert ros.send_goal(uuid(1), reach(ros), gid).accepted
    held = ros.ask_result(uuid(1), gid)
    other = ros.ask_result(uuid(1))
    ros.clock.sleep(1.0)
    declared.undeclare()
    assert ros.answer(other).status == CANCELED
    assert ros.run_until(lambda: held.is_over)
    assert held.replies == []
    assert [each.status for each in own[-1].message.status_list] == [CANCELED]


def test_without_motion_there_is_no_action(tmp_path: Path) -> None:
    with ros_twin(tmp_path, motion=False) as ros:
        assert not [each for each in ros.client.tokens() if "_action" in each]


def test_a_joint_of_several_degrees_of_freedom_is_refused(ros: RosTwin) -> None:
    goal = ros_goal(reach(ros))
    goal.component_goal_tolerance = [make(
        "control_msgs/msg/JointComponentTolerance", joint_name="a", component=1, position=0.0, velocity=0.0,
        acceleration=0.0,
    )]  # fmt: skip
    answer = ros.call(f"{ACTION}/send_goal", f"{FOLLOW}_SendGoal", goal_id=uuid_of(uuid(1)), goal=goal)
    assert not answer.accepted


def like_moveit(ros: RosTwin, name: str) -> FollowJointTrajectoryGoal:
    """Thirty points of six seconds, with velocities and accelerations."""
    names = ros.twin.arm.joint_names
    return quintic(names, tuple(at(ros)[each] for each in names), ros.twin.arm.named_states[name], 6.0, 30)


@pytest.mark.parametrize(("robot", "target"), [("rm1", "left"), ("parol6", "ready")])
def test_a_trajectory_as_moveit_sends_it_arrives_to_the_step_on_both_arms(
    tmp_path: Path, robot: str, target: str
) -> None:
    with ros_twin(tmp_path, robot) as ros:
        shafts = ros.watcher.latest(DEVICE_SHAFT)
        goal = like_moveit(ros, target)
        assert ros.send_goal(uuid(1), goal).accepted
        result = ros.result(uuid(1))
        assert (result.status, result.result.error_code) == (SUCCEEDED, 0), result.result.error_string
        assert off(ros, dict(zip(ros.twin.arm.joint_names, goal.trajectory.points[-1].positions, strict=True))) <= 0.5
        assert ros.send_goal(uuid(2), like_moveit(ros, "home")).accepted
        ros.clock.sleep(3.0)
        ros.cancel(uuid(2))
        assert ros.result(uuid(2)).status == CANCELED
        ros.clock.sleep(1.0)
        shaft = shafts.message
        assert shaft is not None
        assert shaft.steps == shaft.shaft


def test_the_death_of_the_bridge_ends_its_goal_and_the_arm_decelerates(ros: RosTwin) -> None:
    assert ros.send_goal(uuid(1), like_moveit(ros, "left")).accepted
    held = ros.ask_result(uuid(1))
    ros.clock.sleep(2.0)
    ros.operator.close()
    assert ros.run_until(lambda: held.is_over)
    assert held.replies == []
    ros.clock.sleep(2.0)
    stood = at(ros)
    ros.clock.sleep(1.0)
    assert at(ros) == stood
    assert off(ros, dict(zip(ros.twin.arm.joint_names, ros.twin.arm.named_states["left"], strict=True))) > 10
    assert ros.run_until(lambda: not ros.arm.control.held, 0.02)


def test_a_router_of_ros_that_goes_takes_the_goals_of_its_clients_with_it(ros: RosTwin) -> None:
    token, gid = client_token(ros.client)
    declared = ros.client.declare_client(token)
    assert ros.run_until(lambda: token in ros.client.tokens())
    assert ros.send_goal(uuid(1), like_moveit(ros, "left"), gid).accepted
    ros.clock.sleep(1.0)
    ros.cut_router()
    assert ros.run_until(lambda: not ros.arm.control.held)
    assert off(ros, dict(zip(ros.twin.arm.joint_names, ros.twin.arm.named_states["left"], strict=True))) > 10
    assert declared


def test_the_gripper_closes_with_feedback_and_its_own_result(ros: RosTwin) -> None:
    name = "/gripper/gripper_cmd/_action"
    feedback = ros.client.subscribe(f"{name}/feedback", f"{GRIPPER}_FeedbackMessage")
    command = make("control_msgs/msg/GripperCommand", position=0.01, max_effort=0.0)
    goal = make(f"{GRIPPER}_Goal", command=command)
    sent = ros.call(f"{name}/send_goal", f"{GRIPPER}_SendGoal", goal_id=uuid_of(uuid(1)), goal=goal)
    assert sent.accepted
    result = ros.call(f"{name}/get_result", f"{GRIPPER}_GetResult", goal_id=uuid_of(uuid(1)))
    assert (result.status, result.result.reached_goal) == (SUCCEEDED, True)
    assert result.result.position == pytest.approx(0.01, abs=1e-3)
    assert ros.run_until(lambda: feedback)
    assert bytes(feedback[0].message.goal_id.uuid) == uuid(1)


def test_a_trajectory_on_the_topic_moves_the_arm_and_a_refused_one_is_told(ros: RosTwin) -> None:
    name = "/arm_controller/joint_trajectory"
    ros.client.publish(name, ros_goal(reach(ros)).trajectory)
    wanted = dict(zip(ros.twin.arm.joint_names, ros.twin.arm.named_states["left"], strict=True))
    assert ros.run_until(lambda: off(ros, wanted) <= 0.5, 0.02)
    assert ros.run_until(lambda: not ros.arm.control.held, 0.02)
    log = ros.client.subscribe("/rosout", "rcl_interfaces/msg/Log", latched=True)
    ros.client.publish(name, ros_goal(FollowJointTrajectoryGoal()).trajectory)
    assert ros.run_until(lambda: any("a goal of ROS was refused" in each.message.msg for each in log))


def test_a_jog_moves_a_joint_as_long_as_it_is_sent_and_the_tool_along_an_axis(ros: RosTwin) -> None:
    joint = ros.twin.arm.joint_names[0]
    before, height = at(ros), ros.arm.pose().position[2]

    def jog(kind: str, name: str, **fields: Any) -> None:
        ros.client.publish(name, make(kind, header=header_of(0, "base_link"), **fields))

    def by_joint() -> bool:
        jog("control_msgs/msg/JointJog", "/gemelo/delta_joint_cmds", joint_names=[joint], displacements=np.array([]),
            velocities=np.array([0.2]), duration=0.1)  # fmt: skip
        return at(ros)[joint] > before[joint] + 0.05

    assert ros.run_until(by_joint)
    ros.clock.sleep(1.0)
    stood = at(ros)
    ros.clock.sleep(0.5)
    assert at(ros) == stood
    up = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.05)
    still = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)

    def by_tool() -> bool:
        twist = make("geometry_msgs/msg/Twist", linear=up, angular=still)
        jog("geometry_msgs/msg/TwistStamped", "/gemelo/delta_twist_cmds", twist=twist)
        return ros.arm.pose().position[2] > height + 0.005

    assert ros.run_until(by_tool)
