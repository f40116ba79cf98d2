"""The firmware core in Python: a device with an explicit clock, virtual motors and switches."""

from __future__ import annotations

import ctypes as c
import json
from collections.abc import Sequence
from pathlib import Path

import msgspec

from gemelo.firmware.bindings.firmware_slot import FirmwareSlot, firmware_calls
from gemelo.firmware.bindings.frames import OUTPUTS, InputLevels, LastingState, OutFrame, PinChange, PlatformRequest
from gemelo.firmware.bindings.library import LIBRARY, MAX_JOINTS, PART_SIZE, REASON_SIZE, SnapshotRecord, load_library
from gemelo.firmware.bindings.motor import MotorError, horn_record, motor_record
from gemelo.libraries.arm.model.gripper import opening_of, pulse_of
from gemelo.libraries.runtime.serial_frames import LARGEST, JsonFrame
from gemelo.schemas.device import DeviceMode
from gemelo.schemas.device_config import DeviceConfig, config_text
from gemelo.schemas.grippers.gripper import PulseDrive
from gemelo.schemas.grippers.kinds import Gripper
from gemelo.schemas.robot import Motor

LARGEST_OUTPUT = 1024
UNCONFIGURED = DeviceConfig(name="", joints=())


class ConfigError(ValueError):
    """The core refuses this configuration; the message names the part and the reason."""


class CoreDevice:
    """One device; nothing happens in it but by `receive` and `advance`.

    `config` may be the JSON text itself, and None for a device that has none yet. `motors` are ideal where there are
    none; the shafts stand at `steps` unless `shaft` says where they truly are. A servo `gripper` has a virtual servo at
    its jaws, which are open at first; the sensor that reads them does so in `gripper_unit`. The firmware itself is that
    of `library`, and runs from `slot`.
    """

    def __init__(
        self,
        config: DeviceConfig | bytes | None,
        boot_id: int = 1,
        now_us: int = 0,
        steps: Sequence[int] | None = None,
        referenced: bool = True,
        reset_cause: str = "power_on",
        motors: Sequence[Motor] = (),
        shaft: Sequence[int] | None = None,
        gripper: Gripper | None = None,
        gripper_unit: str = "mm",
        library: Path = LIBRARY,
        slot: str = "",
    ) -> None:
        self._library = load_library(library)
        self._handle = None
        self.boot_id = boot_id
        self._buffer = (c.c_uint8 * LARGEST_OUTPUT)()
        self._output = c.c_uint8()
        text = config_text(config) if isinstance(config, DeviceConfig) else config or b""
        self._config, self._config_crc = _decoded(text), 0
        count = len(self._config.joints)
        start = steps if steps is not None else (0,) * count
        if len(start) != count:
            raise ConfigError(f"{len(start)} start positions for {count} joints of {self._config.name!r}")
        self._handle = self._created(text, boot_id, reset_cause, now_us, slot)
        for index, motor in enumerate(motors[:MAX_JOINTS]):
            try:
                record = motor_record(motor)
            except MotorError as error:
                raise MotorError(f"the motor of joint {index + 1}: {error}") from error
            self._library.gemelo_set_motor(self._handle, index, c.byref(record))
        drive = gripper.drive if gripper is not None else None
        self._servo = drive if isinstance(drive, PulseDrive) else None
        if self._servo is not None:
            horn = horn_record(self._servo, self._config.sensors, gripper_unit)
            self._library.gemelo_set_horn(self._handle, c.byref(horn))
        true = _positions(start if shaft is None else shaft)
        self._library.gemelo_start(self._handle, _positions(start), true, referenced)
        self._config_crc = self._snapshot().config_crc32

    def _created(self, text: bytes, boot_id: int, reset_cause: str, now_us: int, slot: str) -> int:
        part, reason = c.create_string_buffer(PART_SIZE), c.create_string_buffer(REASON_SIZE)
        handle: int | None = self._library.gemelo_create(
            text, len(text), part, reason, boot_id, reset_cause.encode(), now_us, slot.encode()
        )
        if handle is None:
            subject = f"{part.value.decode()!r} of device" if part.value else "device"
            raise ConfigError(f"{subject} {self._config.name!r}: {reason.value.decode()}")
        return handle

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self._library.gemelo_destroy(self._handle)

    def receive(self, payload: bytes, retained: bool = False, received_us: int | None = None) -> None:
        """Hand one frame over, at the device's present time; it may have arrived a little earlier [us]."""
        received = self.now_us if received_us is None else received_us
        self._library.gemelo_receive(self._handle, payload, len(payload), retained, received)

    def receive_config(self, text: bytes, retained: bool = False, received_us: int | None = None) -> None:
        """Hand a configuration's text over."""
        received = self.now_us if received_us is None else received_us
        self._library.gemelo_receive_config(self._handle, text, len(text), retained, received)

    @property
    def config(self) -> DeviceConfig:
        """The active configuration of the device."""
        crc = self.config_crc32
        if crc != self._config_crc:
            self._config, self._config_crc = _decoded(self.kept_config), crc
        return self._config

    @property
    def config_crc32(self) -> int:
        """Of the configuration's text; 0 for none."""
        return int(self._snapshot().config_crc32)

    @property
    def kept_config(self) -> bytes:
        """The text of the configuration that was taken last over a wire; empty if none was."""
        size = self._library.gemelo_kept(self._handle, self._buffer, 0)
        text = (c.c_uint8 * size)()
        self._library.gemelo_kept(self._handle, text, size)
        return bytes(text)

    def attach_firmware_slot(self, slot: FirmwareSlot) -> None:
        """From now on the device takes a new firmware into `slot`."""
        self._firmware_calls = firmware_calls(slot)
        self._library.gemelo_set_firmware_slot(self._handle, c.byref(self._firmware_calls))

    def advance(self, until_us: int) -> None:
        """Let time pass; every tick before `until_us` is run."""
        self._library.gemelo_advance(self._handle, until_us)

    def stand_still(self, until_us: int) -> None:
        """Let time pass with no tick in it, to a slot's start; only the slot under way ends before."""
        self._library.gemelo_stand_still(self._handle, until_us)

    def take(self) -> list[OutFrame]:
        """All that was said since the last call, oldest first."""
        frames: list[OutFrame] = []
        while True:
            size = self._library.gemelo_take(self._handle, c.byref(self._output), self._buffer, LARGEST_OUTPUT)
            if size < 0:
                return frames
            frames.append(OutFrame(OUTPUTS[self._output.value], c.string_at(self._buffer, size)))

    def attach_line(self) -> None:
        """From now on `take_serial` is called: the device has a serial line."""
        self._library.gemelo_attach_line(self._handle)

    def receive_serial(self, data: bytes, received_us: int | None = None) -> None:
        """Hand over bytes that came over the serial line."""
        received = self.now_us if received_us is None else received_us
        self._library.gemelo_receive_serial(self._handle, data, len(data), received)

    def take_serial(self) -> bytes:
        """The bytes that went out over the serial line since the last call."""
        data = bytearray()
        while size := self._library.gemelo_take_serial(self._handle, self._buffer, LARGEST_OUTPUT):
            data += c.string_at(self._buffer, size)
        return bytes(data)

    def take_requests(self) -> list[PlatformRequest]:
        """The requests of the serial line that the platform handles, oldest first."""
        requests: list[PlatformRequest] = []
        text = (c.c_uint8 * LARGEST)()
        while True:
            size = self._library.gemelo_take_request(self._handle, c.byref(self._output), text, LARGEST)
            if size < 0:
                return requests
            requests.append(PlatformRequest(JsonFrame(self._output.value), c.string_at(text, size)))

    def say(self, kind: JsonFrame, text: bytes) -> bool:
        """JSON of the platform's own; true: it is to be said over MQTT too, by the caller."""
        return bool(self._library.gemelo_say(self._handle, kind, text, len(text)))

    def halt(self) -> None:
        """Slow down along the path and hold, because the platform is about to stop."""
        self._library.gemelo_halt(self._handle)

    def report_status(self) -> None:
        """Say `status` again, as after a reconnection."""
        self._library.gemelo_report_status(self._handle)

    def subscribes_anew(self) -> bool:
        """True where the device has received no heartbeat for so long that its platform is to subscribe anew."""
        return bool(self._library.gemelo_subscribes_anew(self._handle, self.now_us))

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

    @property
    def lasting(self) -> LastingState:
        """What outlasts the device's power, by one look."""
        record = self._snapshot()
        if record.config_crc32 != self._config_crc:
            self._config, self._config_crc = _decoded(self.kept_config), record.config_crc32
        count = len(self._config.joints)
        return LastingState(
            record.config_crc32,
            tuple(record.steps[:count]),
            tuple(record.shaft[:count]),
            bool(record.still),
            bool(record.referenced),
        )

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
    def armed(self) -> bool:
        """The drivers are energised."""
        return bool(self._snapshot().armed)

    @property
    def referenced(self) -> bool:
        """True if the positions of all joints are known."""
        return bool(self._snapshot().referenced)

    @property
    def moving(self) -> bool:
        """A stream is being played, or a joint still turns."""
        return bool(self._snapshot().moving)

    @property
    def still(self) -> bool:
        """Nothing moves and no pulse is due: the flash may be written."""
        return bool(self._snapshot().still)

    @property
    def told_status(self) -> bool:
        """It has said `status` over its serial line to somebody who had spoken there."""
        return bool(self._snapshot().told_status)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that are on."""
        bits = self._snapshot().outputs
        return tuple(output.name for i, output in enumerate(self.config.outputs) if bits >> i & 1)

    @property
    def levels(self) -> InputLevels:
        """The present levels of the input pins."""
        record = self._snapshot()
        return InputLevels(record.level_low, record.level_high)

    @property
    def steps(self) -> tuple[int, ...]:
        """Executed steps, absolute, per joint."""
        return tuple(self._snapshot().steps[: len(self.config.joints)])

    @property
    def shaft(self) -> tuple[int, ...]:
        """The true shaft positions [steps], per joint; the device does not know them."""
        return tuple(self._snapshot().shaft[: len(self.config.joints)])

    def shaft_report(self) -> bytes:
        """The JSON of `shaft`."""
        count, record = len(self.config.joints), self._snapshot()
        report = {"t_us": record.now_us, "steps": record.steps[:count], "shaft": record.shaft[:count]}
        return json.dumps(report).encode()

    def inherit_environment(self, before: CoreDevice) -> None:
        """Takes over the environment of the previous device: held switches, blocked shafts and sensor readings.

        Of a device with other firmware it takes nothing: the same bytes may mean something else there.
        """
        if before._library is not self._library:
            return
        self._library.gemelo_inherit(self._handle, before._handle)

    def press_input(self, index: int, pressed: bool | None) -> None:
        """Hold a switch closed or open; None leaves it to the arm."""
        self._library.gemelo_press(self._handle, index, 0 if pressed is None else 1 if pressed else 2)

    def block(self, joint: int, blocked: bool = True) -> None:
        """Hold a shaft fast, or let it go."""
        self._library.gemelo_block(self._handle, joint, blocked)

    def slip(self, joint: int, steps: int) -> None:
        """Push a shaft by so many steps, as when its coupling gives way."""
        self._library.gemelo_slip(self._handle, joint, steps)

    def set_sensor(self, index: int, value: float) -> None:
        """Sets a sensor's reading, in the unit [unit] of robot.toml."""
        self._library.gemelo_set_sensor(self._handle, index, value)

    @property
    def servo_us(self) -> int:
        """The servo's pulse [us]; 0 for none."""
        return int(self._snapshot().servo_us)

    @property
    def opening(self) -> float | None:
        """[m] that the jaws of a servo gripper truly stand apart; None without one."""
        return None if self._servo is None else opening_of(self._servo, self._snapshot().horn_us)

    def put_object(self, width: float) -> bool:
        """Put something `width` [m] wide between the jaws, 0 for nothing; False where they are closer than that."""
        if self._servo is None:
            return False
        if width <= 0.0:
            self._library.gemelo_take_object(self._handle)
            return True
        if (self.opening or 0.0) < width - 1e-6:
            return False
        self._library.gemelo_put_object(self._handle, pulse_of(self._servo, width))
        return True

    @property
    def has_jaws(self) -> bool:
        """It has a servo gripper, between whose jaws something can be put."""
        return self._servo is not None

    def freeze(self, seconds: float) -> None:
        """Blocks the slot task for `seconds` [s]; only the interrupt runs."""
        self._library.gemelo_freeze(self._handle, round(seconds * 1e6))

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
        """Path time per real time (dimensionless) in the last whole slot: 1 is as planned, 0 is standstill."""
        return float(self._snapshot().scale_q30) / (1 << 30)

    @property
    def max_slot_error(self) -> int:
        """The largest |commanded - executed| at any slot end so far [1/256 step], rounded up."""
        return int(self._snapshot().max_slot_error_q8)


def joint_count(text: bytes) -> int:
    """The number of joints in a configuration; raises ConfigError where the text is invalid."""
    return len(_decoded(text).joints)


def _decoded(text: bytes) -> DeviceConfig:
    if not text:
        return UNCONFIGURED
    try:
        return msgspec.json.decode(text, type=DeviceConfig)
    except msgspec.DecodeError as error:
        raise ConfigError(f"the configuration cannot be read: {error}") from error


def _positions(values: Sequence[int]) -> c.Array[c.c_int32]:
    return (c.c_int32 * MAX_JOINTS)(*values)
