"""The names by which a browser may ask for a page of this machine: a site may point a name of its own at it."""

from __future__ import annotations

import ipaddress
import socket
from urllib.parse import urlsplit


def own_names(host: str, name: str = "") -> frozenset[str]:
    """What this machine is called where somebody opens a page that listens on `host`, with the `name` of the
    deployment; addresses are understood besides. A name that ends with .local is anybody's who answers first, so it
    counts only as that `name`.
    """
    own = {"localhost", host.lower(), name.lower(), socket.gethostname().lower()}
    return frozenset(
        each for each in own if each and (not each.endswith(".local") or each in (name.lower(), host.lower()))
    )


def host_objection(host: str | None, names: frozenset[str]) -> str:
    """Why a request for `host` (a Host header) is refused, empty if it is not: it is for none of `names`, and for no
    address."""
    called = _name_in(f"//{host}") if host else ""
    if called in names or _is_address(called):
        return ""
    known = ", ".join(sorted(names))
    return (
        f'this is not "{called}": open the page by this machine\'s address or as {known}; '
        "another name of its own stands in the deployment file, as [panel] name"
    )


def _name_in(address: str) -> str:
    """The host's name in a URL, empty where there is none."""
    try:
        return (urlsplit(address).hostname or "").lower()
    except ValueError:
        return ""


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
