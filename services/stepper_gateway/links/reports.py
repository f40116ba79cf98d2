"""The device's JSON, as firmware/PROTOCOL.md has it."""

from __future__ import annotations

from typing import Annotated, TypeVar

import msgspec
from msgspec import Meta

from gemelo.schemas.reasons import Reason
from gemelo.services.stepper_gateway.links.frames import NoFrame

Word = Annotated[int, Meta(ge=0, lt=2**32)]
Micros = Annotated[int, Meta(ge=0, le=2**63 - 1)]  # [us] of the device's clock
Steps = tuple[Annotated[int, Meta(ge=-(2**31), lt=2**31)], ...]


class Report(msgspec.Struct, frozen=True, kw_only=True):
    """A JSON object of the device; keys that only a newer one knows are passed over."""


R = TypeVar("R", bound=Report)


class StatusReport(Report, frozen=True, kw_only=True):
    """Who the device is; the last will carries only the first fields."""

    online: bool
    device: str = ""
    boot_id: Word = 0
    firmware: str = ""
    protocol: tuple[int, int] = (1, 1)
    reset_cause: str = ""
    joints: Word = 0
    tick_hz: Word = 0
    queue_capacity: Word = 0  # [knots]
    referenced: bool = False
    armed: bool = False
    config_crc32: Word = 0  # of the configuration it works with; 0: none yet
    virtual: bool = False
    open_loop: bool = False  # it does not say what it has executed
    place: str = ""  # where a virtual device runs
    heap_free: Word = 0  # [bytes] of its memory, as all below; 0 where the board does not say
    heap_least: Word = 0
    stack_least: Word = 0
    stack_task: str = ""


class EventReport(Report, frozen=True, kw_only=True):
    """Something that happened once, at `t_us` of the device's clock."""

    event: str
    t_us: Micros = 0
    stream: Word = 0
    detail: str = ""
    why: Reason | None = None  # `detail` as data, of a board of another dialect, whose device is part of the gateway


class ConfigAckReport(Report, frozen=True, kw_only=True):
    """The device's answer to the configuration whose text has this `crc32`."""

    crc32: Word
    accepted: bool
    part: str = ""  # that is wrong; empty for the device
    reason: str = ""


class ShaftReport(Report, frozen=True, kw_only=True):
    """What the counters of a virtual device believe, and where its shafts are [steps]."""

    t_us: Micros = 0
    steps: Steps = ()
    shaft: Steps = ()


class SensorReport(Report, frozen=True, kw_only=True):
    """The readings that there are, by the sensors' names."""

    t_us: Micros
    values: dict[str, float]


_decoders: dict[type[Report], msgspec.json.Decoder[Report]] = {}
_readings = msgspec.json.Decoder(dict[str, float])


def decode_report(kind: type[R], payload: bytes) -> R:
    """The report in `payload`; raises `NoFrame`."""
    decoder = _decoders.get(kind)
    if decoder is None:
        decoder = _decoders[kind] = msgspec.json.Decoder(kind)
    try:
        return decoder.decode(payload)  # type: ignore[return-value]
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise NoFrame(f"not a {kind.__name__} ({len(payload)} bytes): {error}") from error


def decode_sensors(payload: bytes) -> SensorReport:
    """The readings in `payload`, whose object holds them beside the device's time; raises `NoFrame`."""
    try:
        values = _readings.decode(payload)
        t_us = int(values.pop("t_us", 0))
        if not 0 <= t_us < 2**63:
            raise ValueError(f"the device's time cannot be {t_us} us")
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError, OverflowError, ValueError) as error:
        raise NoFrame(f"no sensor readings ({len(payload)} bytes): {error}") from error
    values.pop("boot_id", None)
    return SensorReport(t_us=t_us, values=values)
