"""From the name of an arm to a connection with it."""

from __future__ import annotations

import socket
import time
from pathlib import Path

from msgspec.structs import replace

from gemelo.arm import Arm
from gemelo.errors import BadArgument, Error, Lost
from gemelo.session import Session
from schemas.deployment import Deployment
from services.arm.errors import suggestion
from services.arm.model.description import load_arm
from services.runtime.deployment import load_deployment, project_root

GATEWAY = "stepper_gateway"
LOOK_TIMEOUT = 1.0  # [s] of one look for the router
LOOK_EVERY = 0.1  # [s] while the twin is awaited


def connect(robot: str = "", *, deployment: str | Path | None = None, name: str = "", timeout: float = 0.0) -> Arm:
    """The arm of the deployment (the file `deployment`, $GEMELO_CONFIG, or deploy/local.toml), or another `robot`.

    `robot`: a folder of urdf/ or a path to one. `name`: of this script's node; its file's name and process if left
    out. `timeout` [s]: that the twin may take to be there. Raises `Lost` where it does not run, `Error` where its
    files are wrong.

    >>> with gemelo.connect() as second:
    ...     second.joints == arm.joints
    True
    """
    end = time.monotonic() + timeout
    try:
        found = load_deployment(None if deployment is None else Path(deployment))
        if robot:
            found = replace(found, robot=str(_folder(robot)))
        description = load_arm(Path(found.robot))
    except (ValueError, OSError) as error:
        raise error if isinstance(error, Error) else Error(str(error)) from error
    _await_router(found, end)
    session = Session(found, description, name)
    try:
        _await_gateway(session, end)
    except BaseException:
        session.close()
        raise
    return Arm(session)


def _folder(robot: str) -> Path:
    """urdf/<robot>, or the path itself."""
    for folder in (project_root() / "urdf" / robot, Path(robot)):
        if (folder / "robot.toml").is_file():
            return folder.resolve()
    known = sorted(path.parent.name for path in (project_root() / "urdf").glob("*/robot.toml"))
    raise BadArgument(f'there is no arm "{robot}"{suggestion(robot, known)}')


def _await_router(deployment: Deployment, end: float) -> None:
    address = (deployment.router.host, deployment.router.port)
    while True:
        try:
            return socket.create_connection(address, timeout=LOOK_TIMEOUT).close()
        except OSError:
            if time.monotonic() > end:
                where = f"{address[0]}:{address[1]}"
                raise Lost(f"no router at {where}: start the twin with `make up`") from None
        time.sleep(LOOK_EVERY)


def _await_gateway(session: Session, end: float) -> None:
    robot, router = session.description.name, session.deployment.router
    while GATEWAY not in session.node.alive():
        if time.monotonic() > end:
            raise Lost(
                f"no {GATEWAY} of {robot} at the router {router.host}:{router.port}: does the twin run with another "
                f"arm? GEMELO_ROBOT=urdf/{robot} make up"
            )
        time.sleep(LOOK_EVERY)
