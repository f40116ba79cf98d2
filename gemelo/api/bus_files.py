"""An arm whose files are elsewhere: its description comes over the bus, from a router that an address names."""

from __future__ import annotations

import os
import tempfile
import time
import tomllib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from gemelo.api.addresses import parsed
from gemelo.api.errors import Error, Lost
from gemelo.libraries.runtime.deployment import DEFAULT_FILE, HOME, DeploymentError, project_root
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.running import running_robots
from gemelo.schemas.deployment import Deployment, PathsSection, RouterSection
from gemelo.schemas.frames import RobotDescription
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DESCRIPTION

PATIENCE = 5.0  # [s] chosen: for a description that is latched, over a slow network
_kept: list[tempfile.TemporaryDirectory[str]] = []  # until this process ends: an arm's files are read late


def deployment_at(address: str) -> Deployment:
    """A deployment for scripts of this machine and the arm at an address, with the arm's files in a temporary folder.

    Meshes and the cell are not among them. Raises `BadArgument` for an address that is none, `Lost` where no router or
    no arm answers there, `Error` where several do and none is named.
    """
    router, name = parsed(address)
    running = running_robots(router)
    if not running:
        raise Lost(because("address.silent", address=address))
    if not name and len(running) > 1:
        first, *_ = names = tuple(sorted(running))
        raise Error(because("address.several", address=address, robots=names, first=first))
    name = name or next(iter(running))
    if name not in running:
        raise Lost(because("address.other", address=address, name=name, robots=tuple(sorted(running))))
    kept = tempfile.TemporaryDirectory(prefix="gemelo-")
    _kept.append(kept)
    site = Path(kept.name)
    make_home(site, router)
    deployment = Deployment(
        robot=str(site / "urdf" / name),
        router=router,
        paths=PathsSection(run=str(site / "run"), out=str(Path.cwd() / "out"), programs=str(Path.cwd() / "programs")),
    )
    write_files(Path(deployment.robot), described(deployment, name, address))
    return deployment


def described(deployment: Deployment, name: str, address: str) -> RobotDescription:
    """What its state publisher says of it; raises `Lost` where nothing comes for `PATIENCE`."""
    with Node(f"files-{os.getpid()}", deployment, robot=name, log_level="warning") as node:
        latest = node.latest(DESCRIPTION)
        end = time.monotonic() + PATIENCE
        while latest.message is None:
            if time.monotonic() > end:
                raise Lost(because("address.undescribed", address=address, name=name))
            node.wait(0.05)
        return latest.message


def write_files(folder: Path, description: RobotDescription) -> None:
    """As `load_arm` reads them; raises `Error` where robot.toml names files outside of its folder."""
    folder.mkdir(parents=True)
    data = tomllib.loads(description.robot_toml)
    texts = {"robot.toml": description.robot_toml}
    texts |= {name: text for key, text in files_of(description).items() if (name := data.get(key, ""))}
    for name, text in texts.items():
        place = PurePosixPath(name)
        if place.is_absolute() or ".." in place.parts:
            raise Error(because("address.outside", file=name))
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(text, encoding="utf-8")


def files_of(description: RobotDescription) -> Mapping[str, str]:
    """The texts by the keys of robot.toml that name their files."""
    return {"urdf": description.urdf, "srdf": description.srdf}


def make_home(site: Path, router: RouterSection) -> None:
    """Where this process has no project, `site` becomes one: what is kept between commands is kept nowhere then."""
    try:
        project_root()
    except DeploymentError:
        file = site / DEFAULT_FILE
        file.parent.mkdir()
        file.write_text(f'[router]\nhost = "{router.host}"\nport = {router.port}\n', encoding="utf-8")
        os.environ[HOME] = str(site)
