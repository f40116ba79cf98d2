"""The checks that `make up` runs before it starts a process: the deployment file, the arm's files and free ports."""

from __future__ import annotations

import sys

from schemas.deployment import Deployment, ViewerMode
from schemas.errors import ConfigurationError
from services.arm.model.description import Arm, load_arm, require_motors
from services.arm.model.virtual_drive import NO_MOTORS
from services.runtime.deployment import load_deployment, project_root
from services.runtime.process.ports import PortTaken, require_free


def start_problems(deployment: Deployment) -> list[str]:
    """Every reason why this deployment cannot start on this machine, one sentence each; empty if it can."""
    found = []
    try:
        require_motors(load_arm(project_root() / deployment.robot), deployment.device)
    except ConfigurationError as error:
        found.append(str(error))
    router, mqtt, viewer, panel = deployment.router, deployment.mqtt, deployment.viewer, deployment.panel
    ports = [(router.host, router.port, "router", "port"), (mqtt.host, mqtt.port, "mqtt", "port")]
    ports.append((panel.host, panel.port, "panel", "port"))
    if viewer.mode is not ViewerMode.NONE:
        ports += [(viewer.host, viewer.port, "viewer", "port"), (viewer.host, viewer.web_port, "viewer", "web_port")]
    for host, port, section, key in ports:
        try:
            require_free(host, port, section, key)
        except PortTaken as error:
            found.append(str(error))
    return found


def main() -> int:
    """`python -m services.stack.start_check`: prints every problem to stderr; 0 if there is none, else 1."""
    try:
        deployment = load_deployment()
        found = start_problems(deployment)
    except ConfigurationError as error:
        found = [str(error)]
    for problem in found:
        print(f"gemelo: {problem}", file=sys.stderr)
    if not found:
        _say_virtual(load_arm(project_root() / deployment.robot))
    return 1 if found else 0


def _say_virtual(arm: Arm) -> None:
    """What a person is to know of an arm without motors, as the stack starts."""
    if not arm.has_motors:
        print(f"{arm.name}: {NO_MOTORS}; a virtual device is generated, at {arm.device.tick_hz / 1000:g} kHz")


if __name__ == "__main__":
    sys.exit(main())
