"""Links that are dead without a word, a cable out or a host gone, given up by the kernel before the lease ends.

Zenoh misses such a peer after the lease and then says goodbye over TLS. While the socket's buffer is full, that waits
for the link to heal: until then the peer's tokens live on, and a session that comes back is taken for the old one, so
that for seconds its messages arrive under the keys of others (Zenoh 1.10.2). A socket that the kernel has ended waits
for nothing.

Linux also ends the link of a reader that takes nothing for so long, so loopback, where no cable is, stays without the
limit: there a script may think for a second with its images waiting.
"""

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import suppress

import zenoh

from gemelo.libraries.runtime.bus.zenoh_config import LEASE_MS
from gemelo.libraries.runtime.deployment import is_loopback

# Shorter than the lease, which a peer may count from its last sign of life, a quarter of it before the link died.
UNACKNOWLEDGED_MS = LEASE_MS * 3 // 4
OWN_FILES = "/proc/self/fd"


def end_dead_links(session: zenoh.Session) -> zenoh.LinkEventsListener[None] | None:
    """From now on every link of the session ends when what it was sent is not acknowledged in time.

    Keep what is returned; it is None where the system cannot: elsewhere than on Linux.
    """
    if not sys.platform.startswith("linux"):
        return None

    def on_event(event: zenoh.LinkEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT and not is_loopback(host_of(str(event.link.dst))):
            limit(event.link)

    return session.info.declare_link_events_listener(on_event, history=True)


def limit(link: zenoh.Link) -> int:
    """Sets the limit on the socket of the link; returns how many were found: 1, or 0 if it has ended by now."""
    ends = (port_of(str(link.src)), port_of(str(link.dst)))
    found = 0
    for opened in tcp_sockets():
        with suppress(OSError), opened:
            if (opened.getsockname()[1], opened.getpeername()[1]) == ends:
                opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNACKNOWLEDGED_MS)
                found += 1
    return found


def tcp_sockets() -> Iterator[socket.socket]:
    """A copy of every TCP socket of this process, to be closed; Zenoh tells nobody which are its own."""
    try:
        names = os.listdir(OWN_FILES)
    except OSError:  # no descriptor left: the link ends by its lease then
        return
    for name in names:
        with suppress(OSError):
            if not os.readlink(f"{OWN_FILES}/{name}").startswith("socket:"):
                continue
            copy = os.dup(int(name))
            try:
                opened = socket.socket(fileno=copy)
            except OSError:
                os.close(copy)
                continue
            if opened.family in (socket.AF_INET, socket.AF_INET6) and opened.type == socket.SOCK_STREAM:
                yield opened
            else:
                opened.close()


def port_of(locator: str) -> int:
    """Of `tls/10.0.0.1:7447`, with what may stand after `#` or `?`."""
    return int(_address(locator)[1])


def host_of(locator: str) -> str:
    """As `port_of`; an IPv6 address without its brackets."""
    return _address(locator)[0].strip("[]")


def _address(locator: str) -> tuple[str, str]:
    address = locator.partition("/")[2]
    for mark in "#?":
        address = address.partition(mark)[0]
    host, _, port = address.rpartition(":")
    return host, port
