"""Addresses of routers, as Zenoh writes one, with the arm that is meant of several: tcp/lab:7447/rm1."""

from __future__ import annotations

from gemelo.api.errors import BadArgument
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.reasons import because

PLAIN, LOCKED = "tcp/", "tls/"
PORT = 7447  # standard: Zenoh's


def is_address(robot: str) -> bool:
    """True for the address of a router, as tcp/lab:7447."""
    return robot.startswith((PLAIN, LOCKED))


def parsed(address: str) -> tuple[RouterSection, str]:
    """The router of an address, and the arm that it names; raises `BadArgument`."""
    if address.startswith(LOCKED):
        raise BadArgument(because("address.locked", address=address))
    place, _, name = address.removeprefix(PLAIN).partition("/")
    host, _, port = place.rpartition(":") if ":" in place else (place, "", str(PORT))
    if not host or not port.isdecimal() or not 0 < int(port) < 65536 or "/" in name:
        raise BadArgument(because("address.none", address=address))
    return RouterSection(host=host.strip("[]"), port=int(port)), name
