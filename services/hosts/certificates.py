"""How long the certificates of a site are still valid: those made for it, and those that router and broker show."""

from __future__ import annotations

import os
import socket
import ssl
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from schemas.site import Site
from services.credentials.expiry import WARN_WITHIN, days_left, ending, expiry, not_after
from services.hosts.layout import BROKER, ROUTER, roles
from services.mqtt.secure_folder import CERTIFICATE

HANDSHAKE = 2.0  # [s]


@dataclass(frozen=True)
class Certificate:
    """One certificate of a site."""

    host: str
    name: str  # the role, "router" or "broker"
    expires: float  # [s] UNIX time
    is_new: bool = False


def made(site: Site, folder: Path) -> tuple[Certificate, ...]:
    """The certificates that `gemelo deploy keys` has made below `folder`, as far as they may be read.

    Raises `AccessError` for a file that is none.
    """
    return tuple(Certificate(host, name, expiry(file)) for host, name, file in _wanted(site, folder) if _is_ours(file))


def _wanted(site: Site, folder: Path) -> Iterator[tuple[str, str, Path]]:
    """Host, name and file of every certificate that the site needs."""
    for host in site.hosts:
        keys = folder / host / "keys"
        names = (*roles(site, host), *((ROUTER,) if site.router.host == host else ()))
        yield from ((host, name, keys / f"{name}.pem") for name in names)
        if site.broker.host == host:
            yield host, BROKER, folder / host / "broker" / CERTIFICATE


def _is_ours(file: Path) -> bool:
    """False also for what another user has made."""
    return os.access(file, os.R_OK)


def shown_at(address: str, port: int, certificate: str = "", key: str = "") -> float | None:
    """[s] UNIX time at which the certificate ends that a server shows; None where none is shown in time.

    `certificate` and `key` are files of our own, for a server that asks for them. Nobody is trusted by this.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    try:
        if certificate:
            context.load_cert_chain(certificate, key)
        with (
            socket.create_connection((address, port), HANDSHAKE) as plain,
            context.wrap_socket(plain, server_hostname=address) as link,
        ):
            der = link.getpeercert(binary_form=True)
        return not_after(der) if der else None
    except (OSError, ValueError):
        return None


def days_by_host(certificates: Iterable[Certificate], now: float | None = None) -> dict[str, str]:
    """What is left of the first certificate that ends on each host, as words of a table; `now` in [s] UNIX time."""
    ends: dict[str, float] = {}
    for each in certificates:
        ends[each.host] = min(each.expires, ends.get(each.host, each.expires))
    return {host: in_days(first, now) for host, first in ends.items()}


def in_days(ends: float, now: float | None = None) -> str:
    """What is left until `ends`, as a word of a table; both in [s] UNIX time."""
    left = days_left(ends, now)
    return f"{left:.0f} days" if left > 0.0 else "expired"


def endings(certificates: Iterable[Certificate], now: float | None = None) -> tuple[str, ...]:
    """A sentence for each that ends within a month, or has; `now` in [s] UNIX time."""
    said = ((each, ending(each.expires, now)) for each in certificates)
    return tuple(f"the certificate of {each.name} on {each.host} {text}" for each, text in said if text)


def renewal(site: Site) -> str:
    """What to do about those that end."""
    return (
        f"`gemelo deploy keys {site.name}` renews what ends within {WARN_WITHIN:.0f} days; then give these hosts their "
        "folders again, and restart what runs there"
    )
