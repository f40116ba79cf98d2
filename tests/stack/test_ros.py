"""The bridge to ROS 2 beside a whole stack: a trajectory to the step, and the bridge killed in the middle of one."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import gemelo
from gemelo.libraries.ros2.types import FOLLOW
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.services.ros_bridge.core import uuid_of
from gemelo.tools.stack.stack import Stack
from tests.ros_bridge.ros_client import Asked, RosClient, ros_router
from tests.ros_bridge.ros_goals import quintic, ros_goal
from tests.runtime.support import until
from tests.stack.test_unwatched import BRAKED, is_moving, rests

ACTION = "/arm_controller/follow_joint_trajectory/_action"
SUCCEEDED, CANCELED = 4, 5
SECONDS, FAR = 6.0, 0.1  # [s] of a trajectory; [rad] of the first joint on its way


@contextmanager
def bridge(stack: Stack, locator: str, client: RosClient) -> Iterator[subprocess.Popen[str]]:
    """With motion; ready."""
    environment = {**stack.environment, "GEMELO_ROS_ROUTER": locator, "GEMELO_ROS_MOTION": "true"}
    command = [sys.executable, "-m", "gemelo.services.ros_bridge.main"]
    process = subprocess.Popen(command, cwd=stack.root, env=environment, stderr=subprocess.PIPE, text=True)
    try:
        assert until(lambda: any("set_parameters_atomically" in each for each in client.tokens()))
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60.0)


def goal(arm: gemelo.Arm, name: str) -> FollowJointTrajectoryGoal:
    """Thirty points with velocities and accelerations."""
    start = tuple(arm.joints[each] for each in arm.joint_names)
    target = tuple(arm.states[name][each] for each in arm.joint_names)
    return quintic(arm.joint_names, start, target, SECONDS, 30)


def begun(client: RosClient, number: int, wanted: FollowJointTrajectoryGoal) -> Asked:
    """The question for the result of a goal that was accepted."""
    uuid = uuid_of(bytes([number] * 16))
    sent = client.call(f"{ACTION}/send_goal", f"{FOLLOW}_SendGoal", goal_id=uuid, goal=ros_goal(wanted))
    assert sent.accepted
    return client.begin(f"{ACTION}/get_result", f"{FOLLOW}_GetResult", goal_id=uuid)


def test_a_trajectory_of_ros_arrives_to_the_step_and_a_killed_bridge_lets_the_arm_decelerate(
    twin: Stack, arm: gemelo.Arm
) -> None:
    with ros_router() as locator, RosClient(locator) as client:
        with bridge(twin, locator, client) as process:
            wanted = goal(arm, "left")
            asked = begun(client, 1, wanted)
            assert until(lambda: asked.is_over)
            result = asked.response()
            assert (result.status, result.result.error_string) == (SUCCEEDED, "")
            last = dict(zip(wanted.trajectory.joint_names, wanted.trajectory.points[-1].positions, strict=True))
            steps = {joint.name: joint.steps.per_unit for joint in arm.description.joints}
            assert until(lambda: not is_moving(arm))
            assert max(abs(arm.joints[name] - value) * steps[name] for name, value in last.items()) < 0.51
            held = begun(client, 2, goal(arm, "home"))
            first = wanted.trajectory.joint_names[0]
            assert until(lambda: abs(arm.joints[first] - last[first]) > FAR)
            process.kill()
            assert until(lambda: held.is_over)
            assert held.replies == []
            assert rests(arm, BRAKED)
            home = arm.states["home"]
            assert max(abs(arm.joints[name] - value) * steps[name] for name, value in home.items()) > 10.0
        assert until(lambda: not client.tokens())
        assert until(lambda: not arm.control.held)
