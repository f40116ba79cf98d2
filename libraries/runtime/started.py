"""The file of the run: what the environment of `make up` said, for commands of its folder, also while it is down."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path

from gemelo.libraries.runtime.deployment import ARMS, CONFIG, PREFIX, load_deployment, overriding, project_root
from gemelo.libraries.runtime.saved_parameters import toml
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.text_file import NotUtf8, read_text

FILE = ".gemelo/started.toml"  # of the project; $GEMELO_STARTED is another, for a stack of its own beside it
USE = "use"  # beside it
VARIABLE = f"{PREFIX}STARTED"
HEAD = "# Written by `make up`: what its environment said. Commands of this folder go by it.\n"
ADDRESS = (f"{PREFIX}ROUTER_HOST", f"{PREFIX}ROUTER_PORT")


def keep_started(environ: Mapping[str, str]) -> None:
    """Writes what `environ` says of a deployment; a folder that cannot be written keeps nothing."""
    said = {name: environ[name] for name in (CONFIG, *overriding(environ)) if environ.get(name)}
    if CONFIG in said:
        said[CONFIG] = str(Path(said[CONFIG]).resolve())
    file = started_file(environ)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(HEAD + "".join(f"{name} = {toml(value)}\n" for name, value in said.items()), encoding="utf-8")
    except OSError:
        return


def started_file(environ: Mapping[str, str]) -> Path:
    """Where the file of the run stands."""
    return Path(environ.get(VARIABLE) or project_root() / FILE)


def with_started(environ: Mapping[str, str] | None = None) -> Mapping[str, str]:
    """`environ`, and below it what the last `make up` of this folder said.

    An environment that names a deployment or another router is for another twin, and stays as it is.
    """
    environ = os.environ if environ is None else environ
    if environ.get(CONFIG):
        return environ
    said = _said(started_file(environ))
    if any(environ.get(name) and environ[name] != said.get(name) for name in ADDRESS):
        return environ
    return {**said, **{name: value for name, value in environ.items() if value}}


def load_started(environ: Mapping[str, str] | None = None) -> Deployment:
    """The deployment of the commands of this folder; raises `DeploymentError`."""
    return load_deployment(None, with_started(environ))


def deployment_of_arm(name: str, environ: Mapping[str, str] | None = None) -> Path | None:
    """The deployment file of an arm that was started last among several; None where it was not."""
    file = Path(load_started(environ).paths.run) / ARMS / f"{name}.toml"
    return file if "/" not in name and file.is_file() else None


def chosen_name(environ: Mapping[str, str] | None = None) -> str:
    """The robot that `gemelo use` has chosen for this folder, for where several run; empty if none."""
    try:
        return _use_file(environ).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        return ""


def choose_name(name: str) -> None:
    """Chooses the robot of this folder, or none of them for an empty `name`; raises `OSError`."""
    file = _use_file(None)
    if not name:
        file.unlink(missing_ok=True)
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"{name}\n", encoding="utf-8")


def _use_file(environ: Mapping[str, str] | None) -> Path:
    return started_file(os.environ if environ is None else environ).with_name(USE)


def _said(file: Path) -> dict[str, str]:
    try:
        raw = tomllib.loads(read_text(file))
    except (OSError, NotUtf8, tomllib.TOMLDecodeError):
        return {}
    return {name: value for name, value in raw.items() if isinstance(value, str)}
