"""The firmware core in virtual time with a probe on its STEP and DIR pins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import msgspec

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.frames import PinChange
from gemelo.schemas.device_config import DeviceConfig, JointConfig
from gemelo.services.stepper_gateway.links.frames import Chunk, ChunkFlag, Code, Heartbeat, encode
from gemelo.tools.bench.figures import NotMeasured

BOOT = 1
NEVER = (1 << 64) - 1
FINE = 256  # Q24.8
BEAT = 200_000  # [us]
TRAJ_KNOTS = 60  # of one chunk


class WireKnot(NamedTuple):
    """Q24.8 steps and steps/s of every joint."""

    position: tuple[int, ...]
    velocity: tuple[int, ...]


class Trace(NamedTuple):
    """Recorded pin changes of one path."""

    changes: list[PinChange]
    origin: int  # [us] device time at which the path began


class Pulse(NamedTuple):
    """A rising edge of STEP."""

    tick: int  # since the device's start
    place: int  # [steps] the count after it


def joint_of(speed: float, acceleration: float, *, dir_setup_us: int = 5, inverted: bool = False) -> JointConfig:
    """A joint with limits [steps/s] and [steps/s^2] and the widest position range."""
    return JointConfig(
        name="q", lower_q8=-(1 << 30), upper_q8=1 << 30, max_velocity_q8=round(speed * FINE),
        max_acceleration_q8=min(round(acceleration * FINE), (1 << 31) - 1), dir_setup_us=dir_setup_us,
        inverted=inverted,
    )  # fmt: skip


def bench_config(joints: Sequence[JointConfig], tick_hz: int) -> DeviceConfig:
    """The configuration of a device with these joints, without inputs and pins."""
    named = tuple(msgspec.structs.replace(joint, name=f"q{number}") for number, joint in enumerate(joints, 1))
    return DeviceConfig(name="bench", joints=named, tick_hz=tick_hz)


def play(device: CoreDevice, knots: Sequence[WireKnot], dt_us: int) -> Trace:
    """Plays knots `dt_us` [us] apart, from rest to rest; raises NotMeasured if they are refused or played slower."""
    device.trace()
    sent, beats, next_beat = 0, 0, 0
    origins: set[int] = set()
    begin = device.now_us
    end = begin + dt_us * len(knots) + 100_000
    while device.now_us < end:
        if device.now_us >= next_beat:
            beats, next_beat = beats + 1, device.now_us + BEAT
            device.receive(_heartbeat(beats))
        played = device.now_us - begin
        if sent < len(knots) and played >= (sent - TRAJ_KNOTS) * dt_us:
            device.receive(chunk_of(knots, sent, dt_us))
            sent += TRAJ_KNOTS
            _expect_taken(device)
        device.advance(device.now_us + 1000)
        if device.time_scale == 1.0:
            origins.add(device.now_us - device.play_us)
    if len(origins) != 1:
        raise NotMeasured(f"the path was played slower, or late: it began at {sorted(origins)}")
    return Trace(device.take_trace(), origins.pop())


def chunk_of(knots: Sequence[WireKnot], first: int, dt_us: int) -> bytes:
    """The encoded chunk that begins with the knot `first`."""
    rows = knots[first : first + TRAJ_KNOTS]
    flags = (ChunkFlag.FIRST if first == 0 else 0) | (ChunkFlag.LAST if first + TRAJ_KNOTS >= len(knots) else 0)
    return encode(
        Chunk(
            boot_id=BOOT, stream=1, seq=first // TRAJ_KNOTS, expires_us=NEVER, dt_us=dt_us, flags=int(flags),
            positions=tuple(row.position for row in rows), velocities=tuple(row.velocity for row in rows),
        )
    )  # fmt: skip


def pulses_of(changes: Sequence[PinChange], joint: int, inverted: bool = False) -> list[Pulse]:
    """The rising edges of one joint's STEP, counted in the direction of DIR."""
    bit, high, count = 1 << joint, False, 0
    found: list[Pulse] = []
    for change in changes:
        rises = bool(change.step & bit) and not high
        high = bool(change.step & bit)
        if rises:
            count += 1 if bool(change.dir & bit) != inverted else -1
            found.append(Pulse(change.tick, count))
    return found


def _heartbeat(counter: int) -> bytes:
    return encode(Heartbeat(boot_id=0, session=1, counter=counter))


def _expect_taken(device: CoreDevice) -> None:
    for frame in device.take():
        if frame.kind == "traj/ack" and frame.payload[20] not in (Code.OK, Code.DUPLICATE):
            raise NotMeasured(f"the device refuses the path: {Code(frame.payload[20]).name}")
