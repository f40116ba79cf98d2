"""Figures of what the firmware core costs: instructions and bytes on rv32imc, and parsing on this machine.

The rv32imc figures are those of firmware/tests/rv32/run, which compiles and runs the core once for all of them.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import tempfile
import time
import zlib
from functools import cache
from pathlib import Path

import msgspec

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.platform.esp32 import ram
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.serial_frames import packet
from gemelo.schemas.device_config import DeviceConfig, JointConfig
from gemelo.tools.bench.figures import Figure, NotMeasured, of_samples, quantile

RUN = "firmware/tests/rv32/run"


class FirmwareCost(msgspec.Struct, frozen=True):
    """The JSON that the script prints."""

    figures: dict[str, float] = {}
    gates: dict[str, float] = {}  # upper bounds of gates.toml, by the names of the figures
    missing: str = ""  # the tool that is not installed, and its remedy


@cache
def cost() -> FirmwareCost:
    """Compiles and runs the core; raises NotMeasured if that fails or a tool is missing."""
    done = subprocess.run([project_root() / RUN, "--json"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise NotMeasured(f"{RUN} failed: {done.stderr.strip()[-300:]}")
    measured = msgspec.json.decode(done.stdout, type=FirmwareCost)
    if measured.missing:
        raise NotMeasured(measured.missing)
    return measured


def instructions(what: str, prototype: dict[str, float]) -> Figure:
    """[instructions] of one "tick" or "slot" with 6 joints in a plain move; means and maxima are
    references, as are the numbers in `prototype`."""
    measured = cost()
    means = {f"{joints} joints mean": measured.figures[f"{what}_{joints}_mean"] for joints in (3, 6)}
    most = {f"{joints} joints most": measured.figures[f"{what}_{joints}_max"] for joints in (3, 6)}
    gates = ", ".join(f"{name} {bound:g}" for name, bound in measured.gates.items() if name.startswith(what))
    return Figure(
        median=measured.figures[f"{what}_6_median"],
        p99=measured.figures[f"{what}_6_p99"],
        reference=means | most | prototype,
        note=f"rv32imc at -Os under QEMU, 6 joints, the fastest at up to 3,750 steps/s, TICK_HZ 50,000; gates: {gates}",
    )


def size(name: str, prototype: float, note: str) -> Figure:
    """The size `name` [bytes], equal in every run; `prototype` [bytes] is the reference."""
    measured = cost()
    value = measured.figures[name]
    return Figure(
        median=value,
        p99=value,
        reference={"prototype": prototype},
        note=f"{note}; gate: {measured.gates[name]:g}",
    )


def tick_instructions() -> Figure:
    """Instructions of one tick of the step interrupt."""
    return instructions("tick", {"prototype 3 joints mean": 59.0, "prototype 6 joints mean": 106.0})


def slot_instructions() -> Figure:
    """Instructions of one 1 kHz slot, state reports included."""
    return instructions("slot", {"prototype 3 joints mean": 939.0, "prototype 6 joints mean": 1743.0})


def core_text_bytes() -> Figure:
    """Code and constants of the whole firmware core [bytes]."""
    return size("core_text_bytes", 3700.0, "rv32imc at -Os, all of firmware/core, without libgcc")


def core_ram_bytes() -> Figure:
    """Memory of the firmware core [bytes]."""
    return size("core_ram_bytes", 7250.0, "rv32imc, 6 joints, 128 knots; without the stack")


def device_static_ram() -> Figure:
    """Variables of the board's firmware [bytes], the largest of all builds; those of each chip are references."""
    if shutil.which(ram.SIZE) is None:
        raise NotMeasured(ram.MISSING)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([ram.LAYER / "check", folder], capture_output=True, check=True)
        found = ram.measured(Path(folder))
    worst = max(found.values())
    return Figure(
        median=worst.variables,
        p99=worst.variables,
        goal=f"< {ram.MOST_VARIABLES}",
        met=worst.variables < ram.MOST_VARIABLES,
        reference={chip: float(one.variables) for chip, one in found.items()},
        note=f"compiled for rv32imc; {worst.together - worst.variables} more of the heap: stacks, UART and MQTT",
    )


JOINTS, KNOTS = 6, 20
FRAMES, ROUNDS = 200, 50  # the frames of a round are timed as one
HEAD = struct.Struct("<BBBBIIIQIHH")
NEVER = (1 << 64) - 1
BOOT = 1


def parse_mb_per_s() -> Figure:
    """Frames [MB/s] that the core takes off a serial line: COBS, CRC, every field and limit, in the host's build.

    The line's own stuffing is not counted. Each frame is checked to its last knot and refused there.
    """
    frame = refused_chunk()
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
    return of_samples(samples, reference=reference, note=note)


def bench_device() -> CoreDevice:
    """A device of JOINTS joints at rest at step 0, with a serial line."""
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
    device = CoreDevice(DeviceConfig(name="bench", joints=joints), boot_id=BOOT)
    device.attach_line()
    return device


def refused_chunk() -> bytes:
    """A whole stream in one chunk whose last knot is not at rest: refused, but only at its very end."""
    body = HEAD.pack(0x67, 1, 1, JOINTS, BOOT, 7, 0, NEVER, 20_000, KNOTS, 3)
    rows = [[256 * index // 4] * JOINTS + [0] * JOINTS for index in range(KNOTS - 1)]
    rows.append([256 * KNOTS // 4] * JOINTS + [1] * JOINTS)
    body += b"".join(struct.pack(f"<{2 * JOINTS}i", *row) for row in rows)
    return body + struct.pack("<I", zlib.crc32(body))


def python_mb_per_s(frame: bytes) -> float:
    """The CRC and the numbers of the same frames, by zlib and struct [MB/s]."""
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
