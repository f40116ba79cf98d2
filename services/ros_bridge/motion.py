"""Actions that move the arm for ROS 2, FollowJointTrajectory and GripperCommand: only with `[ros] motion = true`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from gemelo.libraries.ros2.types import FOLLOW, GRIPPER, ControlMsgs, encode, ros_type
from gemelo.libraries.runtime.actions.client import ActionClient
from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.node_clock import NodeClock
from gemelo.libraries.runtime.ros_wire.ros_node import RosNode
from gemelo.schemas.deployment import RosSection
from gemelo.schemas.gripper import GripperCommandFeedback, GripperCommandGoal, GripperCommandResult
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import (
    FollowJointTrajectoryFeedback,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
)
from gemelo.schemas.reasons import Reason
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, GATEWAY, GRIPPER_COMMAND
from gemelo.services.ros_bridge import core
from gemelo.services.ros_bridge.actions import AnyHandle, Decided, OnRefusal, RosActionServer
from gemelo.services.ros_bridge.control import ControlForGoals
from gemelo.services.ros_bridge.inputs import subscribe_inputs
from gemelo.services.ros_bridge.scene_check import SceneCheck

GRIPPER_ACTION = "gripper/gripper_cmd"
TO_DECIDE = 2.0  # [s] that the gateway has for a goal

Joints = Callable[[], JointState | None]


def serve_motion(
    node: Node, ros: RosNode, section: RosSection, joints: Joints, has_gripper: bool,
    on_refusal: OnRefusal,
) -> None:  # fmt: skip
    """Serves the actions; `joints()` is the newest joint state."""
    control = ControlForGoals(node)
    follow = FollowAction(node, ros, section.controller, control, joints)
    servers = [RosActionServer(node, ros, follow, on_refusal)]
    prefix = f"{section.namespace}/" if section.namespace else ""
    subscribe_inputs(node, ros, section.controller, follow, prefix, on_refusal)
    if has_gripper:
        servers.append(RosActionServer(node, ros, GripperAction(node, ros, control), on_refusal))

    def on_client(gid: bytes, is_there: bool) -> None:
        for server in servers:
            server.on_client(gid, is_there)

    ros.watch_clients(on_client)


class FollowAction:
    """control_msgs/FollowJointTrajectory: checked against our scene, then against all that the gateway checks."""

    kind = FOLLOW

    def __init__(
        self,
        node: Node,
        ros: RosNode,
        controller: str,
        control: ControlForGoals,
        joints: Joints,
    ) -> None:
        self.name = f"{controller}/follow_joint_trajectory"
        self._control, self._joints = control, joints
        self._clock, self._scene = NodeClock(node, GATEWAY), SceneCheck(node)
        self._client = node.action(FOLLOW_JOINT_TRAJECTORY)
        self._feedback = {
            generation: ros.publisher(
                f"{self.name}/_action/feedback", ros_type(f"{FOLLOW}_FeedbackMessage", generation)
            )
            for generation in ControlMsgs
        }

    def begin(self, uuid: bytes, goal: Any, decided: Decided) -> None:
        """Completed, checked, with control, and sent: whatever does not work is the reason of the refusal."""
        try:
            ours = core.completed(core.follow_goal(goal, self._to_gateway), self._joints())
        except core.GoalNotTaken as error:
            decided(error.reason)
            return

        def checked(found: FollowJointTrajectoryGoal | Reason) -> None:
            if isinstance(found, Reason):
                decided(found)
            else:
                self._control.acquire(partial(self._send, uuid, found, decided))

        self._scene.check(ours, checked)

    def _send(self, uuid: bytes, goal: FollowJointTrajectoryGoal, decided: Decided, why: Reason | None) -> None:
        on_feedback = partial(self._on_feedback, uuid)
        decided(why or sent(self._client, goal, uuid, on_feedback, self._control))

    def _on_feedback(self, uuid: bytes, feedback: FollowJointTrajectoryFeedback) -> None:
        for generation, publication in self._feedback.items():
            message = core.follow_feedback(uuid, feedback, generation)
            publication.put(encode(message, generation), feedback.stamp)

    def _to_gateway(self, stamp: int) -> int | None:
        offset = self._clock.offset()
        if offset is None:
            return None
        return stamp if offset.may_agree else stamp + round(offset.offset * 1e9)

    def result(self, handle: AnyHandle) -> Any:
        if handle.outcome is None:
            return core.lost_result(str(handle.lost))
        result: FollowJointTrajectoryResult = handle.outcome.result
        return core.follow_result(result)

    def no_result(self) -> Any:
        return core.no_result()

    def ended(self) -> None:
        self._control.release()


class GripperAction:
    """control_msgs/GripperCommand."""

    kind = GRIPPER
    name = GRIPPER_ACTION

    def __init__(self, node: Node, ros: RosNode, control: ControlForGoals) -> None:
        self._control = control
        self._client = node.action(GRIPPER_COMMAND)
        self._feedback = ros.publisher(f"{self.name}/_action/feedback", ros_type(f"{GRIPPER}_FeedbackMessage"))

    def begin(self, uuid: bytes, goal: Any, decided: Decided) -> None:
        """With control, and sent."""
        try:
            ours = core.gripper_goal(goal)
        except core.GoalNotTaken as error:
            decided(error.reason)
        else:
            self._control.acquire(partial(self._send, uuid, ours, decided))

    def _send(self, uuid: bytes, goal: GripperCommandGoal, decided: Decided, why: Reason | None) -> None:
        on_feedback = partial(self._on_feedback, uuid)
        decided(why or sent(self._client, goal, uuid, on_feedback, self._control))

    def _on_feedback(self, uuid: bytes, feedback: GripperCommandFeedback) -> None:
        self._feedback.put(encode(core.gripper_feedback(uuid, feedback)), feedback.stamp)

    def result(self, handle: AnyHandle) -> Any:
        result: GripperCommandResult | None = handle.outcome.result if handle.outcome is not None else None
        return core.gripper_result(result)

    def no_result(self) -> Any:
        return core.gripper_result(None)

    def ended(self) -> None:
        self._control.release()


def sent(
    client: ActionClient[Any, Any, Any], goal: Any, uuid: bytes, on_feedback: Callable[[Any], None],
    control: ControlForGoals,
) -> AnyHandle | Reason:  # fmt: skip
    """The goal under way, or why it is refused; control is given back then.

    Blocks for the gateway's decision, some milliseconds; where there is no gateway, there is nothing else to do.
    """
    try:
        return client.send(goal, on_feedback, TO_DECIDE, attached=True, goal_id=uuid.hex())
    except (RequestRefused, NoAnswer) as error:
        control.release()
        return error.reason
