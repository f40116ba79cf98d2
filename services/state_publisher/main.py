"""The process: description and static frames once, latched; moving frames on every joint state."""

from __future__ import annotations

from typing import Annotated

import msgspec

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.bus.wire import TooLarge
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.joints import JointState
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.text_file import read_text
from gemelo.schemas.topics import DESCRIPTION, FRAMES, JOINT_STATES, STATIC_FRAMES
from gemelo.services.state_publisher.core import StatePublisher

FRESH = 0.5  # [s] a joint state counts as fresh: as long as the device waits for a heartbeat


class StatePublisherParameters(msgspec.Struct, frozen=True, kw_only=True):
    """The parameters that can be set at run time."""

    rate: Annotated[float, msgspec.Meta(ge=0.0, description="frames a second [Hz]; 0: one for every joint state")] = 0.0


def describe(arm: ArmDescription) -> RobotDescription:
    """The robot's own files."""
    return RobotDescription(
        robot=arm.name,
        urdf=read_text(arm.urdf_path),
        srdf=read_text(arm.srdf_path),
        robot_toml=read_text(arm.robot_path),
    )


def run(node: Node, deployment: Deployment) -> None:
    """Publish until the node is stopped; ready while fresh joint states give frames."""
    arm = load_arm(project_root() / deployment.robot)
    publisher = StatePublisher(arm)
    parameters = node.parameters(StatePublisherParameters)
    states = node.latest(JOINT_STATES)
    frames = node.publisher(FRAMES)
    try:
        node.publisher(DESCRIPTION).put(describe(arm))
    except TooLarge as error:
        raise ConfigurationError(because("message.robot", error.reason, folder=str(arm.folder))) from error
    node.publisher(STATIC_FRAMES).put(publisher.static_frames(node.now()))

    def on_joint_state(state: JointState) -> None:
        found = publisher.on_joint_state(state)
        for warning in found.warnings:
            node.log.warning(warning)
        if found.frames is not None:
            frames.put(found.frames)

    def step(_now: int) -> None:
        publisher.decimator.rate = parameters.value.rate
        is_fresh = states.age() < FRESH
        node.set_ready(is_fresh, "" if is_fresh else because("ready.no_states", remedy("see_gateway")))

    node.subscribe(JOINT_STATES, on_joint_state)
    node.spin(step, rate=10.0)


def main() -> None:
    """Console script `gemelo-state-publisher`."""
    service("state_publisher", run)


if __name__ == "__main__":
    main()
