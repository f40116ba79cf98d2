"""Opening a serial port, and saying why it cannot be opened."""

from __future__ import annotations

import errno
import grp
import os
from contextlib import suppress
from typing import Protocol

import serial
from serial.tools import list_ports

from gemelo.libraries.runtime.process.unwritten import remedy_of

READ_TIMEOUT = 0.1  # [s] after which the reader looks whether it is to end; chosen: a stop of the process is not felt
WRITE_TIMEOUT = 0.5  # [s] after which a line that takes nothing is given up; chosen: as a heartbeat's silence


class OpenPort(Protocol):
    """An open port; every call raises OSError once it has failed."""

    @property
    def in_waiting(self) -> int: ...

    def read(self, size: int = 1, /) -> bytes:
        """Fewer bytes, perhaps none, after `READ_TIMEOUT`."""

    def write(self, data: bytes, /) -> int | None: ...

    def close(self) -> None: ...


def open_port(port: str, baud: int) -> OpenPort:
    """For us alone; raises OSError or ValueError.

    DTR and RTS stay as the kernel sets them, both raised: on the usual boards one without the other resets the chip.
    """
    line: OpenPort = serial.Serial(port, baud, timeout=READ_TIMEOUT, write_timeout=WRITE_TIMEOUT, exclusive=True)
    return line


def complaint(port: str, error: Exception) -> str:
    """Why `port` is not open, with a remedy."""
    match code := getattr(error, "errno", None):
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return f"there is no serial port {port}: plug the board in, or name it in [serial] device; {_ports()}"
        case errno.EACCES | errno.EPERM:
            group = _group(port)
            return f"no permission for {port}: `sudo usermod -aG {group} $USER`, then log in anew"
        case errno.EBUSY | errno.EAGAIN:
            return f"another program holds {port}: close the serial monitor, flasher or other gateway that uses it"
        case errno.EMFILE | errno.ENFILE:
            return f"{port} cannot be opened ({os.strerror(code)}): {remedy_of(OSError(code, ''))}"
        case _:
            return f"{port} cannot be used as a serial port ({error}): name the board's in [serial] device; {_ports()}"


def _ports() -> str:
    with suppress(OSError):
        found = sorted(port.device for port in list_ports.comports())
        return f"there are {', '.join(found)}" if found else "there is none at all"
    return "which there are cannot be seen"


def _group(port: str) -> str:
    """The group that may use the port; dialout on most systems."""
    try:
        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
