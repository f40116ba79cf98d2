"""The checks that `make up` runs before it starts a process: the deployment file, the arm's files and free ports."""

from __future__ import annotations

import sys

from schemas.deployment import Deployment, ViewerMode
from schemas.errors import ConfigurationError
from services.arm.model.description import load_arm
from services.runtime.deployment import load_deployment, project_root
from services.runtime.process.ports import PortTaken, require_free


def start_problems(deployment: Deployment) -> list[str]:
    """Every reason why this deployment cannot start on this machine, one sentence each; empty if it can."""
    found = []
    try:
        load_arm(project_root() / deployment.robot)
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
        found = start_problems(load_deployment())
    except ConfigurationError as error:
        found = [str(error)]
    for problem in found:
        print(f"gemelo: {problem}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
