"""Reads a deployment file, with overrides from the environment; what is wrong is one sentence."""

from __future__ import annotations

import difflib
import ipaddress
import os
import re
import shutil
import tomllib
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from gemelo.libraries.toml_lines import syntax_mistake, type_mistake
from gemelo.schemas.deployment import Deployment, DeploymentRecord
from gemelo.schemas.errors import ConfigurationError
from gemelo.schemas.reasons import Reason, Remedy, because, remedy
from gemelo.schemas.text_file import NotUtf8, read_text

DEFAULT_FILE = "deploy/local.toml"
MQTT_FILES = (
    "secure_folder",
    "persistence_folder",
    "password_file",
    "device_password_file",
    "ca",
    "certificate",
    "key",
)
ROUTER_FILES = ("configuration", "ca", "certificate", "key")
PREFIX = "GEMELO_"
HOME = "GEMELO_HOME"  # the project's folder, for a process that is neither in it nor of it
CONFIG = "GEMELO_CONFIG"  # names another file than DEFAULT_FILE
ARMS = "arms"  # folder in `paths.run` with a deployment for each of several arms that `make up ARMS=...` started last
REMEDIES = {
    "router": "certificates_for_router",
    "mqtt": "tls_for_broker",
    "panel": "page_through_ssh",
    "viewer": "viewer_through_ssh",
}  # by section of the deployment

S = TypeVar("S", bound=DeploymentRecord)


class DeploymentError(ConfigurationError):
    """A deployment that cannot be used; the text names the file, the key and what would do."""


def project_root() -> Path:
    """The folder of deploy/local.toml: above this file, above the working directory, or $GEMELO_HOME."""
    for start in (Path(__file__).resolve(), Path.cwd() / "here"):
        for folder in start.parents:
            if (folder / DEFAULT_FILE).is_file():
                return folder
    if home := os.environ.get(HOME):
        return Path(home)
    raise DeploymentError(because("deployment.no_project", file=DEFAULT_FILE))


def load_deployment(path: Path | None = None, environ: Mapping[str, str] | None = None) -> Deployment:
    """The deployment of `path`, else of $GEMELO_CONFIG, else of deploy/local.toml; its paths are absolute."""
    environ = os.environ if environ is None else environ
    root = project_root()
    file = deployment_file(path, environ)
    raw = _read(file)
    _require_known(raw, _defaults(), file, ())
    sources = _override(raw, environ)
    try:
        deployment = msgspec.convert(raw, Deployment, strict=not sources)
    except msgspec.ValidationError as error:
        known = _choices(str(error))
        parts = (type_mistake(error, "")[1], *((remedy("known_are", names=known),) if known else ()))
        if sources:
            why = because("deployment.overridden", *parts, file=str(file), names=tuple(sources))
            raise DeploymentError(why) from error
        raise DeploymentError(because("file.wrong", *parts, file=str(file))) from error
    _require_no_nul(raw, file, ())
    return _with_absolute_paths(deployment, root)


def deployment_file(path: Path | None, environ: Mapping[str, str]) -> Path:
    """The file that `load_deployment` reads, whether or not it is there."""
    root = project_root()
    chosen = path or Path(environ.get(CONFIG) or root / DEFAULT_FILE)
    return chosen if chosen.is_absolute() or chosen.exists() else root / chosen


def robot_name(deployment: Deployment) -> str:
    """The `name` in the arm's robot.toml: the first chunk of every key."""
    file = project_root() / deployment.robot / "robot.toml"
    name = _read(file).get("name")
    if not isinstance(name, str) or not name or "/" in name:
        raise DeploymentError(because("deployment.robot_name", file=str(file)))
    return name


def deployments_beside(deployment: Deployment) -> tuple[Deployment, ...]:
    """Of all arms that share this one's viewer, itself among them, in the order of their pages; empty where none do.

    Raises `DeploymentError`.
    """
    files = Path(deployment.arms).glob("*.toml") if deployment.arms else ()
    return tuple(sorted((load_deployment(file, {}) for file in files), key=lambda each: each.panel.port))


def forget_arms(common: Deployment) -> None:
    """Several arms that were started before are no more."""
    shutil.rmtree(Path(common.paths.run) / ARMS, ignore_errors=True)


def overriding(environ: Mapping[str, str]) -> list[str]:
    """The variables in `environ` that would override a deployment file."""
    return _override({}, environ)


def exposure(section: str, host: str, is_locked: bool, is_insecure: bool) -> Reason | None:
    """What to say at the start of what listens on `host`: None where only this machine reaches it, or it is locked.

    Raises `DeploymentError` for an open port that other machines reach, unless the deployment says `insecure`.
    """
    if is_locked or is_loopback(host):
        return None
    if not is_insecure:
        variable, mend = f"GEMELO_{section.upper()}_INSECURE", remedy(REMEDIES[section])
        raise DeploymentError(because("deployment.exposed", mend, section=section, host=host, variable=variable))
    return because("deployment.insecure", section=section, host=host)


def is_loopback(host: str) -> bool:
    """True if only this machine reaches the address; a name other than localhost may be any machine's."""
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host == "localhost"


def when_silent(host: str) -> str:
    """The remedy where nobody answers at `host`: what is here is started, another host is looked at."""
    if is_loopback(host):
        return "start the twin with `make up`"
    return f"is that host on, does it answer `ping {host}` from here, and does its service run?"


def remedy_when_silent(host: str) -> Remedy:
    """As `when_silent`, as data."""
    return remedy("start_twin") if is_loopback(host) else remedy("look_at_host", host=host)


def _read(file: Path) -> dict[str, Any]:
    text = ""
    try:
        text = read_text(file)
        return tomllib.loads(text)
    except FileNotFoundError:
        raise DeploymentError(because("deployment.none", file=str(file))) from None
    except tomllib.TOMLDecodeError as error:
        line, what = syntax_mistake(error, text)
        raise DeploymentError(because("file.line", what, file=str(file), line=line)) from error
    except NotUtf8 as error:
        raise DeploymentError(because("file.wrong", error.reason, file=str(file))) from error
    except OSError as error:
        what = because("file.unreadable", error=error.strerror or str(error))
        raise DeploymentError(because("file.wrong", what, file=str(file))) from error


def _defaults() -> dict[str, Any]:
    return msgspec.to_builtins(Deployment())  # type: ignore[no-any-return]


def _require_known(raw: dict[str, Any], known: dict[str, Any], file: Path, path: tuple[str, ...]) -> None:
    for key, value in raw.items():
        if key not in known:
            name = ".".join((*path, key))
            near = difflib.get_close_matches(key, known, n=1)
            hint = remedy("did_you_mean", name=near[0]) if near else remedy("known_are", names=tuple(known))
            raise DeploymentError(because("file.wrong", because("deployment.key", hint, key=name), file=str(file)))
        if key != "parameters" and isinstance(value, dict) and isinstance(known[key], dict):
            _require_known(value, known[key], file, (*path, key))


def _require_no_nul(value: object, file: Path, path: tuple[str, ...]) -> None:
    """Most texts here become a path or a host, and neither has a NUL in it."""
    if isinstance(value, str) and "\0" in value:
        what = because("deployment.nul", key=".".join(path), value=value)
        raise DeploymentError(because("file.wrong", what, file=str(file)))
    for key, inner in value.items() if isinstance(value, dict) else ():
        _require_no_nul(inner, file, (*path, key))


def _choices(error: str) -> tuple[str, ...]:
    """The values that the key named in `error` can have, where it has only a few."""
    at = re.search(r"`\$\.(\w+)\.(\w+)`", error)
    default = getattr(getattr(Deployment(), at[1], None), at[2], None) if at else None
    return tuple(map(str, type(default))) if isinstance(default, StrEnum) else ()


def _override(raw: dict[str, Any], environ: Mapping[str, str]) -> list[str]:
    """Writes GEMELO_<KEY> and GEMELO_<SECTION>_<KEY> into `raw`; returns the variables used."""
    used = []
    for key, default in _defaults().items():
        if isinstance(default, dict):
            for name in default:
                variable = f"{PREFIX}{key}_{name}".upper()
                if environ.get(variable):
                    raw[key] = {**raw.get(key, {}), name: environ[variable]}
                    used.append(variable)
        elif environ.get(f"{PREFIX}{key}".upper()):
            raw[key] = environ[f"{PREFIX}{key}".upper()]
            used.append(f"{PREFIX}{key}".upper())
    return used


def _with_absolute_paths(deployment: Deployment, root: Path) -> Deployment:
    paths = msgspec.structs.replace(
        deployment.paths,
        run=str(root / deployment.paths.run),
        out=str(root / deployment.paths.out),
        programs=str(root / deployment.paths.programs),
    )
    mqtt = _with_absolute(deployment.mqtt, MQTT_FILES, root)
    router = _with_absolute(deployment.router, ROUTER_FILES, root)
    robot = str(root / deployment.robot)
    cell, arms = (str(root / each) if each else "" for each in (deployment.cell, deployment.arms))
    return msgspec.structs.replace(deployment, robot=robot, cell=cell, arms=arms, router=router, mqtt=mqtt, paths=paths)


def _with_absolute(section: S, names: tuple[str, ...], root: Path) -> S:
    """The section with its files that are named in it below `root`."""
    files = {name: str(root / path) for name in names if (path := getattr(section, name))}
    return msgspec.structs.replace(section, **files)
