"""Unique node names: the second of two nodes with one name does not start."""

from __future__ import annotations

import os
import re
import socket
import time
from dataclasses import dataclass

from services.runtime.bus.interface import Bus
from services.runtime.errors import NodeNameTaken

NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")
STALE_AFTER = 1.5  # [s] within which the token of a frozen process vanishes (the lease is 1 s)
ALIVE = "@alive"


@dataclass(frozen=True)
class Identity:
    """The identity of this process among those with the same `name`; the one that started first keeps the name."""

    name: str
    started: int  # [ns] UNIX
    host: str
    pid: int

    @property
    def key(self) -> str:
        return f"@id/{self.name}/{self.started:020d}.{self.pid}.{self.host}"


def identify(name: str) -> Identity:
    """Raises `ValueError` for a name that cannot be part of a key."""
    if not NAME.fullmatch(name):
        raise ValueError(f'node name "{name}": lower-case letters, digits, "_" and "-" only')
    host = re.sub(r"[^A-Za-z0-9_-]", "-", socket.gethostname())
    return Identity(name, time.time_ns(), host, os.getpid())


def claim(bus: Bus, identity: Identity) -> None:
    """Declares the name; raises `NodeNameTaken` where another living node has it."""
    _wait_until_alone(bus, identity, "")
    token = bus.declare_alive(identity.key)
    try:
        _wait_until_alone(bus, identity, identity.key)
    except NodeNameTaken:
        token.close()
        raise
    bus.declare_alive(f"{ALIVE}/{identity.name}")


def alive(bus: Bus) -> set[str]:
    """The names of all living nodes of the robot."""
    return {key.removeprefix(f"{ALIVE}/") for key in bus.alive(f"{ALIVE}/*")}


def _bearers(bus: Bus, identity: Identity) -> set[str]:
    return bus.alive(f"@id/{identity.name}/*") - {identity.key}


def _wait_until_alone(bus: Bus, identity: Identity, gives_way_before: str) -> None:
    """Raises at once for a bearer whose key is less than `gives_way_before`, else where one stays too long.

    Of two that start together the younger gives way; where it did not see the older in time, the older does.
    """
    give_up = time.monotonic() + STALE_AFTER
    while bearers := _bearers(bus, identity):
        if min(bearers) < gives_way_before or time.monotonic() > give_up:
            raise NodeNameTaken(_taken(identity.name, min(bearers)))
        time.sleep(0.1)


def _taken(name: str, key: str) -> str:
    _, pid, host = key.rsplit("/", 1)[-1].split(".", 2)
    return f'another node named "{name}" is alive (process {pid} on {host}): stop it, or give this one another name'
