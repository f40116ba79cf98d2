"""Topics of ROS 2 that move the arm: a trajectory without an action, and jogging by joints or by the tool's velocity.

A jog ends 0.1 s after its last message, by the planner's own dead-man.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from gemelo.libraries.ros2.types import BadRosMessage, decode, ros_type
from gemelo.libraries.runtime.clock import token
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.ros_wire.names import RosType
from gemelo.schemas.planning import JogCommand
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.topics import JOG
from gemelo.services.ros_bridge import core
from gemelo.services.ros_bridge.actions import AnyHandle, OnRefusal, RosAction

TRAJECTORY, JOINT_JOG = "trajectory_msgs/msg/JointTrajectory", "control_msgs/msg/JointJog"
TWIST = "geometry_msgs/msg/TwistStamped"


class Hearing(Protocol):
    """A node of ROS 2, as far as topics that come in need it."""

    def subscribe(self, name: str, kind: RosType, on_message: Callable[[bytes], None]) -> None: ...


def subscribe_inputs(
    node: Node, ros: Hearing, controller: str, action: RosAction, prefix: str, on_refusal: OnRefusal
) -> None:
    """`prefix` stands before the frames of ROS; what is refused goes to `on_refusal`."""
    jog = node.publisher(JOG)

    def follow(message: Any) -> None:
        goal = core.goal_of_trajectory(message)
        action.begin(bytes.fromhex(token(node.clock)), goal, begun)

    def begun(decision: AnyHandle | Reason) -> None:
        on_refusal(decision if isinstance(decision, Reason) else None)
        if not isinstance(decision, Reason):
            decision.on_end = action.ended
            if decision.is_over:
                action.ended()

    def move(command: JogCommand | None) -> None:
        if command is not None:
            jog.put(command)

    topics: dict[str, tuple[str, Callable[[Any], None]]] = {
        f"{controller}/joint_trajectory": (TRAJECTORY, follow),
        "~/delta_joint_cmds": (JOINT_JOG, lambda each: move(core.joint_jog(each, node.now()))),
        "~/delta_twist_cmds": (TWIST, lambda each: move(core.twist_jog(each, node.now(), prefix))),
    }
    for name, (kind, handle) in topics.items():
        ros.subscribe(name, ros_type(kind), _decoded(kind, handle, on_refusal))


def _decoded(kind: str, handle: Callable[[Any], None], on_refusal: OnRefusal) -> Callable[[bytes], None]:
    def on_message(payload: bytes) -> None:
        try:
            message = decode(kind, payload)
        except BadRosMessage as error:
            on_refusal(because("ros.message.unreadable", type=kind, error=str(error)))
            return
        try:
            handle(message)
        except ValueError as error:
            on_refusal(because("ros.goal.not_finite", error=str(error)))

    return on_message
