"""A client of process-compose over the Unix socket that it serves: the state of its processes."""

from __future__ import annotations

import http.client
import socket
from pathlib import Path
from typing import TypeVar
from urllib.parse import quote

import msgspec

TIMEOUT = 5.0  # [s]
T = TypeVar("T")


class ComposeError(Exception):
    """process-compose does not answer, or not as expected."""


class ProcessState(msgspec.Struct, frozen=True, kw_only=True):
    """The state of one process as process-compose reports it."""

    name: str
    status: str = ""
    pid: int = 0
    is_running: bool = False
    is_ready: str = ""  # "Ready", "Not Ready", "-"
    restarts: int = 0
    exit_code: int = 0


class _ProcessStates(msgspec.Struct, frozen=True, kw_only=True):
    data: tuple[ProcessState, ...] = ()


class Compose:
    """A running process-compose, addressed by its socket file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def process(self, name: str) -> ProcessState:
        """The state of the process `name`; raises `ComposeError` if process-compose does not answer."""
        return self._ask(f"/process/{quote(name)}", ProcessState)

    def processes(self) -> tuple[ProcessState, ...]:
        """The states of all processes; raises `ComposeError` if process-compose does not answer."""
        return self._ask("/processes", _ProcessStates).data

    def _ask(self, path: str, kind: type[T]) -> T:
        connection = _UnixConnection(self._path)
        try:
            connection.request("GET", path)
            answer = connection.getresponse().read()
            return msgspec.json.decode(answer, type=kind)
        except (OSError, http.client.HTTPException) as error:
            raise ComposeError(f"process-compose does not answer on {self._path}: {error}") from error
        except msgspec.DecodeError as error:
            raise ComposeError(f"process-compose answered {path} with {answer[:200]!r}: {error}") from error
        finally:
            connection.close()


class _UnixConnection(http.client.HTTPConnection):
    def __init__(self, path: Path) -> None:
        super().__init__("localhost", timeout=TIMEOUT)
        self._path = path

    def connect(self) -> None:
        self.sock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.sock.settimeout(TIMEOUT)
        self.sock.connect(str(self._path))
