"""A router that asks for certificates and permission, the certificates, and raw sessions of any role."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zenoh

from gemelo.libraries.credentials.authority import Authority
from gemelo.libraries.runtime.bus.zenoh_config import client_config, locked_router
from gemelo.libraries.runtime.permissions import access_control
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.roles import ROLES
from tests.runtime.support import RouterProcess

HOST = "127.0.0.1"


class Lock:
    """A folder with an authority, the router's certificate and one for each role."""

    def __init__(self, folder: Path, roles: Iterable[str] = tuple(role.name for role in ROLES), days: int = 1) -> None:
        folder.mkdir(exist_ok=True)
        self.folder, self.days = folder, days
        self.authority = Authority(folder / "ca.pem", folder / "ca.key")
        self.authority.sign([HOST], *self.files("router"), days)
        self.people: dict[str, list[str]] = {}  # by role, the common names `<role>.<host>`
        for name in roles:
            self.issue(name)
            if "." in name:
                self.people.setdefault(name.partition(".")[0], []).append(name)

    def issue(self, name: str) -> None:
        self.authority.sign_client(name, *self.files(name), self.days)

    def files(self, name: str) -> tuple[Path, Path]:
        return self.folder / f"{name}.pem", self.folder / f"{name}.key"

    def write_router(self, port: int, robots: Iterable[str] = ("rm1",), asks: bool = True) -> Path:
        """The configuration of a router; one that does not ask has TLS as any web server, and takes everybody."""
        certificate, key = map(str, self.files("router"))
        ca = str(self.folder / "ca.pem")
        file = self.folder / "router.json5"
        settings: dict[str, Any] = locked_router(HOST, port, ca, certificate, key, access_control(robots, self.people))
        settings["transport"]["link"]["tls"]["enable_mtls"] = asks
        file.write_text(json.dumps(settings | ({} if asks else {"access_control": {"enabled": False}})))
        return file

    def section(self, name: str, port: int) -> RouterSection:
        """How a session with the certificate `name` joins."""
        certificate, key = map(str, self.files(name))
        return RouterSection(port=port, tls=True, ca=str(self.folder / "ca.pem"), certificate=certificate, key=key)


class LockedRouter(RouterProcess):
    """`gemelo-router` with the configuration of a `Lock`."""

    def __init__(self, folder: Path, lock: Lock, asks: bool = True) -> None:
        self.lock, self._asks = lock, asks
        super().__init__(folder)

    def start(self) -> None:
        self.environ["GEMELO_ROUTER_CONFIGURATION"] = str(self.lock.write_router(self.port, asks=self._asks))
        super().start()

    def section(self, name: str) -> RouterSection:
        return self.lock.section(name, self.port)


@contextmanager
def sessions(sections: dict[str, RouterSection], robot: str = "rm1") -> Iterator[dict[str, zenoh.Session]]:
    """One session of a robot for each, as any program may open it that does not keep to our own rules."""
    opened = {name: zenoh.open(client_config(section, robot)) for name, section in sections.items()}
    yield opened
    for session in opened.values():
        session.close()
