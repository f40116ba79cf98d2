"""Remaining validity of a site's certificates: those made for it, and those that router and broker present."""

from __future__ import annotations

import os
import socket
import ssl
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from gemelo.libraries.credentials.authority import FORMER
from gemelo.libraries.credentials.expiry import WARN_WITHIN, days_left, expiry, not_after
from gemelo.libraries.mqtt.secure_folder import CERTIFICATE
from gemelo.schemas.reasons import Reason, because
from gemelo.schemas.site import Site
from gemelo.tools.hosts.layout import BROKER, ROUTER, roles

HANDSHAKE = 2.0  # [s]
AUTHORITY_FOLDER = "authority"  # below the site's; it stays where it was made
SAME = 1.0  # [s] between the ends of two certificates that are one


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


def days_by_host(certificates: Iterable[Certificate], now: float | None = None) -> dict[str, Reason]:
    """What is left of the first certificate that ends on each host, for a table; `now` in [s] UNIX time."""
    ends: dict[str, float] = {}
    for each in certificates:
        ends[each.host] = min(each.expires, ends.get(each.host, each.expires))
    return {host: in_days(first, now) for host, first in ends.items()}


def in_days(ends: float, now: float | None = None) -> Reason:
    """What is left until `ends`, for a table; both in [s] UNIX time."""
    left = days_left(ends, now)
    return because("site.days.left", days=left) if left > 0.0 else because("site.days.expired")


def endings(certificates: Iterable[Certificate], now: float | None = None) -> tuple[Reason, ...]:
    """Each that ends within a month, or has; `now` in [s] UNIX time."""
    left = ((each, days_left(each.expires, now)) for each in certificates)
    return tuple(
        because("site.certificate.ends", name=each.name, host=each.host, days=days)
        if days > 0.0
        else because("site.certificate.expired", name=each.name, host=each.host)
        for each, days in left
        if days <= WARN_WITHIN
    )


def renewal(site: Site) -> Reason:
    """What to do about those that end."""
    return because("site.certificate.renew", site=site.name, days=WARN_WITHIN)


def authority_told(site: Site, folder: Path, now: float | None = None) -> tuple[Reason, ...]:
    """When the authority ends whose keys are below `folder`, and what to do about it; `now` in [s] UNIX time."""
    file = folder / AUTHORITY_FOLDER / "ca.pem"
    if not _is_ours(file):
        return ()
    ends = expiry(file)
    date = time.strftime("%Y-%m-%d", time.gmtime(ends))
    said = [because("site.authority.ends", in_days(ends, now), date=date)]
    if days_left(ends, now) < site.certificate_days + WARN_WITHIN:
        said.append(because("site.authority.renew", days=site.certificate_days, site=site.name))
    if file.with_name(FORMER).exists():
        said.append(because("site.authority.former", site=site.name))
    return tuple(said)


def older(running: Iterable[Certificate], made_here: Iterable[Certificate]) -> tuple[Reason, ...]:
    """Each that runs with another certificate than the newest that was made for it."""
    newest = {(each.host, each.name): each.expires for each in made_here}
    return tuple(
        because("site.certificate.older", name=each.name, host=each.host)
        for each in running
        if newest.get((each.host, each.name), each.expires) - each.expires > SAME
    )
