"""The wire's frames: there and back, and refused when they are not what they claim."""

from __future__ import annotations

import contextlib
import json
import zlib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.services.stepper_gateway.links.frames import (
    REPLACE,
    Ack,
    BadFrame,
    Chunk,
    CommandFrame,
    CommandReply,
    Heartbeat,
    Replacement,
    StateFrame,
    Sync,
    SyncReply,
    decode,
    encode,
)
from gemelo.services.stepper_gateway.links.reports import (
    ConfigAckReport,
    EventReport,
    ShaftReport,
    StatusReport,
    decode_report,
    decode_sensors,
)
from tests.table import table

VECTORS = Path(__file__).resolve().parents[2] / "firmware" / "tests" / "vectors"
KINDS = {
    "TRAJ": Chunk, "ACK": Ack, "CMD": CommandFrame, "CMD_ACK": CommandReply, "HB": Heartbeat, "SYNC": Sync,
    "SYNC_R": SyncReply, "STATE": StateFrame,
}  # fmt: skip

u8, u16, u32, u64 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64))
i32 = st.integers(-(2**31), 2**31 - 1)


def vectors() -> list[Any]:
    found = []
    for file in sorted(VECTORS.glob("*.json")):
        content = json.loads(file.read_text())
        found += [pytest.param(v, id=f"{file.stem}: {v['name']}") for v in content if isinstance(content, list)]
    return found


def rows(joints: int, count: int) -> st.SearchStrategy[tuple[tuple[int, ...], ...]]:
    row = st.tuples(*[i32] * joints)
    return st.tuples(*[row] * count)


replacements = st.none() | st.builds(Replacement, from_us=u64, tail=u16, tail_dt_us=u32)


@st.composite
def chunks(draw: st.DrawFn) -> Chunk:
    joints, knots = draw(st.integers(1, 6)), draw(st.integers(1, 20))
    return Chunk(
        boot_id=draw(u32), stream=draw(u32), seq=draw(u32), expires_us=draw(u64), dt_us=draw(u32),
        flags=draw(u16) & ~REPLACE, positions=draw(rows(joints, knots)), velocities=draw(rows(joints, knots)),
        replace=draw(replacements),
    )  # fmt: skip


@st.composite
def states(draw: st.DrawFn) -> StateFrame:
    joints = draw(st.integers(1, 6))
    (steps, velocity) = draw(rows(joints, 2))
    return StateFrame(
        boot_id=draw(u32), t_us=draw(u64), mode=draw(u8), fault=draw(u8), inputs=draw(u16),
        time_scale=draw(u16) / 32768.0, buffered_ms=draw(u16), stream=draw(u32), next_seq=draw(u32),
        play_us=draw(u64), underruns=draw(u32), refused=draw(u32), bad_frames=draw(u32), steps=steps,
        velocity=tuple(rate / 256.0 for rate in velocity), speed=draw(u16) / 1000.0,
    )  # fmt: skip


any_frame = st.one_of(
    chunks(),
    states(),
    st.builds(
        Ack, boot_id=u32, stream=u32, seq=u32, next_seq=u32, code=u8, joint=u8, knot=u16, value=i32, limit=i32,
        credits=u16, buffered_ms=u16, t_us=u64,
    ),
    st.builds(
        CommandFrame, boot_id=u32, cmd_id=u32, expires_us=u64, cmd=u8, positions=st.lists(i32, max_size=6).map(tuple)
    ),
    st.builds(CommandReply, boot_id=u32, cmd_id=u32, cmd=u8, code=u8, mode=u8, t_us=u64),
    st.builds(Heartbeat, boot_id=u32, session=u32, counter=u32),
    st.builds(Sync, boot_id=u32, t0=u64),
    st.builds(SyncReply, boot_id=u32, t0=u64, t1=u64, t2=u64),
)  # fmt: skip


@given(any_frame)
def test_every_frame_comes_back_from_its_bytes(frame: Any) -> None:
    assert decode(encode(frame)) == frame


@given(st.binary(max_size=200))
def test_random_bytes_are_no_frame(payload: bytes) -> None:
    with pytest.raises(BadFrame):
        decode(payload)


@given(any_frame, st.data())
def test_a_flipped_bit_is_noticed(frame: Any, data: st.DataObject) -> None:
    payload = bytearray(encode(frame))
    position = data.draw(st.integers(0, len(payload) * 8 - 1))
    payload[position // 8] ^= 1 << position % 8
    with pytest.raises(BadFrame):
        decode(bytes(payload))


@given(any_frame, st.integers(0, 60), st.binary(max_size=8))
def test_a_valid_checksum_over_a_wrong_length_is_refused(frame: Any, cut: int, more: bytes) -> None:
    body = encode(frame)[:-4]
    wrong = body[: len(body) - cut] if cut else body + more + b"\0"
    wrong += zlib.crc32(wrong).to_bytes(4, "little")
    try:
        found = decode(wrong)
    except BadFrame:
        return
    assert encode(found) == wrong  # a shorter frame can only pass where it is whole in itself


@given(st.binary(max_size=200))
def test_random_bytes_are_no_report(payload: bytes) -> None:
    for kind in (StatusReport, EventReport, ConfigAckReport, ShaftReport):
        with contextlib.suppress(BadFrame):
            decode_report(kind, payload)
    with contextlib.suppress(BadFrame):
        decode_sensors(payload)


@table("text", ["{}", '{"t_us": 1e400}', '{"t_us": -1, "ultra": "far"}', "[1]", '{"ultra": null}'])
def test_odd_sensor_readings_are_read_or_refused_never_a_crash(text: str) -> None:
    with contextlib.suppress(BadFrame):
        assert all(isinstance(value, float) for value in decode_sensors(text.encode()).values.values())


def test_sensor_readings_are_those_beside_the_time_and_the_boot() -> None:
    report = decode_sensors(b'{"t_us": 123, "boot_id": 305419896, "ultra": 12.500, "bateria": 7}')
    assert (report.t_us, report.values) == (123, {"ultra": 12.5, "bateria": 7.0})


@table("vector", vectors())
def test_the_shared_vectors_are_read_and_written_alike(vector: dict[str, Any]) -> None:
    payload = bytes.fromhex(vector["frame"])
    if vector["fields"] is None:  # nothing that fields could say
        with contextlib.suppress(BadFrame):
            assert encode(decode(payload)) == payload
        return
    fields = {name: as_rows(value) for name, value in vector["fields"].items()}
    if "replace" in fields:
        fields["replace"] = Replacement(**fields["replace"])
    assert decode(payload) == KINDS[vector["type"]](**in_units(vector["type"], fields))
    assert encode(decode(payload)) == payload


def in_units(kind: str, fields: dict[str, Any]) -> dict[str, Any]:
    """The vectors are in the wire's units, a state is read into steps/s and shares."""
    if KINDS[kind] is not StateFrame:
        return fields
    velocity = tuple(rate / 256.0 for rate in fields["velocity"])
    scales = {"time_scale": fields["time_scale"] / 32768.0, "speed": fields["speed"] / 1000.0}
    return fields | scales | {"velocity": velocity}


def as_rows(value: Any) -> Any:
    return tuple(as_rows(item) for item in value) if isinstance(value, list) else value
