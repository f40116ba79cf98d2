"""Frames on a serial line: nothing is lost but what was damaged."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.runtime.serial_frames import (
    LARGEST,
    BadPacket,
    JsonFrame,
    PacketDecoder,
    cobs_decode,
    cobs_encode,
    json_frame,
    packet,
    parse_json_frame,
)

data = st.one_of(st.binary(max_size=600), st.builds(lambda a, n, b: a + b"\x01" * n + b, st.binary(max_size=3),
                                                    st.integers(250, 512), st.binary(max_size=3)))  # fmt: skip


@given(data)
def test_what_is_encoded_has_no_zero_and_comes_back(data):
    encoded = cobs_encode(data)
    assert 0 not in encoded
    assert len(encoded) <= len(data) + len(data) // 254 + 1
    assert cobs_decode(encoded) == data


# The examples of the paper's own encoding, as everybody publishes them.
@pytest.mark.parametrize(
    ("plain", "encoded"),
    [
        (b"", b"\x01"),
        (b"\x00", b"\x01\x01"),
        (b"\x00\x00", b"\x01\x01\x01"),
        (b"\x11\x22\x00\x33", b"\x03\x11\x22\x02\x33"),
        (b"\x11\x00\x00\x00", b"\x02\x11\x01\x01\x01"),
        (bytes(range(1, 255)), b"\xff" + bytes(range(1, 255))),
        (bytes(range(0, 255)), b"\x01\xff" + bytes(range(1, 255))),
        (bytes(range(1, 256)), b"\xff" + bytes(range(1, 255)) + b"\x02\xff"),
        (bytes(range(2, 256)) + b"\x00", b"\xff" + bytes(range(2, 256)) + b"\x01\x01"),
    ],
)
def test_known_packets(plain, encoded):
    assert cobs_encode(plain) == encoded
    assert cobs_decode(encoded) == plain


@given(st.binary(min_size=1, max_size=40))
def test_any_bytes_are_decoded_or_refused(garbage):
    with contextlib.suppress(BadPacket):
        cobs_decode(garbage)


@given(st.lists(st.binary(min_size=1, max_size=300), max_size=5), st.lists(st.integers(1, 40), max_size=60))
def test_frames_come_whole_however_the_line_cuts_them(frames, cuts):
    line, packets, got = b"".join(packet(frame) for frame in frames), PacketDecoder(), []
    for size in [*cuts, len(line)]:
        piece, line = line[:size], line[size:]
        got += packets.feed(piece)
    assert got == frames
    assert packets.bad == 0


@given(st.binary(max_size=100))
def test_garbage_costs_itself_only(garbage):
    packets = PacketDecoder()
    assert packets.feed(garbage + packet(b"whole"))[-1] == b"whole"


def test_what_is_too_long_is_dropped_up_to_the_next_end():
    packets = PacketDecoder()
    for _ in range(3):
        assert packets.feed(b"\x02" * LARGEST) == []
    assert packets.feed(b"\x00" + packet(b"whole")) == [b"whole"]
    assert packets.bad == 1
    assert packets.feed(packet(bytes(LARGEST))) == [bytes(LARGEST)]


@given(st.sampled_from(JsonFrame), st.binary(max_size=200), st.integers(0, 2**32 - 1))
def test_json_goes_into_a_frame_and_back(kind, text, boot_id):
    assert parse_json_frame(json_frame(kind, text, boot_id)) == (kind, boot_id, text)


@given(st.integers(0, 20), st.integers(1, 255))
def test_a_damaged_frame_is_none(at, flip):
    frame = bytearray(json_frame(JsonFrame.PROVISION_ACK, b'{"a": 1}'))
    frame[at % len(frame)] ^= flip
    assert parse_json_frame(bytes(frame)) is None
