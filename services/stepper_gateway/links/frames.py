"""The packed frames of firmware/PROTOCOL.md, as types, to bytes and back.

Positions are Q24.8 motor steps (1/256 step), velocities Q24.8 steps/s, times microseconds.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from enum import IntEnum, IntFlag

import msgspec

from gemelo.libraries.runtime.serial_frames import MAGIC, VERSION, build_frame
from gemelo.schemas.message import Vector

UNITY = 32768.0  # of a time scale; standard: Q1.15 of firmware/PROTOCOL.md
Q8 = 256.0  # of a velocity; standard: Q24.8 of firmware/PROTOCOL.md
ANY_BOOT = 0  # as the boot id of a command that stops; standard: firmware/PROTOCOL.md
NEVER_EXPIRES = 2**64 - 1  # [us] standard: firmware/PROTOCOL.md
NO_JOINT = 255  # standard: firmware/PROTOCOL.md
REPLACE_SINCE = 2  # of `status.protocol`: the first version that knows REPLACE; standard: firmware/PROTOCOL.md

Row = tuple[int, ...]

_HEADER = struct.Struct("<BBBBI")
_CRC = struct.Struct("<I")
_TRAJ = struct.Struct("<IIQIHH")
_REPLACE = struct.Struct("<QIHH")
_ACK = struct.Struct("<IIIBBHiiHHQ")
_CMD = struct.Struct("<IQBBH")
_CMD_ACK = struct.Struct("<IBBBBQ")
_HB = struct.Struct("<II")
_SYNC = struct.Struct("<Q")
_SYNC_R = struct.Struct("<QQQ")
_STATE = struct.Struct("<QBBHHHIIQIIIBBHHH")
_SERVO = struct.Struct("<HH")
_TIME = struct.Struct("<Q")  # of the device: what a STATE begins with


class BadFrame(ValueError):
    """Bytes that are no frame; the text says what is wrong."""


class NoFrame(BadFrame):
    """Nothing of the protocol at all: text, or what another program sends."""


class FrameType(IntEnum):
    """The third byte of every frame."""

    TRAJ = 1
    ACK = 2
    CMD = 3
    CMD_ACK = 4
    HB = 5
    SYNC = 6
    SYNC_R = 7
    STATE = 8


class Code(IntEnum):
    """What the device says of a chunk or a command."""

    OK = 0
    DUPLICATE = 1
    GAP = 2
    NO_SPACE = 3
    BAD_DT = 4
    POSITION_LIMIT = 5
    VELOCITY_LIMIT = 6
    START_MISMATCH = 7
    WRONG_BOOT = 8
    EXPIRED = 9
    RETAINED = 10
    BAD_JOINTS = 11
    NOT_READY = 12
    WRONG_STREAM = 13
    NOT_AT_REST = 14
    UNKNOWN_CMD = 15
    BAD_COUNT = 16
    NOT_ARMED = 17
    ESTOP_PRESSED = 18
    NO_HOMING = 19
    BAD_ARGUMENT = 20
    ACCELERATION_LIMIT = 21
    LATE = 22
    OTHER_KNOT = 23
    NO_STOP = 24


def code_name(code: int) -> str:
    """The name in PROTOCOL.md; a newer firmware may have codes without one here."""
    return Code(code).name if code in Code._value2member_map_ else f"code {code}"


class StateFlag(IntFlag):
    """What is true of the device besides its mode."""

    ARMED = 1  # the drivers are energised


class ChunkFlag(IntFlag):
    """What is special about a chunk."""

    FIRST = 1  # knot 0 is the present position at rest, at stream time 0
    LAST = 2  # the last knot is at rest and the stream ends there
    REPLACE = 4  # knot 0 is one that the device has, and what it has behind that is forgotten


REPLACE = int(ChunkFlag.REPLACE)


class Frame(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """What all frames carry: the boot they come from or are meant for."""

    boot_id: int = 0


class Replacement(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """What REPLACE adds to a chunk: where its knot 0 is, and the spacing of its last `tail` knots."""

    from_us: int  # stream time of knot 0
    tail: int = 0  # [knots] that only lead to rest
    tail_dt_us: int = 0


class Chunk(Frame, frozen=True, kw_only=True, gc=False):
    """TRAJ: `positions` and `velocities` have a row per knot and a column per joint.

    `flags` has no REPLACE: that flag is on the wire where there is a `replace`.
    """

    stream: int
    seq: int
    expires_us: int
    dt_us: int
    flags: int = 0
    positions: tuple[Row, ...] = ()
    velocities: tuple[Row, ...] = ()
    replace: Replacement | None = None


class Ack(Frame, frozen=True, kw_only=True, gc=False):
    """The answer to a chunk; `value` and `limit` mean what `code` says."""

    stream: int
    seq: int
    next_seq: int
    code: int
    joint: int = NO_JOINT
    knot: int = 0
    value: int = 0
    limit: int = 0
    credits: int = 0
    buffered_ms: int = 0
    t_us: int = 0


class CommandFrame(Frame, frozen=True, kw_only=True, gc=False):
    """CMD: `positions` only for REFERENCE; `index` and `argument` as PROTOCOL.md has them for each command."""

    cmd_id: int
    expires_us: int
    cmd: int
    index: int = 0
    argument: int = 0
    positions: Row = ()


class CommandReply(Frame, frozen=True, kw_only=True, gc=False):
    """CMD_ACK: what became of a command, and the mode after it."""

    cmd_id: int
    cmd: int
    code: int
    mode: int
    t_us: int


class Heartbeat(Frame, frozen=True, kw_only=True, gc=False):
    """HB: proof that the gateway's control loop runs."""

    session: int
    counter: int


class Sync(Frame, frozen=True, kw_only=True, gc=False):
    """SYNC: the gateway's own clock, to be echoed."""

    t0: int


class SyncReply(Frame, frozen=True, kw_only=True, gc=False):
    """SYNC_R: `t0` echoed, `t1` and `t2` the device's clock at receipt and answer."""

    t0: int
    t1: int
    t2: int


class StateFrame(Frame, frozen=True, kw_only=True, gc=False):
    """STATE: where the device is; `steps` belong to the path point at `play_us`."""

    t_us: int
    mode: int
    fault: int = 0
    inputs: int = 0
    time_scale: float = 0.0  # 0 stands, 1 plays as planned
    buffered_ms: int = 0
    stream: int = 0
    next_seq: int = 0
    play_us: int = 0
    underruns: int = 0
    refused: int = 0
    bad_frames: int = 0
    flags: int = 1
    fault_joint: int = NO_JOINT
    outputs: int = 0  # bit i: output i is on
    referenced: int = 0xFFFF  # bit j: the place of joint j is known
    speed: float = 1.0  # the time scale that was asked for
    steps: Row = ()
    velocity: Vector = ()  # [steps/s]
    has_servo: bool = False
    servo_us: int = 0  # 0: no pulses
    servo_target_us: int = 0


AnyFrame = Chunk | Ack | CommandFrame | CommandReply | Heartbeat | Sync | SyncReply | StateFrame


def encode(frame: AnyFrame) -> bytes:
    """The frame's bytes with header and CRC."""
    match frame:
        case Chunk():
            kind, joints = FrameType.TRAJ, len(frame.positions[0]) if frame.positions else 0
            body = _chunk(frame)
        case Ack():
            kind, joints = FrameType.ACK, 0
            body = _ACK.pack(
                frame.stream, frame.seq, frame.next_seq, frame.code, frame.joint, frame.knot,
                frame.value, frame.limit, frame.credits, frame.buffered_ms, frame.t_us,
            )  # fmt: skip
        case CommandFrame():
            kind, joints = FrameType.CMD, len(frame.positions)
            body = _CMD.pack(frame.cmd_id, frame.expires_us, frame.cmd, frame.index, frame.argument) + _rows(
                frame.positions
            )
        case CommandReply():
            kind, joints = FrameType.CMD_ACK, 0
            body = _CMD_ACK.pack(frame.cmd_id, frame.cmd, frame.code, frame.mode, 0, frame.t_us)
        case Heartbeat():
            kind, joints, body = FrameType.HB, 0, _HB.pack(frame.session, frame.counter)
        case Sync():
            kind, joints, body = FrameType.SYNC, 0, _SYNC.pack(frame.t0)
        case SyncReply():
            kind, joints, body = FrameType.SYNC_R, 0, _SYNC_R.pack(frame.t0, frame.t1, frame.t2)
        case StateFrame():
            kind, joints = FrameType.STATE, len(frame.steps)
            body = _STATE.pack(
                frame.t_us, frame.mode, frame.fault, frame.inputs, round(frame.time_scale * UNITY), frame.buffered_ms,
                frame.stream, frame.next_seq, frame.play_us, frame.underruns, frame.refused, frame.bad_frames,
                frame.flags, frame.fault_joint, frame.outputs, frame.referenced, round(frame.speed * 1000.0),
            )  # fmt: skip
            body += _rows((*frame.steps, *(round(rate * Q8) for rate in frame.velocity)))
            body += _SERVO.pack(frame.servo_us, frame.servo_target_us) if frame.has_servo else b""
    return build_frame(kind, body, frame.boot_id, joints)


def decode(payload: bytes) -> AnyFrame:
    """The frame in `payload`; raises `BadFrame`, and `NoFrame` where it is none of the protocol's."""
    if len(payload) < _HEADER.size + _CRC.size:
        raise NoFrame(f"{len(payload)} bytes are too few for a frame")
    magic, version, kind, joints, boot_id = _HEADER.unpack_from(payload)
    if magic != MAGIC:
        raise NoFrame(f"magic 0x{magic:02x} is not 0x{MAGIC:02x}")
    if version != VERSION:
        raise BadFrame(f"protocol version {version} is not {VERSION}")
    reader = _READERS.get(kind)
    if reader is None:
        raise BadFrame(f"type {kind} is unknown")
    if not _is_whole(payload):
        raise BadFrame("the CRC does not match")
    try:
        return reader(boot_id, joints, payload[_HEADER.size : -4])
    except struct.error as error:
        raise BadFrame(f"a {FrameType(kind).name} frame of {len(payload)} bytes: {error}") from error


def _is_whole(payload: bytes) -> bool:
    """True if it ends with the checksum of what is before."""
    (crc,) = _CRC.unpack_from(payload, len(payload) - _CRC.size)
    return bool(zlib.crc32(payload[: -_CRC.size]) == crc)


def _chunk(frame: Chunk) -> bytes:
    knots, flags, replace = len(frame.positions), frame.flags & ~REPLACE, frame.replace
    if replace is not None:
        flags |= REPLACE
    numbers = [n for p, v in zip(frame.positions, frame.velocities, strict=True) for n in (*p, *v)]
    body = _TRAJ.pack(frame.stream, frame.seq, frame.expires_us, frame.dt_us, knots, flags)
    if replace is not None:
        body += _REPLACE.pack(replace.from_us, replace.tail_dt_us, replace.tail, 0)
    return body + _rows(numbers)


def _rows(numbers: list[int] | Row) -> bytes:
    return struct.pack(f"<{len(numbers)}i", *numbers)


def _read_rows(body: bytes, offset: int, columns: int, rows: int) -> list[Row]:
    flat = struct.unpack(f"<{columns * rows}i", body[offset:])
    return [flat[i * columns : (i + 1) * columns] for i in range(rows)]


def _read_chunk(boot_id: int, joints: int, body: bytes) -> Chunk:
    stream, seq, expires_us, dt_us, knots, flags = _TRAJ.unpack_from(body)
    begin, replace = _TRAJ.size, None
    if flags & REPLACE:
        from_us, tail_dt_us, tail, _ = _REPLACE.unpack_from(body, begin)
        begin, replace = begin + _REPLACE.size, Replacement(from_us=from_us, tail=tail, tail_dt_us=tail_dt_us)
    rows = _read_rows(body, begin, joints, 2 * knots)
    return Chunk(
        boot_id=boot_id, stream=stream, seq=seq, expires_us=expires_us, dt_us=dt_us, flags=flags & ~REPLACE,
        positions=tuple(rows[0::2]), velocities=tuple(rows[1::2]), replace=replace,
    )  # fmt: skip


def _read_ack(boot_id: int, _joints: int, body: bytes) -> Ack:
    stream, seq, next_seq, code, joint, knot, value, limit, credits, buffered_ms, t_us = _ACK.unpack(body)
    return Ack(
        boot_id=boot_id, stream=stream, seq=seq, next_seq=next_seq, code=code, joint=joint, knot=knot,
        value=value, limit=limit, credits=credits, buffered_ms=buffered_ms, t_us=t_us,
    )  # fmt: skip


def state_content(payload: bytes) -> bytes | None:
    """All of a STATE frame but its time and checksum; None for what is too short for one or fails its checksum."""
    if len(payload) < _HEADER.size + _STATE.size + _CRC.size or not _is_whole(payload):
        return None
    return payload[: _HEADER.size] + payload[_HEADER.size + _TIME.size : -_CRC.size]


def state_time(payload: bytes) -> int:
    """[us] of the device's clock in a STATE frame, of which `state_content` has been read."""
    (t_us,) = _TIME.unpack_from(payload, _HEADER.size)
    return int(t_us)


def _read_command(boot_id: int, joints: int, body: bytes) -> CommandFrame:
    cmd_id, expires_us, cmd, index, argument = _CMD.unpack_from(body)
    (positions,) = _read_rows(body, _CMD.size, joints, 1)
    return CommandFrame(
        boot_id=boot_id, cmd_id=cmd_id, expires_us=expires_us, cmd=cmd, index=index, argument=argument,
        positions=positions,
    )  # fmt: skip


def _read_reply(boot_id: int, _joints: int, body: bytes) -> CommandReply:
    cmd_id, cmd, code, mode, _, t_us = _CMD_ACK.unpack(body)
    return CommandReply(boot_id=boot_id, cmd_id=cmd_id, cmd=cmd, code=code, mode=mode, t_us=t_us)


def _read_heartbeat(boot_id: int, _joints: int, body: bytes) -> Heartbeat:
    session, counter = _HB.unpack(body)
    return Heartbeat(boot_id=boot_id, session=session, counter=counter)


def _read_sync(boot_id: int, _joints: int, body: bytes) -> Sync:
    return Sync(boot_id=boot_id, t0=_SYNC.unpack(body)[0])


def _read_sync_reply(boot_id: int, _joints: int, body: bytes) -> SyncReply:
    t0, t1, t2 = _SYNC_R.unpack(body)
    return SyncReply(boot_id=boot_id, t0=t0, t1=t1, t2=t2)


def _read_state(boot_id: int, joints: int, body: bytes) -> StateFrame:
    t_us, mode, fault, inputs, scale, buffered, stream, next_seq, play_us, *counts = _STATE.unpack_from(body)
    end = _STATE.size + 8 * joints
    steps, velocity = _read_rows(body[:end], _STATE.size, joints, 2)
    servo_us, servo_target_us = _SERVO.unpack(body[end:]) if len(body) > end else (0, 0)
    return StateFrame(
        boot_id=boot_id, t_us=t_us, mode=mode, fault=fault, inputs=inputs, time_scale=scale / UNITY,
        buffered_ms=buffered, stream=stream, next_seq=next_seq, play_us=play_us, underruns=counts[0], refused=counts[1],
        bad_frames=counts[2], flags=counts[3], fault_joint=counts[4], outputs=counts[5], referenced=counts[6],
        speed=counts[7] / 1000.0, steps=steps, velocity=tuple(rate / Q8 for rate in velocity),
        has_servo=len(body) > end, servo_us=servo_us, servo_target_us=servo_target_us,
    )  # fmt: skip


_READERS: dict[int, Callable[[int, int, bytes], AnyFrame]] = {
    FrameType.TRAJ: _read_chunk,
    FrameType.ACK: _read_ack,
    FrameType.CMD: _read_command,
    FrameType.CMD_ACK: _read_reply,
    FrameType.HB: _read_heartbeat,
    FrameType.SYNC: _read_sync,
    FrameType.SYNC_R: _read_sync_reply,
    FrameType.STATE: _read_state,
}
