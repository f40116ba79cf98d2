"""The interface of every wire to the device."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple, Protocol

from gemelo.schemas.reasons import Reason


class Kind(StrEnum):
    """The channels of firmware/PROTOCOL.md; the values are the last part of the MQTT topics."""

    STATUS = "status"
    TRAJ = "traj"
    TRAJ_ACK = "traj/ack"
    CMD = "cmd"
    CMD_ACK = "cmd/ack"
    HB = "hb"
    SYNC = "sync"
    SYNC_R = "sync/r"
    STATE = "state"
    EVENT = "event"
    CONFIG = "config"
    CONFIG_ACK = "config/ack"
    SENSORS = "sensors"
    INJECT = "inject"
    SHAFT = "shaft"


TO_DEVICE = (Kind.TRAJ, Kind.CMD, Kind.HB, Kind.SYNC, Kind.CONFIG, Kind.INJECT)
FROM_DEVICE = tuple(kind for kind in Kind if kind not in TO_DEVICE)


class Received(NamedTuple):
    """One payload as it came, and when it came."""

    kind: Kind
    payload: bytes
    retained: bool
    arrival: int  # [ns] monotonic clock


class Link(Protocol):
    """A wire: sends at once or not at all, keeps what arrives until it is taken."""

    @property
    def connected(self) -> bool: ...

    @property
    def reason(self) -> Reason | None:
        """Why it is not connected, with what would do; None while it is."""

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        """False: not connected, or no room, which an urgent payload needs none of, and nothing was queued."""

    def take(self, most: int) -> list[Received]:
        """What arrived since the last call, oldest first, at most so many."""

    def close(self) -> None: ...
