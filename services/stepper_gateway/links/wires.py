"""The wire that the deployment names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from schemas.deployment import Deployment, DeviceKind, Wire
from services.stepper_gateway.links.link import Link

VIRTUAL_LINE = "virtual_esp32.tty"


def open_link(deployment: Deployment, device: str, wake: Callable[[], None]) -> Link:
    """The other wire's library is not even imported."""
    match deployment.wire:
        case Wire.MQTT:
            from services.stepper_gateway.links.mqtt import MqttLink

            return MqttLink(deployment.mqtt.host, deployment.mqtt.port, device, wake)
        case Wire.SERIAL:
            from services.stepper_gateway.links.serial import SerialLink

            return SerialLink(serial_device(deployment), deployment.serial.baud, wake)


def serial_device(deployment: Deployment) -> str:
    """The port that the board is at; a virtual one has a line of its own among the run's files."""
    if deployment.device is DeviceKind.VIRTUAL:
        return str(Path(deployment.paths.run) / VIRTUAL_LINE)
    return deployment.serial.device
