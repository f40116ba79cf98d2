"""Asks a router what runs on it: the robots, the one that a client is for, and the files that its twin began with."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterable, Mapping
from pathlib import Path

from msgspec.structs import replace

from gemelo.libraries.runtime.bus.identity import ALIVE, addresses
from gemelo.libraries.runtime.deployment import CONFIG, PREFIX, load_deployment, project_root, robot_name
from gemelo.libraries.runtime.started import chosen_name, deployment_of_arm, load_started
from gemelo.schemas.deployment import Deployment, RouterSection
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import because, remedy
from gemelo.schemas.system import Empty, NodeInfo

GATEWAY = "stepper_gateway"
TELLERS = (GATEWAY, "planner", "state_publisher", "camera")  # a robot without any of them is a recording that is played
TO_ANSWER = 1.0  # [s] for the router to list the liveliness tokens
TO_TELL = 0.5  # [s] for a node to say its files; chosen: one that is frozen is not waited for
LOOK = 1.0  # [s] of one look for the router
ROBOT_FILE = "robot.toml"
PATHS = f"{PREFIX}PATHS_"


class SeveralRobots(ConfigurationError):
    """Several robots run on the router, and nobody has said which of them is meant."""

    def __init__(self, router: RouterSection, robots: tuple[str, ...]) -> None:
        hint = remedy("choose_robot", robot=robots[0])
        names = ", ".join(robots)
        super().__init__(
            because("robots.several", hint, count=len(robots), host=router.host, port=router.port, names=names)
        )
        self.robots = robots


def find_deployment(robot: str = "", environ: Mapping[str, str] | None = None, *, ask: bool = True) -> Deployment:
    """The deployment of the robot that runs, with the files of its twin; that of this folder where none runs.

    `robot`, else what `environ` names, is the one that is meant. Without `ask` nobody is asked what runs. Raises
    `SeveralRobots`, `DeploymentError`.
    """
    environ = os.environ if environ is None else environ
    base, named = _as_chosen(robot, environ)
    nodes = running_robots(base.router) if ask else {}
    name = named or _meant([each for each in nodes if GATEWAY in nodes[each]] or nodes, base, environ)
    if name not in nodes or (environ.get(CONFIG) and named == robot_name(base)):
        return base  # a deployment that was named says its own files, as on another host or for another user
    info = ask_files(base.router, name, nodes[name])
    return _of_robot(base, name) if info is None else with_files(base, info, environ)


def running_robots(router: RouterSection) -> dict[str, frozenset[str]]:
    """The robots that run on the router, with the addresses of their nodes; none where no router listens."""
    if not listens(router):
        return {}
    return {name: found for name, found in nodes_on(router).items() if not found.isdisjoint(TELLERS)}


def files_of(router: RouterSection, robot: str, nodes: Iterable[str]) -> str:
    """The folder of robot.toml that the twin of a running robot has, where this machine has it too; else empty."""
    return _local_folder(ask_files(router, robot, nodes))


def _local_folder(info: NodeInfo | None) -> str:
    if info is None or info.host != socket.gethostname() or not (Path(info.files.robot) / ROBOT_FILE).is_file():
        return ""
    return info.files.robot


def listens(router: RouterSection) -> bool:
    """True if something takes a connection at the router's address."""
    try:
        socket.create_connection((router.host, router.port), timeout=LOOK).close()
    except OSError:
        return False
    return True


def _as_chosen(robot: str, environ: Mapping[str, str]) -> tuple[Deployment, str]:
    """The deployment before anybody is asked, and the name of the robot that is meant, empty where nobody says."""
    file = deployment_of_arm(robot, environ) if robot else None
    if file is not None:
        return load_deployment(file, {}), robot
    base = load_started(environ)
    if robot:
        folder = folder_of(robot)
        return (base, robot) if folder is None else (replace(base, robot=str(folder)), _name_in(folder, robot))
    is_named = environ.get(CONFIG) or environ.get(f"{PREFIX}ROBOT")
    return base, robot_name(base) if is_named else ""


def _meant(robots: Iterable[str], base: Deployment, environ: Mapping[str, str]) -> str:
    """The only one of `robots`, or the one that `gemelo use` has chosen; empty where there is none."""
    names = tuple(sorted(robots))
    if len(names) < 2:
        return names[0] if names else ""
    if (chosen := chosen_name(environ)) in names:
        return chosen
    raise SeveralRobots(base.router, names)


def folder_of(robot: str) -> Path | None:
    """The folder of a robot of urdf/, or the path itself; None where neither has a robot.toml."""
    for folder in (project_root() / "urdf" / robot, Path(robot)):
        if (folder / ROBOT_FILE).is_file():
            return folder.resolve()
    return None


def _name_in(folder: Path, otherwise: str) -> str:
    try:
        return robot_name(Deployment(robot=str(folder)))
    except ConfigurationError:
        return otherwise


def _of_robot(base: Deployment, name: str) -> Deployment:
    """`base` with the files of this folder for a robot whose twin says nothing of its own."""
    if _name_in(Path(base.robot), "") == name:
        return base
    file = deployment_of_arm(name)
    if file is not None:
        return load_deployment(file, {})
    folder = folder_of(name)
    return base if folder is None else replace(base, robot=str(folder), cell="")


def ask_files(router: RouterSection, robot: str, nodes: Iterable[str]) -> NodeInfo | None:
    """What the first of its nodes that tells says of itself and its files; None where none answers."""
    from gemelo.libraries.runtime.bus.zenoh_bus import BusNotOpen, ZenohBus  # slow to load: zenoh
    from gemelo.libraries.runtime.endpoints import info_request
    from gemelo.libraries.runtime.errors import BusError, NoAnswer, RequestRefused
    from gemelo.libraries.runtime.requests.client import call

    try:
        bus = ZenohBus(router, robot)
    except BusNotOpen:
        return None
    try:
        for node in (each for each in TELLERS if each in nodes):
            try:
                return call(bus, info_request(node), Empty(), TO_TELL)
            except (NoAnswer, RequestRefused):
                continue
    except BusError:
        return None
    finally:
        bus.close()
    return None


def with_files(base: Deployment, info: NodeInfo, environ: Mapping[str, str]) -> Deployment:
    """`base` with the folders and files of the twin where this machine has them; else with its own of that robot.

    A folder that `environ` names is this terminal's own choice, as of the programs that it runs. A cell file of another
    machine is read over the bus (`CELL`), so none stands here then.
    """
    files = info.files
    if not _local_folder(info):
        return replace(_of_robot(base, info.robot), cell="")
    told = {"run": files.run, "out": files.out, "programs": files.programs}
    paths = replace(base.paths, **{key: path for key, path in told.items() if not environ.get(f"{PATHS}{key}".upper())})
    return replace(base, robot=files.robot, cell=files.cell, paths=paths)


def robots_on(router: RouterSection, node: str = "*") -> tuple[str, ...]:
    """The names of the robots of which `node` (or any node) is alive on `router`, sorted; none without an answer."""
    return tuple(sorted(robot for robot, nodes in nodes_on(router).items() if node == "*" or node in nodes))


def nodes_on(router: RouterSection) -> dict[str, frozenset[str]]:
    """The addresses of the living nodes on `router`, by robot; none if it cannot be asked.

    A session for one robot has its name as Zenoh's namespace and cannot see another's tokens, so this one has none.
    """
    import zenoh  # slow to load

    from gemelo.libraries.runtime.bus.zenoh_config import client_config

    try:
        with zenoh.open(client_config(router)) as session:
            replies = session.liveliness().get(f"*/{ALIVE}/*/*", timeout=TO_ANSWER)
            keys = [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]
    except zenoh.ZError:
        return {}
    found: dict[str, set[str]] = {}
    for robot, _, token in (key.partition("/") for key in keys):
        found.setdefault(robot, set()).update(addresses([token]))
    return {robot: frozenset(nodes) for robot, nodes in found.items() if nodes}
