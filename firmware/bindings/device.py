"""The firmware core from Python: a device whose clock is moved by hand."""

from __future__ import annotations

import ctypes as c
from dataclasses import dataclass
from typing import NamedTuple

from firmware.bindings.library import (
    MAX_JOINTS,
    NAME_SIZE,
    ConfigRecord,
    JointRecord,
    SnapshotRecord,
    load_library,
)
from schemas.device import DeviceMode

OUTPUTS = ("traj/ack", "cmd/ack", "sync/r", "state", "event", "status")
LARGEST_OUTPUT = 1024


class ConfigError(ValueError):
    """The core refuses this configuration; the message names the joint and the reason."""


@dataclass(frozen=True)
class JointConfig:
    """One joint's limits [1/256 step, per s, per s^2] and its driver's demands."""

    name: str
    lower_q8: int
    upper_q8: int
    max_velocity_q8: int
    max_acceleration_q8: int
    inverted: bool = False
    dir_setup_us: int = 0


@dataclass(frozen=True)
class DeviceConfig:
    """What a device is told before it starts."""

    name: str
    joints: tuple[JointConfig, ...]
    tick_hz: int = 50_000
    queue_capacity: int = 128  # [knots]
    state_hz: int = 50
    hold_timeout_ms: int = 500


class OutFrame(NamedTuple):
    """Something the device said: the topic's last part and the bytes."""

    kind: str
    payload: bytes


class PinChange(NamedTuple):
    """Levels from this tick on; bit j is joint j."""

    tick: int
    step: int
    dir: int


class Device:
    """One device; nothing happens in it but by `receive` and `advance`."""

    def __init__(
        self,
        config: DeviceConfig,
        boot_id: int = 1,
        now_us: int = 0,
        steps: tuple[int, ...] | None = None,
        referenced: bool = True,
        reset_cause: str = "power_on",
    ) -> None:
        self._library = load_library()
        self._handle = None
        self.config = config
        self.boot_id = boot_id
        count = len(config.joints)
        start = steps if steps is not None else (0,) * count
        if len(start) != count:
            raise ConfigError(f"{len(start)} start positions for {count} joints of {config.name!r}")
        record = _record(config)
        self._check(record)
        positions = (c.c_int32 * MAX_JOINTS)(*start)
        self._handle = self._library.gemelo_create(
            c.byref(record), boot_id, reset_cause.encode(), now_us, positions, referenced
        )
        self._buffer = (c.c_uint8 * LARGEST_OUTPUT)()
        self._output = c.c_uint8()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self._library.gemelo_destroy(self._handle)

    def _check(self, record: ConfigRecord) -> None:
        joint = c.c_uint8()
        fault = self._library.gemelo_find_fault(c.byref(record), c.byref(joint))
        if fault is None:
            return
        name = self.config.joints[joint.value].name if joint.value < len(self.config.joints) else ""
        subject = f"joint {name!r} of device" if name else "device"
        raise ConfigError(f"{subject} {self.config.name!r}: {fault.decode()}")

    def receive(self, payload: bytes, retained: bool = False, received_us: int | None = None) -> None:
        """Hand one frame over, at the device's present time; it may have arrived a little earlier [us]."""
        received = self.now_us if received_us is None else received_us
        self._library.gemelo_receive(self._handle, payload, len(payload), retained, received)

    def advance(self, until_us: int) -> None:
        """Let time pass; every tick before `until_us` is run."""
        self._library.gemelo_advance(self._handle, until_us)

    def take(self) -> list[OutFrame]:
        """All that was said since the last call, oldest first."""
        frames: list[OutFrame] = []
        while True:
            size = self._library.gemelo_take(self._handle, c.byref(self._output), self._buffer, LARGEST_OUTPUT)
            if size < 0:
                return frames
            frames.append(OutFrame(OUTPUTS[self._output.value], c.string_at(self._buffer, size)))

    def halt(self) -> None:
        """Slow down along the path and hold, because the platform is about to stop."""
        self._library.gemelo_halt(self._handle)

    def report_status(self) -> None:
        """Say `status` again, as after a reconnection."""
        self._library.gemelo_report_status(self._handle)

    def trace(self, on: bool = True) -> None:
        """Record every change of a pin from now on."""
        self._library.gemelo_trace(self._handle, on)

    def take_trace(self) -> list[PinChange]:
        """Pin changes since the last call, oldest first."""
        size = 4096
        ticks, steps, dirs = (c.c_uint64 * size)(), (c.c_uint32 * size)(), (c.c_uint32 * size)()
        changes: list[PinChange] = []
        while True:
            count = self._library.gemelo_take_trace(self._handle, ticks, steps, dirs, size)
            if count == 0:
                return changes
            changes += [PinChange(ticks[i], steps[i], dirs[i]) for i in range(count)]

    def _snapshot(self) -> SnapshotRecord:
        record = SnapshotRecord()
        self._library.gemelo_snapshot(self._handle, c.byref(record))
        return record

    @property
    def now_us(self) -> int:
        """Device time."""
        return int(self._snapshot().now_us)

    @property
    def mode(self) -> DeviceMode:
        return DeviceMode(self._snapshot().mode)

    @property
    def referenced(self) -> bool:
        """Whether the device knows where its joints stand."""
        return bool(self._snapshot().referenced)

    @property
    def moving(self) -> bool:
        """A stream is being played, or a joint still turns."""
        return bool(self._snapshot().moving)

    @property
    def steps(self) -> tuple[int, ...]:
        """Executed steps, absolute, per joint."""
        return tuple(self._snapshot().steps[: len(self.config.joints)])

    @property
    def commanded_q8(self) -> tuple[int, ...]:
        """Path position at the end of the last whole slot, rounded to 1/256 step."""
        return tuple(self._snapshot().commanded_q8[: len(self.config.joints)])

    @property
    def commanded_steps(self) -> tuple[float, ...]:
        """Path position at the end of the last whole slot [steps], as exact as the core has it."""
        return tuple(value / (1 << 20) for value in self._snapshot().commanded_q20[: len(self.config.joints)])

    @property
    def play_us(self) -> int:
        """Stream time of the path point at the end of the last whole slot."""
        return int(self._snapshot().play_us)

    @property
    def time_scale(self) -> float:
        """Path time per time in the last whole slot: 1 plays as planned, 0 stands."""
        return float(self._snapshot().scale_q30) / (1 << 30)

    @property
    def max_slot_error(self) -> int:
        """The largest |commanded - executed| at any slot end so far [1/256 step], rounded up."""
        return int(self._snapshot().max_slot_error_q8)


def _record(config: DeviceConfig) -> ConfigRecord:
    if not 1 <= len(config.joints) <= MAX_JOINTS:
        raise ConfigError(f"device {config.name!r} has {len(config.joints)} joints, not 1 to {MAX_JOINTS}")
    record = ConfigRecord(
        name=_name(config.name),
        tick_hz=config.tick_hz,
        queue_capacity=config.queue_capacity,
        state_hz=config.state_hz,
        hold_timeout_ms=config.hold_timeout_ms,
        joints=len(config.joints),
    )
    for slot, joint in zip(record.joint, config.joints, strict=False):
        _fill(slot, joint)
    return record


def _fill(record: JointRecord, joint: JointConfig) -> None:
    record.name = _name(joint.name)
    record.lower_q8, record.upper_q8 = joint.lower_q8, joint.upper_q8
    record.max_velocity_q8, record.max_acceleration_q8 = joint.max_velocity_q8, joint.max_acceleration_q8
    record.dir_setup_us, record.inverted = joint.dir_setup_us, joint.inverted


def _name(text: str) -> bytes:
    encoded = text.encode()
    if len(encoded) >= NAME_SIZE:
        raise ConfigError(f"the name {text!r} is longer than {NAME_SIZE - 1} bytes")
    return encoded
