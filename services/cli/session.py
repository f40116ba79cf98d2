"""What a command needs to speak with the stack: the deployment, the arm, and a node of its own."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from services.cli.exits import CommandError, ExitCode, usage

if TYPE_CHECKING:
    from schemas.deployment import Deployment
    from services.arm.description import Arm
    from services.runtime.node import Node

CONNECT_TIMEOUT = 1.0  # [s]


@dataclass(frozen=True)
class Session:
    """One command's connection."""

    deployment: Deployment
    arm: Arm
    node: Node


def load() -> tuple[Deployment, Arm]:
    """Deployment and arm from their files; what is wrong with them is one sentence."""
    from services.arm.description import load_arm
    from services.runtime.deployment import load_deployment, project_root

    try:
        deployment = load_deployment()
        return deployment, load_arm(project_root() / deployment.robot)
    except (ValueError, OSError) as error:
        raise usage(str(error)) from error


def require_router(deployment: Deployment) -> None:
    """Raises at once, instead of waiting for a stack that is not there."""
    address = (deployment.router.host, deployment.router.port)
    try:
        socket.create_connection(address, timeout=CONNECT_TIMEOUT).close()
    except OSError:
        where = f"{address[0]}:{address[1]}"
        raise CommandError(f"no router at {where}: start the twin with `make up`", ExitCode.NO_STACK) from None


@contextmanager
def connect() -> Iterator[Session]:
    """A node of this command on the robot's bus; refusals and silence become exit codes."""
    deployment, arm = load()
    require_router(deployment)
    from services.runtime.errors import BusError, NoAnswer, Refused, ServerLost
    from services.runtime.node import Node

    try:
        with Node(f"cli-{os.getpid()}", deployment, robot=arm.name) as node:
            yield Session(deployment, arm, node)
    except (NoAnswer, BusError) as error:
        raise CommandError(str(error), ExitCode.NO_STACK) from error
    except (Refused, ServerLost) as error:
        raise CommandError(str(error)) from error
