"""Zenoh's settings, all named: its defaults wait ten seconds and listen everywhere."""

from __future__ import annotations

import json

import zenoh

from gemelo.libraries.runtime.bus.wire import LARGEST
from gemelo.schemas.deployment import RouterSection

LEASE_MS = 1000  # a frozen or unplugged peer is seen after this
OPEN_TIMEOUT_MS = 1000  # a router that takes a connection but does not answer (frozen) is tried anew after this
# A put of EVERY waits this long for a stalled reader, then the link is dropped. Not as long as the lease: where both
# end a link in the same instant, the session sometimes never comes back (seen with Zenoh 1.10.2).
LONGEST_BLOCK_US = 500_000
MAX_MESSAGE_BYTES = LARGEST + 1024 * 1024  # with key, encoding and attachment


def client_config(router: RouterSection, robot: str = "") -> zenoh.Config:
    """A client of the router that sees only `robot`'s keys, all if it is empty; reconnects within half a second."""
    namespace = {"namespace": robot} if robot else {}
    identity = {
        "enable_mtls": True,
        "root_ca_certificate": router.ca,
        "connect_certificate": router.certificate,
        "connect_private_key": router.key,
        "verify_name_on_connect": True,
    }
    return _config(
        settings(identity if router.tls else {}),
        mode="client",
        **namespace,
        connect={
            "endpoints": [endpoint(router.host, router.port, router.tls)],
            "timeout_ms": 2000,
            "exit_on_failure": True,
            "retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
        },
    )


def router_config(host: str, port: int) -> zenoh.Config:
    """A router that listens on one address, open to all who reach it."""
    return _config(settings({}), **_listening(endpoint(host, port, is_tls=False)))


def locked_router(
    host: str, port: int, ca: str, certificate: str, key: str, access_control: dict[str, object]
) -> dict[str, object]:
    """The settings of a router, ours or zenohd, that asks every session for a certificate and for permission."""
    identity = {
        "enable_mtls": True,
        "root_ca_certificate": ca,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "close_link_on_expiration": True,
    }
    listening = _listening(endpoint(host, port, is_tls=True))
    return settings(identity) | listening | {"access_control": access_control}


def _listening(address: str) -> dict[str, object]:
    listen = {"endpoints": [address], "timeout_ms": 0, "exit_on_failure": True}
    return {"mode": "router", "listen": listen, "adminspace": {"enabled": False}}


def endpoint(host: str, port: int, is_tls: bool) -> str:
    """Zenoh's locator of an address."""
    return f"{'tls' if is_tls else 'tcp'}/{f'[{host}]' if ':' in host else host}:{port}"


def settings(tls: dict[str, object]) -> dict[str, object]:
    """What routers and sessions have in common; `tls` is Zenoh's own section, empty without."""
    transport = {
        "shared_memory": {"enabled": False},  # a process that is killed would leave its segments behind
        "unicast": {"open_timeout": OPEN_TIMEOUT_MS, "accept_timeout": OPEN_TIMEOUT_MS},
        "link": {
            "tx": {
                "lease": LEASE_MS,
                "keep_alive": 4,
                "queue": {"congestion_control": {"block": {"wait_before_close": LONGEST_BLOCK_US}}},
            },
            "rx": {"max_message_size": MAX_MESSAGE_BYTES},
            **({"tls": tls} if tls else {}),
        },
    }
    return {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "timestamping": {"enabled": True},
        "transport": transport,
    }


def _config(common: dict[str, object], **more: object) -> zenoh.Config:
    return zenoh.Config.from_json5(json.dumps(common | more))
