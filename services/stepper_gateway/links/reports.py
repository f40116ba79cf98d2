"""The device's JSON: its retained `status` and its `event`s, as firmware/PROTOCOL.md has them."""

from __future__ import annotations

import msgspec

from services.stepper_gateway.links.frames import BadFrame


class StatusReport(msgspec.Struct, frozen=True, kw_only=True):
    """Who the device is; the last will carries only the first fields."""

    online: bool
    device: str = ""
    boot_id: int = 0
    firmware: str = ""
    protocol: tuple[int, int] = (1, 1)
    reset_cause: str = ""
    joints: int = 0
    tick_hz: int = 0
    queue_capacity: int = 0  # [knots]
    referenced: bool = False


class EventReport(msgspec.Struct, frozen=True, kw_only=True):
    """Something that happened once, at `t_us` of the device's clock."""

    event: str
    t_us: int = 0
    stream: int = 0
    detail: str = ""


_status = msgspec.json.Decoder(StatusReport)
_event = msgspec.json.Decoder(EventReport)


def decode_status(payload: bytes) -> StatusReport:
    """The status in `payload`; raises `BadFrame`."""
    try:
        return _status.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadFrame(f"not a status report ({len(payload)} bytes): {error}") from error


def decode_event(payload: bytes) -> EventReport:
    """The event in `payload`; raises `BadFrame`."""
    try:
        return _event.decode(payload)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise BadFrame(f"not an event report ({len(payload)} bytes): {error}") from error
