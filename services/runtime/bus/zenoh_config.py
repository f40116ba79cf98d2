"""Zenoh's settings, all named: its defaults wait ten seconds and listen everywhere."""

from __future__ import annotations

import json

import zenoh

LEASE_MS = 1000  # a frozen or unplugged peer is seen after this
OPEN_TIMEOUT_MS = 1000  # a router that takes a connection but does not answer (frozen) is tried anew after this
# A put of EVERY waits this long for a stalled reader, then the link is dropped. Not as long as the lease: where both
# end a link in the same instant, the session sometimes never comes back (seen with Zenoh 1.10.2).
LONGEST_BLOCK_US = 500_000
MAX_MESSAGE_BYTES = 16 * 1024 * 1024


def client_config(host: str, port: int, robot: str = "") -> zenoh.Config:
    """A client of the router that sees only `robot`'s keys, all if it is empty; reconnects within half a second."""
    namespace = {"namespace": robot} if robot else {}
    return _config(
        mode="client",
        **namespace,
        connect={
            "endpoints": [f"tcp/{host}:{port}"],
            "timeout_ms": 2000,
            "exit_on_failure": True,
            "retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
        },
    )


def router_config(host: str, port: int) -> zenoh.Config:
    """A router that listens on one address."""
    return _config(
        mode="router",
        listen={"endpoints": [f"tcp/{host}:{port}"], "timeout_ms": 0, "exit_on_failure": True},
    )


def _config(**settings: object) -> zenoh.Config:
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
        },
    }
    common = {
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "timestamping": {"enabled": True},
        "transport": transport,
    }
    return zenoh.Config.from_json5(json.dumps(common | settings))
