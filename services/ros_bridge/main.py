"""`gemelo-ros-bridge`: the arm as a node of ROS 2 on the router of ROS (rmw_zenohd), without ROS; started by hand."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.ros_wire.names import NodeName
from gemelo.libraries.runtime.ros_wire.ros_node import RosNode
from gemelo.schemas.deployment import Deployment, RosSection
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.schemas.topics import ROS_BRIDGE, ROS_OPERATOR
from gemelo.services.ros_bridge.cameras import CameraTopics
from gemelo.services.ros_bridge.motion import serve_motion
from gemelo.services.ros_bridge.parameters import RosParameters, Value
from gemelo.services.ros_bridge.topics import Topics
from gemelo.services.ros_bridge.triggers import serve_triggers

RATE = 1.0  # [Hz] of diagnostics


def run(node: Node, deployment: Deployment) -> None:
    """Be a node of ROS 2 until the node is stopped; ready while the router of ROS is connected."""
    section = deployment.ros
    require_usable(section, deployment)
    arm = load_arm(project_root() / deployment.robot)
    name = NodeName(section.node, section.namespace.strip("/"), section.domain)
    ros = RosNode(section.router, name, node.post, node.clock)
    node.at_end(ros.close)
    topics = Topics(node, ros, section, arm)
    node.at_end(topics.close)
    serve_triggers(node, ros, section.motion)
    if deployment.cell:
        for camera in load_cell(Path(deployment.cell), arm).cameras:
            CameraTopics(node, ros, camera.name, topics.prefix, topics.add_static)
    if section.motion:
        decided = partial(on_decision, node, topics)
        serve_motion(node, ros, section, lambda: topics.joints, arm.gripper is not None, decided)
    RosParameters(node, ros, own_parameters(section, arm.name, arm.joint_names))
    node.log.info("on the ROS 2 router %s as /%s", section.router, "/".join(filter(None, (name.namespace, name.name))))

    def step(_now: int) -> None:
        topics.publish_diagnostics()
        why = because("ros.router.gone", remedy("ros_router_start"), router=section.router)
        node.set_ready(ros.is_connected, "" if ros.is_connected else why)

    node.spin(step, rate=RATE)


def on_decision(node: Node, topics: Topics, refusal: Reason | None) -> None:
    """Has a refusal shown in /rosout and /diagnostics: the answer to a goal has no room for a sentence."""
    topics.refusal = refusal
    if refusal is not None:
        node.log.warning("%s", because("ros.goal.refused", refusal))


def require_usable(section: RosSection, deployment: Deployment) -> None:
    """Raises `ConfigurationError` without a router of ROS, and where that would be our own."""
    elsewhere = remedy("ros_router", port=deployment.router.port)
    if not section.router:
        raise ConfigurationError(because("ros.router.none", elsewhere))
    if section.router == f"tcp/{deployment.router.host}:{deployment.router.port}":
        raise ConfigurationError(because("ros.router.own", elsewhere, router=section.router))


def own_parameters(section: RosSection, robot: str, joints: tuple[str, ...]) -> dict[str, Value]:
    """Those of the node itself."""
    return {
        "use_sim_time": False,
        "robot": robot,
        "joints": joints,
        "controller": section.controller,
        "motion": section.motion,
        "rate": section.rate,
    }


def node_name(deployment: Deployment) -> str:
    """With motion it is another node, whose role may move the arm."""
    return ROS_OPERATOR if deployment.ros.motion else ROS_BRIDGE


def main() -> None:
    """Console script `gemelo-ros-bridge`."""
    service(ROS_BRIDGE, run, node_name=node_name)


if __name__ == "__main__":
    main()
