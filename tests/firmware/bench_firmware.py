"""A device on the bench: frames by the book, a heartbeat, and what the device says."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.injection import inject
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, InjectKind, InjectRequest
from gemelo.schemas.device_config import DeviceConfig, JointConfig
from gemelo.schemas.robot import Motor

BOOT = 0x12345678
NEVER = (1 << 64) - 1
FIRST, LAST = 1, 2
ACK = struct.Struct("<IIIBBHiiHHQ")
Row = tuple[Sequence[int], Sequence[int]]  # positions and velocities of a knot, Q24.8


@dataclass(frozen=True)
class Ack:
    """The fields of an ACK that the tests look at."""

    stream: int
    seq: int
    next_seq: int
    code: int
    credits: int
    buffered_ms: int


def seal(body: bytes) -> bytes:
    """Append the CRC."""
    return body + struct.pack("<I", zlib.crc32(body))


def traj(stream: int, seq: int, rows: Sequence[Row], flags: int = 0, dt_us: int = 20_000, boot: int = BOOT) -> bytes:
    """A TRAJ frame by the book, written here a second time so that no codec checks itself."""
    n = len(rows[0][0])
    body = struct.pack("<BBBBIIIQIHH", 0x67, 1, 1, n, boot, stream, seq, NEVER, dt_us, len(rows), flags)
    return seal(body + b"".join(struct.pack(f"<{2 * n}i", *positions, *velocities) for positions, velocities in rows))


def command(cmd: int, cmd_id: int, boot: int = BOOT, index: int = 0, argument: int = 0) -> bytes:
    """A CMD frame without positions."""
    return seal(struct.pack("<BBBBIIQBBH", 0x67, 1, 3, 0, boot, cmd_id, NEVER, cmd, index, argument))


def heartbeat(counter: int) -> bytes:
    """An HB frame of session 1."""
    return seal(struct.pack("<BBBBIII", 0x67, 1, 5, 0, 0, 1, counter))


def smooth(start: float, goal: float, duration: float, t: float) -> tuple[float, float]:
    """Position and velocity of a quintic from rest to rest."""
    x = min(max(t / duration, 0.0), 1.0)
    position = start + (goal - start) * x**3 * (10 - 15 * x + 6 * x * x)
    return position, (goal - start) / duration * 30 * (x * (1 - x)) ** 2


class Bench:
    """A device with a heartbeat, its answers read."""

    def __init__(
        self,
        config: DeviceConfig | None,
        motors: Sequence[Motor] = (),
        shaft: Sequence[int] | None = None,
        referenced: bool = True,
        steps: Sequence[int] | None = None,
    ) -> None:
        self.device = CoreDevice(config, BOOT, steps=steps, motors=motors, shaft=shaft, referenced=referenced)
        self.events: list[dict[str, object]] = []
        self.acks: list[Ack] = []
        self.codes: list[int] = []  # of CMD_ACKs
        self.config_acks: list[dict[str, object]] = []
        self.sensors: dict[str, object] = {}
        self._beats = 0
        self._next_beat = 0
        self._commands = 0
        self._streams = 0

    def send(self, frame: bytes) -> Ack | None:
        """The ACK to a chunk; None for anything else."""
        self.listen()
        count = len(self.acks)
        self.device.receive(frame)
        self.listen()
        return self.acks[-1] if len(self.acks) > count else None

    def order(self, cmd: DeviceCommandKind, index: int = 0, argument: int = 0) -> int:
        """Give a command; the code of its acknowledgement."""
        self._commands += 1
        self.device.receive(command(cmd, self._commands, index=index, argument=argument))
        self.listen()
        return self.codes[-1]

    def move(self, goal: Sequence[int], duration: float, knots: int = 100) -> int:
        """Start a whole move from rest to rest [steps, s]; the code of its acknowledgement."""
        self._streams += 1
        start = [position / 256 for position in self.device.commanded_q8]
        rows: list[Row] = []
        for i in range(knots + 1):
            pairs = zip(start, goal, strict=True)
            points = [smooth(a, b, duration, duration * i / knots) for a, b in pairs]
            rows.append(([round(p * 256) for p, _ in points], [round(v * 256) for _, v in points]))
        dt_us = round(duration / knots * 1e6)
        ack = self.send(traj(self._streams, 0, rows, FIRST | LAST, dt_us))
        assert ack is not None
        return ack.code

    def press(self, kind: InjectKind, target: str = "", value: float = 1.0) -> None:
        """Do something to the device's world."""
        inject(self.device, InjectRequest(kind=kind, target=target, value=value))

    def run_until(self, mode: DeviceMode, seconds: float) -> None:
        """Let time pass until the device is in that mode; at most so long."""
        for _ in range(round(seconds * 10)):
            if self.device.mode == mode:
                return
            self.run(100)
        raise AssertionError(f"after {seconds} s the device is in {self.device.mode.name}: {self.events[-5:]}")

    def run(self, ms: int, silent: bool = False) -> None:
        """Let time pass, in pieces between which a heartbeat may be due."""
        end = self.device.now_us + ms * 1000
        while (now := self.device.now_us) < end:
            if not silent and now >= self._next_beat:
                self._beats += 1
                self.device.receive(heartbeat(self._beats))
                self._next_beat = now + 200_000
            self.device.advance(min(end, now + 50_000))
        self.listen()

    def listen(self) -> None:
        """Read all that was said."""
        for frame in self.device.take():
            if frame.kind == "event":
                self.events.append(json.loads(frame.payload))
            elif frame.kind == "traj/ack":
                stream, seq, next_seq, code, _, _, _, _, room, buffered, _ = ACK.unpack(frame.payload[8:-4])
                self.acks.append(Ack(stream, seq, next_seq, code, room, buffered))
            elif frame.kind == "cmd/ack":
                self.codes.append(frame.payload[13])
            elif frame.kind == "config/ack":
                self.config_acks.append(json.loads(frame.payload))
            elif frame.kind == "sensors":
                self.sensors = json.loads(frame.payload)

    def details(self, name: str) -> list[object]:
        """The details of all events of that name so far."""
        return [event["detail"] for event in self.events if event["event"] == name]

    def names(self) -> list[object]:
        """The names of the events so far."""
        return [event["event"] for event in self.events]


def rm1_config() -> DeviceConfig:
    """Limits like rm1's: 15 RPM in a second, q2 and q3 at 400 steps a turn."""

    def joint(name: str, speed: float, inverted: bool = False) -> JointConfig:
        limit = round(speed * 256 * 1.02)
        return JointConfig(
            name=name,
            lower_q8=-10_000_000,
            upper_q8=10_000_000,
            max_velocity_q8=limit,
            max_acceleration_q8=limit,
            inverted=inverted,
            dir_setup_us=5,
        )

    return DeviceConfig(name="rm1", joints=(joint("q1", 4665.6), joint("q2", 100.0, True), joint("q3", 100.0)))
