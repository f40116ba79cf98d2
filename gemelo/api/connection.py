"""Connection to an arm by its name."""

from __future__ import annotations

import time
from pathlib import Path

from gemelo.api.arm import Arm
from gemelo.api.errors import Error, Lost, reason_of
from gemelo.api.robot_files import Robot, find_robot, require_router
from gemelo.api.session import Session, open_node
from gemelo.libraries.runtime.deployment import is_loopback, load_deployment
from gemelo.libraries.runtime.running import robots_on
from gemelo.libraries.runtime.started import load_started
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because, remedy

GATEWAY = "stepper_gateway"
LOOK_EVERY = 0.1  # [s] while the twin is awaited


def connect(
    robot: str | Robot = "",
    *,
    deployment: str | Path | None = None,
    name: str = "",
    timeout: float = 0.0,
    needs_gateway: bool = True,
) -> Arm:
    """The arm that runs: the only one on the router, the one that `gemelo use` has chosen, or `robot`.

    `robot`: a folder of urdf/, a path to one, what `load_robot` has read, or the address of a router, as tcp/lab:7447:
    from there the arm's description comes over the bus, and no file is needed here. `deployment`: a file that says
    where the router is, else $GEMELO_CONFIG, or what this folder has started. `name`: of this script's node; its
    file's name and process if left out. `timeout` [s]: that the twin may take to be there. `needs_gateway=False` also
    takes a twin that cannot move, for what the planner alone answers. Raises `Lost` where the twin does not run,
    `Error` where its files are wrong.

    >>> with gemelo.connect() as second:
    ...     second.joints == arm.joints
    True
    """
    end = time.monotonic() + timeout
    found = _find(robot, deployment, end)
    node = open_node(found.deployment, found.description.name, name)
    session = Session(found.deployment, found.description, node)
    try:
        if needs_gateway:
            _await_gateway(session, end)
    except BaseException:
        session.close()
        raise
    return Arm(session)


def robots(deployment: str | Path | Deployment | None = None) -> tuple[str, ...]:
    """The names of the arms that run on the deployment's router, sorted; none where no router answers.

    >>> gemelo.robots()
    ('rm1',)
    """
    if not isinstance(deployment, Deployment):
        try:
            deployment = load_started() if deployment is None else load_deployment(Path(deployment))
        except (ValueError, OSError) as error:
            raise Error(reason_of(error)) from error
    return robots_on(deployment.router, GATEWAY)


def _find(robot: str | Robot, deployment: str | Path | None, end: float) -> Robot:
    """Looks until a router listens and the arm runs; at `end` [s] monotonic it is whatever the files say."""
    while True:
        found = robot if isinstance(robot, Robot) else find_robot(robot, deployment=deployment)
        is_late = time.monotonic() >= end
        try:
            require_router(found.deployment)
            if is_late or found is robot or found.description.name in robots(found.deployment):
                return found
        except Lost:
            if is_late:
                raise
        time.sleep(LOOK_EVERY)


def _await_gateway(session: Session, end: float) -> None:
    robot, router = session.description.name, session.deployment.router
    while GATEWAY not in session.node.alive():
        if time.monotonic() > end:
            others = robots(session.deployment)
            if others:
                hint = remedy("other_arm", names=", ".join(others), robot=others[0])
            else:
                hint = remedy("start_arm", robot=robot) if is_loopback(router.host) else remedy("see_deployment")
            said = because("lost.gateway", hint, gateway=GATEWAY, robot=robot, host=router.host, port=router.port)
            raise Lost(said, others)
        time.sleep(LOOK_EVERY)
