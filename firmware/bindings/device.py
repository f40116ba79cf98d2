"""The firmware core from Python: a device whose clock is moved by hand."""

from __future__ import annotations

import ctypes as c
from typing import NamedTuple

from firmware.bindings.library import MAX_JOINTS, PART_SIZE, REASON_SIZE, SnapshotRecord, load_library
from schemas.device import DeviceMode
from schemas.device_config import DeviceConfig, config_text

OUTPUTS = ("traj/ack", "cmd/ack", "sync/r", "state", "event", "status")
LARGEST_OUTPUT = 1024


class ConfigError(ValueError):
    """The core refuses this configuration; the message names the part and the reason."""


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
        positions = (c.c_int32 * max(count, MAX_JOINTS))(*start)
        text, part, reason = config_text(config), c.create_string_buffer(PART_SIZE), c.create_string_buffer(REASON_SIZE)
        self._handle = self._library.gemelo_create(
            text, len(text), part, reason, boot_id, reset_cause.encode(), now_us, positions, referenced
        )
        if self._handle is None:
            subject = f"{part.value.decode()!r} of device" if part.value else "device"
            raise ConfigError(f"{subject} {config.name!r}: {reason.value.decode()}")
        self._buffer = (c.c_uint8 * LARGEST_OUTPUT)()
        self._output = c.c_uint8()

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self._library.gemelo_destroy(self._handle)

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
