"""What `make up` looks at before it starts anything, so that a mistake is said once: deployment, arm, ports."""

from __future__ import annotations

import sys

from schemas.deployment import Deployment, ViewerMode
from schemas.errors import ConfigurationError
from services.arm.description import load_arm
from services.runtime.deployment import load_deployment, project_root
from services.runtime.ports import PortTaken, require_free


def troubles(deployment: Deployment) -> list[str]:
    """Every reason why this deployment cannot start here, a sentence each."""
    found = []
    try:
        load_arm(project_root() / deployment.robot)
    except ConfigurationError as error:
        found.append(str(error))
    router, mqtt, viewer = deployment.router, deployment.mqtt, deployment.viewer
    ports = [(router.host, router.port, "router", "port"), (mqtt.host, mqtt.port, "mqtt", "port")]
    if viewer.mode is not ViewerMode.NONE:
        ports += [(viewer.host, viewer.port, "viewer", "port"), (viewer.host, viewer.web_port, "viewer", "web_port")]
    for host, port, section, key in ports:
        try:
            require_free(host, port, section, key)
        except PortTaken as error:
            found.append(str(error))
    return found


def main() -> int:
    """`python -m services.cli.preflight`: 0 where nothing stands in the way."""
    try:
        found = troubles(load_deployment())
    except ConfigurationError as error:
        found = [str(error)]
    for trouble in found:
        print(f"gemelo: {trouble}", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
