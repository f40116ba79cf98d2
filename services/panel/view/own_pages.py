"""Only the page's own browsers are served: else any web site that somebody looks at could move the arm.

A browser lets a page of any site connect to this machine, and tells whose page it is only by the Origin header; and it
lets one show this page within its own, unless each answer says that it may not.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

import viser
from websockets.asyncio import server
from websockets.asyncio.server import ServerConnection
from websockets.http11 import Request, Response

from gemelo.libraries.runtime.process.own_names import host_objection, own_names
from gemelo.services.panel.view.broken_connections import BrokenConnections
from gemelo.services.panel.view.own_pace import PacedConnection

Handler = Callable[[ServerConnection, Request], Response | None]


NOT_WITHIN_OTHERS = {"Content-Security-Policy": "frame-ancestors 'none'", "X-Frame-Options": "DENY"}


class OwnServer(viser.ViserServer):
    """viser's server without the tunnel through a server of others that any browser may ask it for."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """None: the page is this machine's alone."""
        return None

    def disconnect_share_url(self) -> None:
        """There is nothing to end."""


@contextmanager
def own_pages_only(host: str, broken: BrokenConnections, name: str = "") -> Iterator[None]:
    """A server that viser starts meanwhile refuses the pages of other sites, sends none more than it reads, and may not
    be shown within another page; `host` is what it listens on, `name` by what other machines may call it besides.

    What is no browser's is counted in `broken`. viser has no option for these, so the function that opens its port is
    wrapped.
    """
    serve, names = server.serve, own_names(host, name)

    def guarded(handler: Any, *arguments: Any, process_request: Handler | None = None, **options: Any) -> Any:
        def answer(connection: ServerConnection, request: Request) -> Response | None:
            reason = objection(request.headers.get("Host"), request.headers.get("Origin"), names)
            if reason:
                return connection.respond(HTTPStatus.FORBIDDEN, f"{reason}\n")
            return None if process_request is None else process_request(connection, request)

        def mark(connection: ServerConnection, request: Request, response: Response) -> None:
            response.headers.update(NOT_WITHIN_OTHERS)

        asyncio.get_running_loop().set_exception_handler(broken.on_lost_exception)
        options |= {"process_request": answer, "process_response": mark, "create_connection": PacedConnection}
        return serve(broken.guarded(handler), *arguments, logger=broken.logger, **options)

    server.serve = guarded  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        server.serve = serve  # type: ignore[misc]


def objection(host: str | None, origin: str | None, names: frozenset[str]) -> str:
    """Why a request for `host` (a Host header) from a page of `origin` (an Origin header) is refused; else empty."""
    if reason := host_objection(host, names):
        return reason
    if origin is not None and urlsplit(origin).netloc.lower() != (host or "").lower():
        return f"a page of {origin} may not lead the arm: open http://{host}"
    return ""
