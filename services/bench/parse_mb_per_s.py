"""How fast the firmware core takes chunks off a serial line: COBS, CRC, every field and limit, in the host's build."""

from __future__ import annotations

import struct
import time
import zlib

from firmware.bindings.device import Device
from schemas.device_config import DeviceConfig, JointConfig
from services.bench.figure import Figure, of_samples, quantile
from services.runtime.serial_frames import packet

UNIT = "MB/s"
JOINTS, KNOTS = 6, 20
FRAMES, ROUNDS = 200, 50  # a round is timed as one
HEAD = struct.Struct("<BBBBIIIQIHH")
NEVER = (1 << 64) - 1
BOOT = 1


def measure() -> Figure:
    """Of frames, without the line's own stuffing. Each is checked to its last knot, and opens no stream."""
    frame = chunk()
    line = packet(frame) * FRAMES
    device = bench_device()
    samples = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        device.receive_serial(line)
        samples.append(len(frame) * FRAMES / (time.perf_counter() - started) / 1e6)
        device.take()
        device.take_serial()
    reference = {"Python: struct and zlib, without COBS": python_mb_per_s(frame)}
    note = f"TRAJ of {JOINTS} joints and {KNOTS} knots, {len(frame)} bytes; host build, not the chip"
    return of_samples(samples, UNIT, reference=reference, note=note)


def bench_device() -> Device:
    """At rest at step 0, as `chunk` wants it not."""
    joints = tuple(
        JointConfig(
            name=f"q{number}",
            lower_q8=-(1 << 30),
            upper_q8=1 << 30,
            max_velocity_q8=1 << 22,
            max_acceleration_q8=1 << 22,
        )
        for number in range(JOINTS)
    )
    device = Device(DeviceConfig(name="bench", joints=joints), boot_id=BOOT)
    device.attach_line()
    return device


def chunk() -> bytes:
    """A FIRST chunk whose last knot alone is not at rest as its flag says: refused, but only at the very end."""
    body = HEAD.pack(0x67, 1, 1, JOINTS, BOOT, 7, 0, NEVER, 20_000, KNOTS, 3)
    rows = [[256 * index // 4] * JOINTS + [0] * JOINTS for index in range(KNOTS - 1)]
    rows.append([256 * KNOTS // 4] * JOINTS + [1] * JOINTS)
    body += b"".join(struct.pack(f"<{2 * JOINTS}i", *row) for row in rows)
    return body + struct.pack("<I", zlib.crc32(body))


def python_mb_per_s(frame: bytes) -> float:
    """The same frames' CRC and numbers, by Python's own C."""
    numbers = struct.Struct(f"<{2 * JOINTS * KNOTS}i")
    samples = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        for _ in range(FRAMES):
            assert zlib.crc32(frame[:-4]) == int.from_bytes(frame[-4:], "little")
            HEAD.unpack_from(frame)
            numbers.unpack_from(frame, HEAD.size)
        samples.append(len(frame) * FRAMES / (time.perf_counter() - started) / 1e6)
    return quantile(samples, 0.5)
