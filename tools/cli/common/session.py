"""The connection of one command: the robot's files, then `gemelo` for what moves, or a node for what listens."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, NamedTuple

import gemelo
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode, usage

if TYPE_CHECKING:
    from gemelo import Arm, Robot
    from gemelo.libraries.arm.model.description import ArmDescription
    from gemelo.libraries.runtime.node import Node
    from gemelo.schemas.deployment import Deployment
    from gemelo.tools.cli.simulated import SimulatedTwin


class CommandSession(NamedTuple):
    """A robot, and this command's own node on its bus."""

    deployment: Deployment
    arm: ArmDescription
    node: Node


def chosen_twin() -> SimulatedTwin | None:
    """The simulated twin of this command line; None where it is for the stack that runs."""
    module = sys.modules.get("gemelo.tools.cli.simulated")  # loaded by --simulate alone
    return module.chosen() if module is not None else None


def load_robot() -> Robot:
    """The arm that runs, or that of this folder; raises `CommandError` where files are wrong, or several run."""
    from gemelo.api.robot_files import find_robot  # slow to load

    try:
        return find_robot(ask=chosen_twin() is None)
    except gemelo.Error as error:
        raise usage(error) from error


@contextmanager
def connect_arm(robot: Robot | None = None) -> Iterator[Arm]:
    """Yields the arm of `robot`, by default the deployment's own.

    Raises `CommandError` if there is no router, if nobody answers, or for what was refused or has failed.
    """
    robot, twin = robot or load_robot(), chosen_twin()
    require_router(robot.deployment)
    with reported(robot):
        opened = (
            gemelo.connect(robot, name=own_name(), needs_gateway=False)
            if twin is None
            else twin.connect(robot, own_name())
        )
        with opened as arm:
            yield arm


@contextmanager
def reported(robot: Robot) -> Iterator[None]:
    """Raises every error of `gemelo` as a `CommandError`, with commands where `gemelo` names its methods."""
    try:
        yield
    except gemelo.Lost as error:
        raise CommandError(other_robots(robot.deployment, robot.description) or error, ExitCode.NO_STACK) from error
    except gemelo.BadArgument as error:
        raise usage(error) from error
    except gemelo.Error as error:
        raise CommandError(error) from error
    except gemelo.Interrupted as error:
        raise CommandError(error, ExitCode.CANCELLED) from error


@contextmanager
def connect(robot: Robot | None = None) -> Iterator[CommandSession]:
    """Yields a session with a node for `robot`, by default the deployment's own.

    Raises `CommandError` if there is no router, if nobody answers, or if a server refuses.
    """
    robot, twin = robot or load_robot(), chosen_twin()
    deployment, arm = robot
    require_router(deployment)
    from gemelo.libraries.runtime.errors import BusError, NoAnswer, RequestRefused, ServerLost  # slow to load: the bus
    from gemelo.libraries.runtime.node import Node

    try:
        if twin is None:
            opened = Node(own_name(), deployment, robot=arm.name)
        else:
            with reported(robot):
                opened = twin.node(robot, own_name())
        with opened as node:
            yield CommandSession(node.deployment, arm, node)
    except NoAnswer as error:
        raise CommandError(other_robots(deployment, arm) or error, ExitCode.NO_STACK) from error
    except BusError as error:
        raise CommandError(error, ExitCode.NO_STACK) from error
    except (RequestRefused, ServerLost) as error:
        raise CommandError(error) from error


def share_control(session: CommandSession) -> None:
    """Shares the hold of control that another process of this user has on this host, if there is one."""
    from gemelo.api.control import join_shared  # slow to load: the bus

    join_shared(session.node, session.arm.name, session.deployment)


def require_router(deployment: Deployment) -> None:
    """Raises `CommandError` where no router listens, before anything slow is loaded; a simulated twin needs none."""
    if chosen_twin() is not None:
        return
    from gemelo.api import robot_files  # slow to load

    try:
        robot_files.require_router(deployment)
    except gemelo.Lost as error:
        raise CommandError(error.message, ExitCode.NO_STACK) from error


def other_robots(deployment: Deployment, arm: ArmDescription) -> Reason | None:
    """The robots on the router if `arm`'s own gateway is not there; else None."""
    robots = gemelo.robots(deployment) if chosen_twin() is None else ()
    if not robots or arm.name in robots:
        return None
    host, port = deployment.router.host, deployment.router.port
    return because("cli.other_robots", host=host, port=port, robot=arm.name, names=", ".join(robots), other=robots[0])


def own_name() -> str:
    """The name of this command's node; `gemelo node list` leaves it out."""
    return f"cli-{os.getpid()}"
