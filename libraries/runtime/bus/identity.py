"""Unique node names: the second of two nodes with one name does not start.

A node's tokens stand in its principal's branch (branches.py). A token that is in nobody's branch, or has a wildcard in
its key, would stand for the tokens of others: whoever reads tokens ignores it, and reports it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

from gemelo.libraries.runtime.bus.branches import LOCAL, NAME, PRINCIPAL, address_of, principal_of
from gemelo.libraries.runtime.bus.interface import Bus
from gemelo.libraries.runtime.clock import SYSTEM, Clock
from gemelo.libraries.runtime.errors import NodeNameTaken
from gemelo.schemas.reasons import Reason, because

STALE_AFTER = 1.5  # [s] within which the token of a frozen process vanishes (the lease is 1 s)
ALIVE, IDENTITY = "@alive", "@id"
EACH = f"{IDENTITY}/*/*/*"  # the pattern of the tokens of all nodes
INSTANCE = r"[0-9]{20}\.[0-9]{1,10}\.[A-Za-z0-9_-]{1,64}"  # <start [ns]>.<pid>.<host>
TOKEN = re.compile(rf"{IDENTITY}/({PRINCIPAL.pattern})/({NAME.pattern})/({INSTANCE})")
LIFE = re.compile(rf"{ALIVE}/({PRINCIPAL.pattern})/({NAME.pattern})")

Warn = Callable[[str], object]


@dataclass(frozen=True)
class Identity:
    """The identity of this process among those with the same `name`; the one that started first keeps the name."""

    name: str
    started: int  # [ns] UNIX
    host: str
    pid: int
    principal: str = LOCAL

    @property
    def key(self) -> str:
        return f"{IDENTITY}/{self.principal}/{self.name}/{self.instance}"

    @property
    def instance(self) -> str:
        """Which of the processes that bear the name; of two the one that started later has the greater."""
        return f"{self.started:020d}.{self.pid}.{self.host}"

    @property
    def address(self) -> str:
        """By which others ask this node (branches.py)."""
        return address_of(self.principal, self.name) or self.name


def identify(name: str, common_name: str = "", clock: Clock = SYSTEM) -> Identity:
    """`common_name` is that of the certificate that is shown. Raises `ValueError` for a name that no key may hold."""
    if not NAME.fullmatch(name):
        raise ValueError(f'node name "{name}": lower-case letters, digits, "_" and "-" only')
    host = re.sub(r"[^A-Za-z0-9_-]", "-", clock.host())[:64]
    return Identity(name, clock.unix(), host, clock.process(), principal_of(name, common_name))


def claim(bus: Bus, identity: Identity, warn: Warn = lambda text: None) -> None:
    """Declares the name; raises `NodeNameTaken` where another living node has it, or only a service may have it."""
    if address_of(identity.principal, identity.name) is None:
        why = because("node.role", node=identity.name, common_name=identity.principal, certificate=bus.certificate)
        raise NodeNameTaken(why)
    _wait_until_alone(bus, identity, "", warn)
    token = bus.declare_alive(identity.key)
    try:
        _wait_until_alone(bus, identity, identity.key, warn)
    except NodeNameTaken:
        token.close()
        raise
    bus.declare_alive(f"{ALIVE}/{identity.principal}/{identity.name}")


def alive(bus: Bus, warn: Warn = lambda text: None) -> set[str]:
    """The addresses of all living nodes of the robot (branches.py)."""
    return set(addresses(bus.alive(f"{ALIVE}/*/*"), warn))


def addresses(keys: Iterable[str], warn: Warn = lambda text: None) -> Iterator[str]:
    """The addresses of the nodes that these tokens say alive."""
    for key in keys:
        found = LIFE.fullmatch(key)
        address = address_of(found[1], found[2]) if found else None
        if address is None:
            warn(_ignored(key))
        else:
            yield address


def twins(bus: Bus) -> dict[str, tuple[str, ...]]:
    """The processes of each address that several living nodes bear, as `process 12 on host`, the oldest first."""
    borne: dict[str, list[str]] = {}
    for key in sorted(bus.alive(EACH)):
        found = TOKEN.fullmatch(key)
        address = address_of(found[1], found[2]) if found else None
        if address is not None:
            pid, host = instance_of(key)
            borne.setdefault(address, []).append(f"process {pid} on {host}")
    return {address: tuple(processes) for address, processes in borne.items() if len(processes) > 1}


def is_token(key: str) -> bool:
    """True if `key` is what a node declares of itself; others may stand for many."""
    return TOKEN.fullmatch(key) is not None


def bearers(identity: Identity) -> str:
    """The pattern of the tokens of all nodes with this name."""
    return bearers_of(identity.principal, identity.name)


def bearers_of(principal: str, name: str) -> str:
    """The pattern of the tokens of all nodes with this name."""
    return f"{IDENTITY}/{principal}/{name}/*"


def _bearers(bus: Bus, identity: Identity, warn: Warn) -> set[str]:
    found = bus.alive(bearers(identity)) - {identity.key}
    for key in found:
        if not is_token(key):
            warn(_ignored(key))
    return {key for key in found if is_token(key)}


def _wait_until_alone(bus: Bus, identity: Identity, gives_way_before: str, warn: Warn) -> None:
    """Raises at once for a bearer whose key is less than `gives_way_before`, else where one stays too long.

    Of two that start together the younger gives way; where it did not see the older in time, the older does.
    """
    give_up = bus.clock.monotonic() + STALE_AFTER
    while bearers := _bearers(bus, identity, warn):
        if min(bearers) < gives_way_before or bus.clock.monotonic() > give_up:
            raise NodeNameTaken(_taken(identity.name, min(bearers)))
        bus.clock.sleep(0.1)


def _taken(name: str, key: str) -> Reason:
    """The reason for a name whose bearer has the token `key`."""
    pid, host = instance_of(key)
    return because("node.taken", node=name, process=pid, host=host)


def instance_of(key: str) -> tuple[str, str]:
    """The process and the host of the node with the token `key`."""
    _, pid, host = key.rsplit("/", 1)[-1].split(".", 2)
    return pid, host


def _ignored(key: str) -> str:
    return (
        f"ignored the liveliness token {key[:120]!r}, which is no node's: a wildcard, or a name that its certificate "
        "may not bear"
    )
