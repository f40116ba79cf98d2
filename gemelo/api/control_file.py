"""The file by which the programs of one user on one host share a hold of control: mode 600, its secret inside."""

from __future__ import annotations

import os
import socket
import stat
from contextlib import suppress
from pathlib import Path

import msgspec

from gemelo.api.errors import Error
from gemelo.schemas.deployment import Deployment
from gemelo.schemas.reasons import because

PATH_VARIABLE = "GEMELO_CONTROL"  # another file than the usual one, for a login that several people share


class SharedHold(msgspec.Struct, frozen=True):
    """What the process that holds control tells the programs of its user."""

    secret: str
    name: str  # of the holder
    host: str
    pid: int  # of the process that holds it


def path_of(robot: str, deployment: Deployment) -> Path:
    """The file for `robot` on the deployment's router; $GEMELO_CONTROL names another."""
    if chosen := os.environ.get(PATH_VARIABLE):
        return Path(chosen)
    state = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    return state / "gemelo" / f"control-{robot}-{deployment.router.host}-{deployment.router.port}.json"


def write(path: Path, secret: str, name: str) -> None:
    """Replaces the file at once as a whole; raises `Error` where it cannot be written."""
    hold = SharedHold(secret, name, socket.gethostname(), os.getpid())
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        fresh.unlink(missing_ok=True)
        descriptor = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(msgspec.json.encode(hold))
        fresh.replace(path)
    except OSError as error:
        why = {"error": str(error.strerror), "variable": PATH_VARIABLE}
        raise Error(because("client.control_file.unwritable", path=str(path), **why)) from error


def read(path: Path) -> SharedHold | None:
    """The hold of a living process of this host and user; None where there is none.

    Raises `Error` for a file that others can read or have written: its secret is none.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW)
        with os.fdopen(descriptor, "rb") as file:
            about = os.fstat(descriptor)
            content = file.read(4096)
    except OSError:
        return None
    if about.st_uid != os.getuid() or stat.S_IMODE(about.st_mode) & 0o077:
        mode = stat.S_IMODE(about.st_mode)
        raise Error(because("client.control_file.readable", path=str(path), user=about.st_uid, mode=f"{mode:o}"))
    try:
        hold = msgspec.json.decode(content, type=SharedHold)
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None
    return hold if hold.host == socket.gethostname() and _lives(hold.pid) else None


def remove(path: Path, secret: str) -> None:
    """Removes the file, unless another hold stands in it by now."""
    hold = read(path)
    if hold is not None and hold.secret == secret:
        with suppress(OSError):  # a file that stays counts as long as its process lives
            path.unlink()


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except PermissionError:
        return True
    except (OSError, OverflowError):
        return False
    return pid > 0
