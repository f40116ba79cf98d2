"""Stacks that several figures share: one for each broker, started when first needed."""

from __future__ import annotations

import shutil
from contextlib import ExitStack
from dataclasses import dataclass

from schemas.deployment import Deployment
from services.arm.description import Arm, load_arm
from services.bench.figure import NotMeasured
from services.runtime.deployment import load_deployment, project_root
from services.runtime.node import Node
from services.stack.stack import Stack


@dataclass(frozen=True)
class Running:
    """A stack that is ready, and a node of ours on its bus."""

    stack: Stack
    deployment: Deployment
    arm: Arm
    node: Node


class Stacks:
    """Starts stacks on demand and stops all of them at the end."""

    def __init__(self) -> None:
        self._open = ExitStack()
        self._running: dict[str, Running] = {}

    def __enter__(self) -> Stacks:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def stop(self) -> None:
        """Everything that runs; the next figure starts afresh."""
        self._running.clear()
        self._open.close()

    def with_broker(self, broker: str) -> Running:
        """The stack with this MQTT broker; another that runs is stopped, because two would disturb each other."""
        if broker == "mosquitto" and not has_mosquitto():
            raise NotMeasured("mosquitto is not installed: apt-get install mosquitto")
        if broker not in self._running:
            self.stop()
            self._running[broker] = self._start(broker)
        return self._running[broker]

    def any_broker(self) -> Running:
        """Whatever runs, else a new one."""
        for running in self._running.values():
            return running
        return self.with_broker("mosquitto" if has_mosquitto() else "amqtt")

    def _start(self, broker: str) -> Running:
        stack = self._open.enter_context(Stack(broker=broker, viewer="none"))
        deployment = load_deployment(None, stack.environment)
        arm = load_arm(project_root() / deployment.robot)
        node = self._open.enter_context(Node("bench", deployment, robot=arm.name))
        return Running(stack, deployment, arm, node)


def has_mosquitto() -> bool:
    """Debian puts it where an ordinary user's PATH does not reach."""
    return any(shutil.which("mosquitto", path=path) for path in (None, "/usr/sbin", "/usr/local/sbin"))
