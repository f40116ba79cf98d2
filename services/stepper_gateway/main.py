"""The process: one arm, one device, one link."""

from __future__ import annotations

import secrets
from contextlib import closing

from schemas.deployment import Deployment
from services.arm.description import load_arm
from services.runtime.application import service
from services.runtime.deployment import project_root
from services.runtime.node import Node
from services.stepper_gateway.core import GatewayCore
from services.stepper_gateway.links.wires import open_link
from services.stepper_gateway.parameters import GatewayParameters
from services.stepper_gateway.shell import Shell

RATE = 50.0  # [Hz]


def run(node: Node, deployment: Deployment) -> None:
    """Serve until the node is stopped; ready while the device is online, synchronised and its state fresh."""
    arm = load_arm(project_root() / deployment.robot)
    parameters = node.parameters(GatewayParameters)
    core = GatewayCore(arm, secrets.randbelow(2**31 - 1) + 1, parameters.value)
    shell = Shell(node, core, parameters)
    with closing(open_link(deployment, arm.device.name, shell.wake)) as link:
        shell.use(link)
        node.spin(shell.step, rate=RATE)


def main() -> None:
    """Console script `gemelo-stepper-gateway`."""
    service("stepper_gateway", run)


if __name__ == "__main__":
    main()
