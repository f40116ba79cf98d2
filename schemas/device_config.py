"""The configuration of a device: the JSON of `config` in firmware/PROTOCOL.md.

Positions are absolute motor steps in Q24.8 (1/256 step), velocities Q24.8 steps/s, accelerations Q24.8 steps/s^2.
The bounds that depend on other fields are checked by the firmware core alone.
"""

from __future__ import annotations

import zlib
from enum import StrEnum

import msgspec

UNUSED = 255  # no pin, no joint, no input


class ConfigRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """An object of the configuration."""


class InputRole(StrEnum):
    """The role of a switch."""

    ESTOP = "estop"
    LIMIT_LOWER = "limit_lower"
    LIMIT_UPPER = "limit_upper"
    HOME = "home"


class Pull(StrEnum):
    """The pin's own resistor."""

    NONE = "none"
    UP = "up"
    DOWN = "down"


class SensorKind(StrEnum):
    """The kind of a sensor's raw value."""

    ANALOG = "analog"  # [mV] at the pin
    ULTRASONIC = "ultrasonic"  # [us] length of the echo


class HomingConfig(ConfigRecord, frozen=True, kw_only=True):
    """The homing of a joint: fast to its switch, back off, slowly to it again."""

    input: int  # index of the switch
    group: int = 0  # joints of one group home together, lower groups first
    direction: int  # of travel towards the switch: 1 or -1
    fast_q8: int
    slow_q8: int
    back_off_q8: int
    position_q8: int  # where the joint is when the switch closes
    max_travel_q8: int  # on the way to the switch
    timeout_ms: int  # of the joint's whole homing


class JointConfig(ConfigRecord, frozen=True, kw_only=True):
    """One joint's limits and its driver's demands."""

    name: str
    lower_q8: int
    upper_q8: int
    max_velocity_q8: int
    max_acceleration_q8: int
    inverted: bool = False
    dir_setup_us: int = 0
    step_pin: int = UNUSED
    dir_pin: int = UNUSED
    text_scale_q32: int = 0  # [1/256 step per 1e-7 rad or m] Q32, for text mode; 0: the joint has none
    homing: HomingConfig | None = None


class InputConfig(ConfigRecord, frozen=True, kw_only=True):
    """A switch or button."""

    name: str
    pin: int
    role: InputRole
    joint: int = UNUSED  # that the switch belongs to
    inverted: bool = False  # active at low level
    pull: Pull = Pull.NONE


class OutputConfig(ConfigRecord, frozen=True, kw_only=True):
    """A digital output."""

    name: str
    pin: int
    inverted: bool = False
    at_boot: bool = False
    off_at_estop: bool = False


class SensorConfig(ConfigRecord, frozen=True, kw_only=True):
    """A reading: value [1/1000] = raw * scale_q16 / 65536 + offset_milli."""

    name: str
    kind: SensorKind
    pin: int
    trigger_pin: int = UNUSED  # ULTRASONIC
    scale_q16: int = 65_536_000
    offset_milli: int = 0


class ServoConfig(ConfigRecord, frozen=True, kw_only=True):
    """A hobby servo: pulse lengths [us], 500 to 2500, and how fast the pulse changes, so that the horn can follow."""

    name: str
    pin: int
    lower_us: int
    upper_us: int
    speed_us_s: int
    off_at_estop: bool = False


class DeviceConfig(ConfigRecord, frozen=True, kw_only=True):
    """The whole configuration."""

    name: str
    joints: tuple[JointConfig, ...]
    tick_hz: int = 50_000
    queue_capacity: int = 128  # [knots]
    state_hz: int = 50
    sensor_hz: int = 10
    hold_timeout_ms: int = 500
    enable_lead_ms: int = 0  # from enabling the drivers to the first step
    armed_at_boot: bool = True
    enable_pin: int = UNUSED
    enable_inverted: bool = False  # the drivers are enabled at low level
    inputs: tuple[InputConfig, ...] = ()
    outputs: tuple[OutputConfig, ...] = ()
    sensors: tuple[SensorConfig, ...] = ()
    servo: ServoConfig | msgspec.UnsetType = msgspec.UNSET  # absent where there is none


def config_text(config: DeviceConfig) -> bytes:
    """The JSON that is sent: the same bytes for the same configuration, every time."""
    return msgspec.json.encode(config)


def config_crc(text: bytes) -> int:
    """The CRC-32 that the device knows a configuration by."""
    return zlib.crc32(text)
