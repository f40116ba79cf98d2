"""The files of an arm: where it runs, and what it is; and whether its router is there."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import NamedTuple

from msgspec.structs import replace

from gemelo.errors import BadArgument, Error, Lost
from schemas.deployment import Deployment
from services.arm.errors import suggestion
from services.arm.model import description as descriptions
from services.arm.model.description import ArmDescription
from services.runtime.deployment import deployment_of_arm, load_deployment, project_root, when_silent

LOOK_TIMEOUT = 1.0  # [s] of one look for the router


class Robot(NamedTuple):
    """An arm and where it runs, from their files.

    >>> gemelo.load_robot().description.name
    'rm1'
    """

    deployment: Deployment  # router, broker, folders
    description: ArmDescription  # URDF, SRDF and robot.toml as one


def load_robot(robot: str = "", *, deployment: str | Path | None = None) -> Robot:
    """Reads the files of the arm that `connect` with the same arguments is for; asks nobody.

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
        raise error if isinstance(error, Error) else Error(str(error)) from error


def require_router(deployment: Deployment) -> None:
    """Raises `Lost` at once where no router listens, instead of waiting for a twin that does not run."""
    address = (deployment.router.host, deployment.router.port)
    try:
        socket.create_connection(address, timeout=LOOK_TIMEOUT).close()
    except OSError:
        raise Lost(f"no router at {address[0]}:{address[1]}: {when_silent(address[0])}") from None


def _folder(robot: str) -> Path:
    """urdf/<robot>, or the path itself."""
    for folder in (project_root() / "urdf" / robot, Path(robot)):
        if (folder / "robot.toml").is_file():
            return folder.resolve()
    known = sorted(path.parent.name for path in (project_root() / "urdf").glob("*/robot.toml"))
    raise BadArgument(f'there is no arm "{robot}"{suggestion(robot, known)}')
