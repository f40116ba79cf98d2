"""Several arms on one machine: a deployment for each, on one router and one broker, or why they cannot run together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from msgspec.structs import replace

from gemelo.libraries.arm.errors import nearest
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.deployment import ARMS
from gemelo.schemas.deployment import Broker, Deployment, DeviceKind, ViewerMode, Wire
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.hosts.quoting import Value, toml

HEADER = "# Written by `make up ARMS=...`, of deploy/local.toml and of the environment then.\n\n"
SHARED = ("router", "broker", "viewer")  # processes that serve all arms


@dataclass(frozen=True)
class StackedArm:
    """An arm among others on one machine."""

    arm: ArmDescription
    deployment: Deployment

    @property
    def name(self) -> str:
        return self.arm.name


def stacked_arms(names: Sequence[str], common: Deployment, root: Path) -> tuple[StackedArm, ...]:
    """The arms of urdf/, or of folders, each with its own page, recordings and readiness, all in one view.

    The first has the page's port of `common`, each further one the next. Raises `ConfigurationError` with every
    collision.
    """
    folders = [_folder(name, root) for name in names]
    arms = [load_arm(folder) for folder in folders]
    made = tuple(
        StackedArm(arm, _deployment(common, arm, folder, folders, index))
        for index, (arm, folder) in enumerate(zip(arms, folders, strict=True))
    )
    if problems := [*_same_names(made), *_same_devices(made), *_same_ports(made, common)]:
        raise ConfigurationError(because("arms.together", *problems))
    return made


def deployment_file(deployment: Deployment) -> str:
    """The deployment as TOML; raises `ConfigurationError` for a text that TOML cannot hold on a line."""
    plain = msgspec.to_builtins(deployment)
    tables: dict[str, dict[str, Value]] = {"": {}}
    for key, value in plain.items():
        if key == "parameters":
            tables |= {f'parameters."{node}"': values for node, values in value.items()}
        elif isinstance(value, dict):
            tables[key] = value
        else:
            tables[""][key] = value
    try:
        return HEADER + toml(tables)
    except ValueError as error:
        raise ConfigurationError(because("arms.deployment", error=str(error))) from error


def left_out(deployment: Deployment) -> frozenset[str]:
    """The processes that would only stand aside; with several arms they are not started."""
    aside = {
        "viewer": deployment.viewer.mode is ViewerMode.NONE,
        "virtual_esp32": deployment.device is DeviceKind.BOARD,
        "camera": not deployment.cell,
        "detector": not deployment.cell,
    }
    return frozenset(name for name, is_aside in aside.items() if is_aside)


def _folder(name: str, root: Path) -> Path:
    for folder in (root / "urdf" / name, root / name):
        if (folder / "robot.toml").is_file():
            return folder.resolve()
    known = sorted(path.parent.name for path in (root / "urdf").glob("*/robot.toml"))
    raise ConfigurationError(because("arms.unknown", nearest(name, known), name=name))


def _deployment(
    common: Deployment, arm: ArmDescription, folder: Path, all_folders: Sequence[Path], index: int
) -> Deployment:
    paths = common.paths
    return replace(
        common,
        robot=str(folder),
        cell=common.cell if _is_for(Path(common.cell), folder, all_folders) else "",
        arms=str(folder_of(common)),
        panel=replace(common.panel, port=common.panel.port + index),
        paths=replace(paths, run=f"{paths.run}/{arm.name}", out=f"{paths.out}/{arm.name}"),
    )


def _is_for(cell: Path, folder: Path, all_folders: Sequence[Path]) -> bool:
    """A cell file in the folder of one of the arms is that arm's alone; any other is everybody's."""
    owners = [each for each in all_folders if cell.resolve().is_relative_to(each)]
    return not owners or folder in owners


def _same_names(arms: Sequence[StackedArm]) -> Iterator[Reason]:
    seen: dict[str, str] = {}
    for each in arms:
        folder = each.deployment.robot
        if each.name == ARMS:
            yield because("arms.name.reserved", folder=folder, name=ARMS)
        if each.name in seen and seen[each.name] == folder:
            yield because("arms.name.twice", folder=folder, name=each.name)
        elif each.name in seen:
            yield because("arms.name.both", first=seen[each.name], second=folder, name=each.name)
        seen.setdefault(each.name, folder)


def _same_devices(arms: Sequence[StackedArm]) -> Iterator[Reason]:
    """Of one MQTT name, or at the end of one cable."""
    seen: dict[str, str] = {}
    for each in arms:
        deployment, name = each.deployment, each.arm.device.name
        if deployment.wire is Wire.MQTT:
            key, code = name, "arms.device.mqtt"
        elif deployment.device is DeviceKind.BOARD:
            key, code = deployment.serial.device, "arms.device.cable"
        else:
            continue
        if key in seen and seen[key] != each.name:
            yield because(code, first=seen[key], second=each.name, device=key)
        seen.setdefault(key, each.name)


def _same_ports(arms: Sequence[StackedArm], common: Deployment) -> Iterator[Reason]:
    wanted = [(common.router.listening[1], because("arms.port.router"))]
    if common.mqtt.broker is not Broker.EXTERNAL:
        wanted.append((common.mqtt.listening[1], because("arms.port.broker")))
    if common.viewer.mode is not ViewerMode.NONE:
        wanted.append((common.viewer.port, because("arms.port.viewer")))
        wanted.append((common.viewer.web_port, because("arms.port.view")))
    for index, each in enumerate(arms):
        plus = f" + {index}" if index else ""
        wanted.append((each.deployment.panel.port, because("arms.port.page", arm=each.name, plus=plus)))
    seen: dict[int, Reason] = {}
    for port, who in wanted:
        if not 0 < port < 65536:
            yield because("arms.port.none", who, port=port)
        elif port in seen:
            yield because("arms.port.twice", seen[port], who, port=port)
        seen.setdefault(port, who)


def folder_of(common: Deployment) -> Path:
    """Where the deployments of all arms stand."""
    return Path(common.paths.run) / ARMS


def file_of(common: Deployment, name: str) -> Path:
    """Where the deployment of an arm stands, for its processes and for `gemelo --robot`."""
    return folder_of(common) / f"{name}.toml"
