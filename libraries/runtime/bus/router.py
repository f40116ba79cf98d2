"""Zenoh's router in this process: its configuration, where it listens, and who is asked for a certificate."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import zenoh

from gemelo.libraries.runtime.bus.dead_links import end_dead_links
from gemelo.libraries.runtime.bus.zenoh_config import router_config
from gemelo.libraries.runtime.deployment import DeploymentError
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.reasons import because

_LOCATOR = re.compile(r"(tcp|tls)/(.+):(\d+)")
# Zenoh's own threads of the router, 2 without this. One that brings an answer to a client that does not read waits for
# up to LONGEST_BLOCK_US, and with it every link that the same thread serves: chosen as one for each process and script.
RECEIVING_THREADS = 16


class RouterFailed(Exception):
    """Zenoh does not open a router; the message is its own."""


class RouterSetup(NamedTuple):
    """How a router is to run."""

    config: zenoh.Config
    listening: tuple[str, int]  # host and port
    is_locked: bool  # it asks everybody for a certificate and for permission

    @property
    def certificate(self) -> str:
        """The file of the certificate that it shows; empty without TLS."""
        return str(json.loads(self.config.get_json("transport/link/tls/listen_certificate")) or "")


def router_setup(section: RouterSection) -> RouterSetup:
    """By the file `configuration` where there is one, else an open router; raises `DeploymentError`."""
    if not section.configuration:
        if section.tls:
            raise DeploymentError(because("router.tls_alone"))
        return RouterSetup(router_config(*section.listening), section.listening, False)
    try:
        config = zenoh.Config.from_file(section.configuration)
        (locator,) = json.loads(config.get_json("listen/endpoints"))
        protocol, host, port = _LOCATOR.fullmatch(locator).groups()  # type: ignore[union-attr]
    except (zenoh.ZError, ValueError, AttributeError, TypeError) as error:
        why = because("router.configuration", file=section.configuration, error=str(error))
        raise DeploymentError(why) from error
    is_asked = json.loads(config.get_json("transport/link/tls/enable_mtls")) is True
    permits = json.loads(config.get_json("access_control"))
    is_locked = is_asked and permits["enabled"] and permits["default_permission"] == "deny"
    return RouterSetup(config, (host.strip("[]"), int(port)), protocol == "tls" and is_locked)


@contextmanager
def open_router(setup: RouterSetup) -> Iterator[None]:
    """Routes until the end of the block, and ends links that are dead; raises `RouterFailed`."""
    os.environ.setdefault("ZENOH_RUNTIME", f"(rx: (worker_threads: {RECEIVING_THREADS}))")
    try:
        session = zenoh.open(setup.config)
    except zenoh.ZError as error:
        raise RouterFailed(str(error)) from error
    with session:
        watch = end_dead_links(session)
        yield
        del watch
