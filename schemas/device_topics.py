"""The MQTT topics of a device, as firmware/PROTOCOL.md names them: who writes which."""

from __future__ import annotations

PREFIX = "gemelo/v1"
TO_DEVICE = ("traj", "cmd", "hb", "sync", "config", "inject", "update")  # only a gateway writes them
FROM_DEVICE = (
    "status", "traj/ack", "cmd/ack", "sync/r", "state", "event", "config/ack", "sensors", "shaft",
    "update/ack",
)  # fmt: skip


def topic(device: str, kind: str) -> str:
    """`gemelo/v1/<device>/<kind>`."""
    return f"{PREFIX}/{device}/{kind}"
