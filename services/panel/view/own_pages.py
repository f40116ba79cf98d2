"""Only the page's own browsers are served: else any web site that somebody looks at could move the arm.

A browser lets a page of any site connect to this machine, and tells whose page it is only by the Origin header.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio import server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from services.panel.view.own_pace import PacedConnection

Handler = Callable[[ServerConnection, Request], Response | None]


@contextmanager
def own_pages_only(host: str) -> Iterator[None]:
    """A server that viser starts meanwhile refuses the pages of other sites, and sends none more than it reads; `host`
    is the name that it listens on.

    viser has no option for either, so the function that opens its port is wrapped.
    """
    serve, names = server.serve, own_names(host)

    def guarded(*arguments: Any, process_request: Handler | None = None, **options: Any) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            reason = objection(request.headers.get("Host"), request.headers.get("Origin"), names)
            if reason:
                return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
            return None if process_request is None else process_request(connection, request)

        return serve(*arguments, process_request=answer, create_connection=PacedConnection, **options)

    server.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


def own_names(host: str) -> frozenset[str]:
    """What this machine is called where somebody opens the page; addresses are understood besides."""
    name = socket.gethostname().lower()
    return frozenset({"localhost", host.lower(), name, f"{name}.local"})


def objection(host: str | None, origin: str | None, names: frozenset[str]) -> str:
    """Why a request for `host` (a Host header) from a page of `origin` (an Origin header) is refused; else empty."""
    called = _name_of(f"//{host}") if host else ""
    if not (called in names or _is_address(called)):  # a site's name may point at this machine
        known = ", ".join(sorted(names))
        return f'this is not "{called}": open the page by this machine\'s address or as {known}'
    if origin is not None and urlsplit(origin).netloc.lower() != (host or "").lower():
        return f"a page of {origin} may not lead the arm: open http://{host}"
    return ""


def _name_of(address: str) -> str:
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
