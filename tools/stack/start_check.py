"""The checks that `make up` runs before it starts a process: deployment, arm and cell files, broker, free ports."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.model.description import ArmDescription, load_arm, require_motors
from gemelo.libraries.arm.model.virtual_drive import NO_MOTORS
from gemelo.libraries.mqtt.access import device_access, gateway_access
from gemelo.libraries.mqtt.secure_folder import require_made
from gemelo.libraries.runtime.deployment import exposure, forget_arms, load_deployment, project_root
from gemelo.libraries.runtime.process.ports import PortTaken, require_free
from gemelo.libraries.runtime.started import keep_started
from gemelo.schemas.deployment import Broker, Deployment, DeviceKind, ViewerMode, Wire
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.plain_text import of_environment
from gemelo.schemas.reasons import Reason, because, say


def start_problems(deployment: Deployment) -> list[Reason]:
    """Every reason why this deployment cannot start on this machine; empty if it can."""
    found: list[Reason] = []
    device = ""
    try:
        arm = load_arm(project_root() / deployment.robot)
        device = arm.device.name if deployment.device is DeviceKind.VIRTUAL else ""
        require_motors(arm, deployment.device)
        if deployment.cell:
            load_cell(Path(deployment.cell), arm)
    except ConfigurationError as error:
        found.append(error.reason)
    found += broker_problems(deployment, device)
    router, mqtt, viewer, panel = deployment.router, deployment.mqtt, deployment.viewer, deployment.panel
    found += exposed(deployment)
    router_port = (*router.listening, "router", "listen_port" if router.listen_port else "port")
    ports = [router_port, (panel.host, panel.port, "panel", "port")]
    if mqtt.broker is not Broker.EXTERNAL:
        ports.append((*mqtt.listening, "mqtt", "listen_port" if mqtt.listen_port else "port"))
    if viewer.mode is not ViewerMode.NONE:
        ports += [(viewer.host, viewer.port, "viewer", "port"), (viewer.host, viewer.web_port, "viewer", "web_port")]
    for host, port, section, key in ports:
        try:
            require_free(host, port, section, key)
        except PortTaken as error:
            found.append(error.reason)
    return found


def exposed(deployment: Deployment) -> list[Reason]:
    """What would listen beyond this machine without TLS, where the deployment does not say `insecure`."""
    router, mqtt, viewer, panel = deployment.router, deployment.mqtt, deployment.viewer, deployment.panel
    listening = [
        ("router", router.listening[0], bool(router.configuration), router.insecure),
        ("mqtt", mqtt.listening[0], bool(mqtt.secure_folder) or mqtt.broker is Broker.EXTERNAL, mqtt.insecure),
        ("panel", panel.host, False, panel.insecure),
        ("viewer", viewer.host, viewer.mode is ViewerMode.NONE, viewer.insecure),
    ]
    found = []
    for section, host, is_locked, is_insecure in listening:
        try:
            exposure(section, host, is_locked, is_insecure)
        except ConfigurationError as error:
            found.append(error.reason)
    return found


def broker_problems(deployment: Deployment, device: str) -> list[Reason]:
    """Why gateway or virtual device could not join the broker; one that runs already is asked itself.

    `device` is the virtual device's name; empty where there is none.
    """
    section = deployment.mqtt
    try:
        accesses = [gateway_access(section), *([device_access(section, device)] if device else [])]
        if section.broker is not Broker.EXTERNAL and section.secure_folder:
            require_made(Path(section.secure_folder))
    except ConfigurationError as error:
        return [error.reason]
    if section.broker is not Broker.EXTERNAL or deployment.wire is Wire.SERIAL:
        return []
    from gemelo.libraries.mqtt.check import problem  # paho takes 50 ms that only a strange broker is worth

    return without_doubles(found for found in map(problem, accesses) if found is not None)


def without_doubles(reasons: Iterable[Reason]) -> list[Reason]:
    """Each once: by its sentence, as a reason holds a dictionary."""
    return list({str(reason): reason for reason in reasons}.values())


def main() -> int:
    """`python -m gemelo.tools.stack.start_check`: prints every problem to stderr; 0 if there is none, else 1."""
    language = of_environment(os.environ)
    try:
        deployment = load_deployment()
        found = start_problems(deployment)
    except ConfigurationError as error:
        found = [error.reason]
    for problem in found:
        print(f"gemelo: {say(problem, language)}", file=sys.stderr)
    if not found:
        forget_arms(deployment)
        keep_started(os.environ)
        say_virtual(load_arm(project_root() / deployment.robot), sys.stdout, language)
    return 1 if found else 0


def say_virtual(arm: ArmDescription, to: TextIO, language: str) -> None:
    """What a person is to know of an arm without motors, as the stack starts."""
    if not arm.has_motors:
        virtual = because("start.no_motors", NO_MOTORS, arm=arm.name, tick=arm.device.tick_hz / 1000)
        print(say(virtual, language), file=to)


if __name__ == "__main__":
    sys.exit(main())
