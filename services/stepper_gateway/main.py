"""The process: one arm, one device, one link."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from gemelo.libraries.arm.model.description import ArmDescription, load_arm, require_motors
from gemelo.libraries.runtime.application import service
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.priority import raise_priority
from gemelo.schemas.deployment import Deployment, DeviceKind, Wire
from gemelo.schemas.robot import Dialect
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import BeganInput
from gemelo.services.stepper_gateway.ledger.ledger_file import LedgerFile, read_ledger
from gemelo.services.stepper_gateway.links.link import Link
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.services.stepper_gateway.shell import Shell

RATE = 50.0  # [Hz] standard: that of the device's states
# Between the threads of bus, wire and loop: at Python's own 5 ms a stop waits for several of them in a flood.
SWITCH_INTERVAL = 0.0005  # [s] chosen
USUAL_BAUD = 921_600  # standard: the device's own, firmware/PROTOCOL.md
VIRTUAL_LINE = "virtual_esp32.tty"
NO_PRIORITY = (
    "without a real-time priority: beside much other work heartbeats may come late (`gemelo doctor` has the remedy)"
)


OpenDevice = Callable[[Deployment, ArmDescription, Callable[[], None]], Link]


def run(node: Node, deployment: Deployment, open_wire: OpenDevice | None = None) -> None:
    """Serve until the node is stopped; ready while the device is online, synchronised and its state fresh."""
    arm = load_arm(project_root() / deployment.robot)
    require_motors(arm, deployment.device)
    parameters = node.parameters(GatewayParameters)
    file = LedgerFile(project_root() / deployment.paths.run, arm.name, node.unwritten, node.clock)
    kept, trouble = read_ledger(file.path)
    if trouble:
        node.log.warning(trouble)
    began = BeganInput(node.clock.bits(31) or 1, parameters.value, kept, True, True, True)
    core = GatewayCore(arm, began.session, began.parameters, began.kept)
    shell = Shell(node, core, began, parameters, file)
    link = (open_wire or open_device)(deployment, arm, shell.wake)
    node.at_end(file.close)
    node.at_end(link.close)
    node.at_end(lambda: file.keep(core.ledger_record()))
    node.at_end(shell.finish)
    shell.use(link)
    node.spin(shell.step, rate=RATE)


def run_ahead(node: Node, deployment: Deployment) -> None:
    """As `run`, in a process of its own, which heartbeats and stops go through."""
    sys.setswitchinterval(SWITCH_INTERVAL)
    if not raise_priority():
        node.log.info(NO_PRIORITY)
    run(node, deployment)


def open_device(deployment: Deployment, arm: ArmDescription, wake: Callable[[], None]) -> Link:
    """The link to the arm's device, in the dialect that it speaks."""
    match arm.device.dialect:
        case Dialect.GEMELO:
            return open_link(deployment, arm.device.name, wake, baud_of(deployment, arm))
        case Dialect.RA:
            from gemelo.libraries.mqtt.access import gateway_access  # slow to load: only the wire's own library
            from gemelo.services.stepper_gateway.links.foreign.ra_link import RaLink

            return RaLink(gateway_access(deployment.mqtt), arm, wake)
        case Dialect.TEXT:
            from gemelo.services.stepper_gateway.links.foreign.text_link import TextLink

            return TextLink(serial_device(deployment), baud_of(deployment, arm), arm, wake)


def open_link(deployment: Deployment, device: str, wake: Callable[[], None], baud: int = USUAL_BAUD) -> Link:
    """The other wire's library is not even imported."""
    match deployment.wire:
        case Wire.MQTT:
            from gemelo.libraries.mqtt.access import gateway_access  # slow to load: only the wire's own library
            from gemelo.services.stepper_gateway.links.mqtt import MqttLink

            return MqttLink(gateway_access(deployment.mqtt), device, wake)
        case Wire.SERIAL:
            from gemelo.services.stepper_gateway.links.serial import SerialLink

            return SerialLink(serial_device(deployment), deployment.serial.baud or baud, wake)


def baud_of(deployment: Deployment, arm: ArmDescription) -> int:
    """Of the serial line: the deployment's, else robot.toml's."""
    return deployment.serial.baud or arm.device.serial_baud


def serial_device(deployment: Deployment) -> str:
    """The port that the board is at; a virtual one has a line of its own among the run's files."""
    if deployment.device is DeviceKind.VIRTUAL:
        return str(Path(deployment.paths.run) / VIRTUAL_LINE)
    return deployment.serial.device


def main() -> None:
    """Console script `gemelo-stepper-gateway`."""
    service("stepper_gateway", run_ahead)


if __name__ == "__main__":
    main()
