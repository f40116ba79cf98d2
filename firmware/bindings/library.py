"""The shared library that `firmware/bindings/build.sh` makes of the core: its structures and functions."""

from __future__ import annotations

import ctypes as c
import functools
from pathlib import Path

MAX_JOINTS = 8
MAX_CURVE = 16  # of platform/host/motor.h
PART_SIZE, REASON_SIZE = 32, 128  # of `Refusal` in core/refusal.h
LIBRARY = Path(__file__).resolve().parents[1] / "build" / "libgemelo_core.so"


class LibraryMissing(RuntimeError):
    """The core has not been built."""


class SnapshotRecord(c.Structure):
    """`GemeloSnapshot` of bindings/c_api.cpp."""

    _fields_ = (
        ("now_us", c.c_uint64),
        ("play_us", c.c_uint64),
        ("mode", c.c_uint32),
        ("referenced", c.c_uint32),
        ("moving", c.c_uint32),
        ("still", c.c_uint32),
        ("armed", c.c_uint32),
        ("outputs", c.c_uint32),
        ("config_crc32", c.c_uint32),
        ("max_slot_error_q8", c.c_uint32),
        ("steps", c.c_int32 * MAX_JOINTS),
        ("shaft", c.c_int32 * MAX_JOINTS),
        ("commanded_q8", c.c_int32 * MAX_JOINTS),
        ("commanded_q20", c.c_int64 * MAX_JOINTS),
        ("level_low", c.c_uint32),
        ("level_high", c.c_uint32),
        ("scale_q30", c.c_uint32),
        ("servo_us", c.c_uint32),
        ("servo_target_us", c.c_uint32),
        ("horn_us", c.c_double),
        ("told_status", c.c_uint32),
    )


class MotorRecord(c.Structure):
    """`MotorConfig` of platform/host/motor.h."""

    _fields_ = (
        ("pulses_per_turn", c.c_int32),
        ("full_steps_per_turn", c.c_int32),
        ("points", c.c_uint8),
        ("speed", c.c_double * MAX_CURVE),
        ("torque", c.c_double * MAX_CURVE),
        ("inertia", c.c_double),
        ("friction", c.c_double),
    )


class HornRecord(c.Structure):
    """`HornConfig` of platform/host/horn.h."""

    _fields_ = (
        ("speed_us_s", c.c_double),
        ("open_us", c.c_double),
        ("closed_us", c.c_double),
        ("open_value", c.c_double),
        ("closed_value", c.c_double),
        ("sensor", c.c_uint8),
    )


Bytes = c.POINTER(c.c_uint8)
Reason = c.POINTER(c.c_char)


class FirmwareCalls(c.Structure):
    """`FirmwareCalls` of platform/host/virtual_device.h."""

    _fields_ = (
        ("verify", c.CFUNCTYPE(c.c_int, Bytes, Bytes, c.c_size_t, Reason)),
        ("begin", c.CFUNCTYPE(c.c_int, c.c_uint32, Reason)),
        ("write", c.CFUNCTYPE(c.c_int, Bytes, c.c_size_t, Reason)),
        ("finish", c.CFUNCTYPE(c.c_int, Bytes, Reason)),
        ("abort", c.CFUNCTYPE(None)),
        ("permits_older", c.CFUNCTYPE(c.c_int, Bytes, c.c_uint32, Bytes, c.c_size_t)),
    )


@functools.cache
def load_library(path: Path = LIBRARY) -> c.CDLL:
    """The library with its functions typed; raises LibraryMissing with the remedy where there is none."""
    try:
        library = c.CDLL(str(path))
    except OSError as error:
        raise LibraryMissing(
            f"the firmware core cannot be loaded ({error}): run `make setup`, or firmware/bindings/build.sh"
        ) from error
    u8, u32, u64, size, device = c.POINTER(c.c_uint8), c.c_uint32, c.c_uint64, c.c_size_t, c.c_void_p
    text = c.c_char_p
    i32s = c.POINTER(c.c_int32)
    motor, motor_config = c.c_void_p, c.POINTER(MotorRecord)
    u32s, u64s = c.POINTER(c.c_uint32), c.POINTER(c.c_uint64)
    signatures: dict[str, tuple[object, list[object]]] = {
        "create": (device, [text, size, text, text, u32, text, u64, text]),
        "start": (None, [device, i32s, i32s, c.c_int]),
        "destroy": (None, [device]),
        "receive": (None, [device, c.c_char_p, size, c.c_int, u64]),
        "receive_config": (None, [device, text, size, c.c_int, u64]),
        "attach_line": (None, [device]),
        "receive_serial": (None, [device, text, size, u64]),
        "take_serial": (size, [device, u8, size]),
        "take_request": (c.c_int64, [device, u8, u8, size]),
        "say": (c.c_int, [device, c.c_uint8, text, size]),
        "read_config": (c.c_int64, [text, size, text, text, text, size]),
        "check_provision": (c.c_int, [text, size, c.POINTER(c.c_int), text]),
        "kept": (size, [device, u8, size]),
        "set_firmware_slot": (None, [device, c.POINTER(FirmwareCalls)]),
        "advance": (None, [device, u64]),
        "halt": (None, [device]),
        "report_status": (None, [device]),
        "subscribes_anew": (c.c_int, [device, u64]),
        "take": (c.c_int64, [device, u8, u8, size]),
        "snapshot": (None, [device, c.POINTER(SnapshotRecord)]),
        "trace": (None, [device, c.c_int]),
        "take_trace": (size, [device, u64s, u32s, u32s, size]),
        "set_motor": (None, [device, c.c_uint8, motor_config]),
        "set_horn": (None, [device, c.POINTER(HornRecord)]),
        "put_object": (None, [device, c.c_double]),
        "take_object": (None, [device]),
        "inherit": (None, [device, device]),
        "press": (None, [device, c.c_uint8, c.c_uint8]),
        "block": (None, [device, c.c_uint8, c.c_int]),
        "slip": (None, [device, c.c_uint8, c.c_int32]),
        "set_sensor": (None, [device, c.c_uint8, c.c_double]),
        "freeze": (None, [device, u64]),
        "stand_still": (None, [device, u64]),
        "motor_create": (motor, [motor_config, c.c_double]),
        "motor_destroy": (None, [motor]),
        "motor_pulse": (None, [motor, c.c_int]),
        "motor_run": (None, [motor, u64]),
        "motor_hold": (None, [motor, c.c_int]),
        "motor_shaft": (c.c_int32, [motor]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, f"gemelo_{name}", None)
        if function is None:
            raise LibraryMissing(f"{path} has no function gemelo_{name}: it was built from another version")
        function.restype, function.argtypes = result, arguments
    return library
