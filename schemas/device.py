"""What the gateway says of the device, and of every command it sent there."""

from __future__ import annotations

from enum import IntEnum

from schemas.message import Message, Vector


class DeviceMode(IntEnum):
    """The firmware's states, with the numbers they have on the wire."""

    BOOT = 0
    UNREFERENCED = 1
    HOMING = 2
    IDLE = 3
    RUN = 4
    HOLD = 5
    FAULT = 6
    ESTOP = 7


class DeviceStatus(Message, frozen=True, kw_only=True):
    """Who the device is and whether it can be reached; latched."""

    stamp: int = 0  # [ns] UNIX time
    online: bool = False
    reason: str = ""  # why it is offline or not usable
    device: str = ""
    firmware: str = ""
    boot_id: int = 0
    reset_cause: str = ""
    joints: int = 0
    tick_hz: int = 0
    queue_capacity: int = 0  # [knots]


class DeviceState(Message, frozen=True, kw_only=True):
    """How the device is, as it said itself, 50 times a second."""

    stamp: int = 0  # [ns] UNIX time of the device's measurement, by clock synchronisation
    device_time: int = 0  # [us] since the device's boot
    boot_id: int = 0
    mode: DeviceMode = DeviceMode.BOOT
    fault: int = 0
    name: tuple[str, ...] = ()
    steps: tuple[int, ...] = ()  # executed
    velocity: Vector = ()  # [steps/s]
    time_scale: float = 0.0  # 0 stands on the path, 1 runs as planned
    buffered: float = 0.0  # [s] of path in the device's queue
    stream: int = 0
    next_seq: int = 0
    play_time: float = 0.0  # [s] of the stream that has been played
    underruns: int = 0
    refused: int = 0  # chunks and commands that the device has refused since boot
    bad_frames: int = 0
    round_trip: float = 0.0  # [s] latest clock synchronisation


class DeviceEvent(Message, frozen=True, kw_only=True):
    """Something the device or its link reports once."""

    stamp: int = 0  # [ns] UNIX time
    device: str = ""
    event: str = ""
    detail: str = ""


class DeviceCommandKind(IntEnum):
    """What a person may ask of the device besides motion; the numbers are those on the wire."""

    HOLD = 1
    RESUME = 2
    STOP = 3
    RESET = 4
    REFERENCE = 5


class DeviceCommandRequest(Message, frozen=True, kw_only=True):
    """A command; REFERENCE declares where the joints stand, at the zero of every joint if empty."""

    command: DeviceCommandKind = DeviceCommandKind.HOLD
    name: tuple[str, ...] = ()
    position: Vector = ()  # [rad] or [m], for REFERENCE


class DeviceCommandResponse(Message, frozen=True, kw_only=True):
    """Whether the device did it, in its own words."""

    accepted: bool = False
    reason: str = ""
    mode: DeviceMode = DeviceMode.BOOT


class CommandChunk(Message, frozen=True, kw_only=True):
    """One chunk of knots as it was sent: rows are knots, columns joints."""

    stamp: int = 0  # [ns] UNIX time of sending
    stream: int = 0
    seq: int = 0
    name: tuple[str, ...] = ()
    dt: float = 0.0  # [s] between knots
    time: float = 0.0  # [s] of the first knot along the stream
    position: tuple[Vector, ...] = ()  # [rad] or [m]
    velocity: tuple[Vector, ...] = ()  # [rad/s] or [m/s]
    acceleration: tuple[Vector, ...] = ()  # [rad/s^2] or [m/s^2]
    steps: tuple[tuple[int, ...], ...] = ()  # [1/256 step] absolute, as on the wire
    step_rate: tuple[tuple[int, ...], ...] = ()  # [1/256 step/s] as on the wire


class CommandAck(Message, frozen=True, kw_only=True):
    """The device's answer to a chunk."""

    stamp: int = 0  # [ns] UNIX time of arrival
    stream: int = 0
    seq: int = 0
    code: int = 0
    reason: str = ""
    next_seq: int = 0
    credits: int = 0  # [knots] that would still fit
    buffered: float = 0.0  # [s]
    round_trip: float = 0.0  # [s] from sending to this answer
    steps: tuple[int, ...] = ()  # executed, latest known at this answer
