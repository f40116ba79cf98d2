"""The files of an arm: where it runs, and what it is; and whether its router is there."""

from __future__ import annotations

import os
import socket
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gemelo.api.addresses import is_address
from gemelo.api.errors import BadArgument, Error, Lost, reason_of
from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model import description as descriptions
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.deployment import CONFIG, is_loopback, load_deployment, project_root
from gemelo.libraries.runtime.running import find_deployment, folder_of
from gemelo.libraries.runtime.started import deployment_of_arm
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because, remedy

LOOK_TIMEOUT = 1.0  # [s] of one look for the router


class Robot(NamedTuple):
    """An arm and where it runs, from their files.

    >>> gemelo.load_robot().description.name
    'rm1'
    """

    deployment: Deployment  # router, broker, folders
    description: ArmDescription  # URDF, SRDF and robot.toml as one


def load_robot(robot: str = "", *, deployment: str | Path | None = None) -> Robot:
    """Reads the files of an arm and of its deployment; asks nobody what runs.

    One of several arms that `make up ARMS=...` has started has folders of its own.

    Raises `Error` where a file is wrong, `BadArgument` where there is no such arm.

    >>> gemelo.load_robot("parol6").description.tool_frame
    'tool_link'
    """
    try:
        file = deployment_of_arm(robot) if robot and deployment is None else None
        if file is not None:
            found = load_deployment(file, {})  # what the environment said when it was started stands in the file
        else:
            found = load_deployment(None if deployment is None else Path(deployment))
        if robot and file is None:
            found = replace(found, robot=str(_folder(robot)))
        return Robot(found, descriptions.load_arm(project_root() / found.robot))
    except (ValueError, OSError) as error:
        raise error if isinstance(error, Error) else Error(reason_of(error)) from error


def find_robot(robot: str = "", *, deployment: str | Path | None = None, ask: bool = True) -> Robot:
    """The arm that runs, with the files that its twin was started with; that of this folder where none runs.

    The address of a router, as tcp/lab:7447 or tcp/lab:7447/rm1, asks for the files there: none are needed here.
    `robot`, else $GEMELO_ROBOT or $GEMELO_CONFIG, is the one that is meant; else the only one on the router, else the
    one that `gemelo use` has chosen. Raises `Error` where a file is wrong or several run, `BadArgument` where there is
    no such arm. Without `ask` nobody is asked, and it is what this folder has started last.
    """
    if is_address(robot):
        from gemelo.api.bus_files import deployment_at  # slow to load, for who has no files

        found = deployment_at(robot)
        return Robot(found, descriptions.load_arm(Path(found.robot)))
    environ = dict(os.environ) if deployment is None else {**os.environ, CONFIG: str(deployment)}
    try:
        found = find_deployment(robot, environ, ask=ask)
        description = descriptions.load_arm(project_root() / found.robot)
    except (ValueError, OSError) as error:
        raise Error(reason_of(error)) from error
    if robot and description.name != robot:
        _folder(robot)
    return Robot(found, description)


def require_router(deployment: Deployment) -> None:
    """Raises `Lost` at once where no router listens, instead of waiting for a twin that does not run."""
    address = (deployment.router.host, deployment.router.port)
    try:
        socket.create_connection(address, timeout=LOOK_TIMEOUT).close()
    except OSError:
        host, port = address
        hint = remedy("start_twin") if is_loopback(host) else remedy("look_at_host", host=host)
        raise Lost(because("lost.router", hint, host=host, port=port)) from None


def _folder(robot: str) -> Path:
    """urdf/<robot>, or the path itself."""
    if (folder := folder_of(robot)) is not None:
        return folder
    known = sorted(path.parent.name for path in (project_root() / "urdf").glob("*/robot.toml"))
    raise BadArgument(because("argument.robot.unknown", nearest(robot, known), name=robot))
