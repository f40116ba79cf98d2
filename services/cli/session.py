"""The connection of one command: the deployment and the arm from their files, and a node on the robot's bus."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

from services.cli.errors import CommandError, ExitCode, usage

if TYPE_CHECKING:
    from schemas.deployment import Deployment
    from services.arm.model.description import Arm
    from services.runtime.node import Node

CONNECT_TIMEOUT = 1.0  # [s]
GATEWAY = "stepper_gateway"


class Robot(NamedTuple):
    """The robot that a command is about, from its files; read once for a command."""

    deployment: Deployment
    arm: Arm


class Session(NamedTuple):
    """A robot, and this command's own node on its bus."""

    deployment: Deployment
    arm: Arm
    node: Node


def load_robot() -> Robot:
    """Reads the deployment and the arm's files; raises `CommandError` with one sentence if they are wrong."""
    from services.arm.model.description import load_arm
    from services.runtime.deployment import load_deployment, project_root

    try:
        deployment = load_deployment()
        return Robot(deployment, load_arm(project_root() / deployment.robot))
    except (ValueError, OSError) as error:
        raise usage(str(error)) from error


def require_router(deployment: Deployment) -> None:
    """Raises `CommandError` at once if no router listens, instead of waiting for a stack that does not run."""
    address = (deployment.router.host, deployment.router.port)
    try:
        socket.create_connection(address, timeout=CONNECT_TIMEOUT).close()
    except OSError:
        where = f"{address[0]}:{address[1]}"
        raise CommandError(f"no router at {where}: start the twin with `make up`", ExitCode.NO_STACK) from None


def other_robots(deployment: Deployment, arm: Arm) -> str:
    """A sentence that names the robots on the router if `arm`'s own gateway is not there; else empty."""
    from services.runtime.robots import robots_on

    robots = robots_on(deployment.router, GATEWAY)
    if not robots or arm.name in robots:
        return ""
    router = f"{deployment.router.host}:{deployment.router.port}"
    return (
        f"the router at {router} has no {arm.name}, but {', '.join(robots)}: "
        f"GEMELO_ROBOT=urdf/{robots[0]} gemelo ... speaks with it"
    )


@contextmanager
def connect(robot: Robot | None = None) -> Iterator[Session]:
    """Yields a session with `robot`, by default the deployment's own.

    Raises `CommandError` if there is no router, if nobody answers, or if a server refuses.
    """
    deployment, arm = robot or load_robot()
    require_router(deployment)
    from services.runtime.errors import BusError, NoAnswer, Refused, ServerLost
    from services.runtime.node import Node

    try:
        with Node(f"cli-{os.getpid()}", deployment, robot=arm.name) as node:
            yield Session(deployment, arm, node)
    except NoAnswer as error:
        raise CommandError(other_robots(deployment, arm) or str(error), ExitCode.NO_STACK) from error
    except BusError as error:
        raise CommandError(str(error), ExitCode.NO_STACK) from error
    except (Refused, ServerLost) as error:
        raise CommandError(str(error)) from error
