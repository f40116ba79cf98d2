"""Opening a serial port, and saying why it cannot be opened."""

from __future__ import annotations

import errno
import grp
import os
from contextlib import suppress
from typing import Protocol

import serial
from serial.tools import list_ports

from gemelo.schemas.reasons import Reason, Remedy, because, remedy

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


def complaint(port: str, error: Exception) -> Reason:
    """Why `port` is not open, with a remedy."""
    match code := getattr(error, "errno", None):
        case errno.ENOENT | errno.ENODEV | errno.ENXIO:
            return because("link.port.absent", _ports(), port=port)
        case errno.EACCES | errno.EPERM:
            group = _group(port)
            return because("link.port.forbidden", port=port, group=group)
        case errno.EBUSY | errno.EAGAIN:
            return because("link.port.held", port=port)
        case errno.EMFILE | errno.ENFILE:
            return because("link.port.no_descriptor", port=port, error=os.strerror(code))
        case _:
            return because("link.port.unusable", _ports(), port=port, error=str(error))


def _ports() -> Remedy:
    """The ports that there are."""
    with suppress(OSError):
        found = tuple(sorted(port.device for port in list_ports.comports()))
        return remedy("other_ports", ports=found) if found else remedy("no_ports")
    return remedy("ports_unseen")


def _group(port: str) -> str:
    """The group that may use the port; dialout on most systems."""
    try:
        return grp.getgrgid(os.stat(port).st_gid).gr_name
    except (OSError, KeyError):
        return "dialout"
