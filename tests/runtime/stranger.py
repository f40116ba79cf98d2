"""A laptop at the router's port, as a process of its own.

`python -m tests.runtime.stranger garbage HOST PORT RATE [SOURCE]` connects so often a second and sends what is no TLS,
until it is ended. `... hold HOST PORT COUNT SOURCE` opens so many, and prints how many it got. `... join` opens a
session as the environment says, again and again, and prints how long each took in [ms], or -1 if it did not open.
"""

from __future__ import annotations

import socket
import sys
import time

import zenoh

from gemelo.libraries.runtime.bus.zenoh_config import client_config
from gemelo.libraries.runtime.deployment import load_deployment

GARBAGE = b"GET / HTTP/1.1\r\n\r\n"
JOIN_PERIOD = 0.3  # [s]


def garbage(host: str, port: int, rate: float, source: str = "") -> None:
    kept: list[socket.socket] = []
    while True:
        try:
            opened = socket.create_connection((host, port), 0.3, (source, 0) if source else None)
            opened.settimeout(0.3)
            opened.send(GARBAGE)
            kept.append(opened)
        except OSError:
            pass
        for each in kept[:-50]:
            each.close()
        del kept[:-50]
        print("sent", flush=True)
        time.sleep(1.0 / rate)


def hold(host: str, port: int, count: int, source: str) -> None:
    """Opens connections, prints how many were taken, and keeps them."""
    kept: list[socket.socket] = []
    refused = 0
    while len(kept) + refused < count:
        try:
            kept.append(socket.create_connection((host, port), 0.3, (source, 0)))
        except OSError:
            refused += 1
    print(len(kept), flush=True)


def join() -> None:
    config = client_config(load_deployment().router, "rm1")
    while True:
        began = time.monotonic()
        try:
            zenoh.open(config).close()
            print(f"{(time.monotonic() - began) * 1e3:.0f}", flush=True)
        except zenoh.ZError:
            print("-1", flush=True)
        time.sleep(JOIN_PERIOD)


def main(what: str, *options: str) -> None:
    if what == "garbage":
        host, port, rate, *source = options
        garbage(host, int(port), float(rate), *source)
    elif what == "hold":
        host, port, count, *source = options
        hold(host, int(port), int(count), *source)
    else:
        join()


if __name__ == "__main__":
    main(*sys.argv[1:])
