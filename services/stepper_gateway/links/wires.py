"""The wire that the deployment names."""

from __future__ import annotations

from collections.abc import Callable

from schemas.deployment import Deployment, Wire
from services.stepper_gateway.links.link import Link


def open_link(deployment: Deployment, device: str, wake: Callable[[], None]) -> Link:
    """The other wire's library is not even imported."""
    match deployment.wire:
        case Wire.MQTT:
            from services.stepper_gateway.links.mqtt import MqttLink

            return MqttLink(deployment.mqtt.host, deployment.mqtt.port, device, wake)
        case Wire.SERIAL:
            from services.stepper_gateway.links.serial import SerialLink

            return SerialLink(deployment.serial.device, deployment.serial.baud, wake)
