"""Packets that are left out of a stream of MQTT: whole ones of QoS 0, wherever the pieces end."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from gemelo.tools.chaos.lost_packets import PacketLoss

PACKETS = st.lists(
    st.tuples(st.sampled_from((0x10, 0x30, 0x31, 0x32, 0x34, 0x40, 0xC0)), st.binary(max_size=300)), max_size=20
)


def packet(first: int, body: bytes) -> bytes:
    length, header = len(body), bytearray([first])
    while True:
        length, low = divmod(length, 128)
        header.append(low | (0x80 if length else 0))
        if not length:
            return bytes(header) + body


def pieces(stream: bytes, ends: list[int]) -> list[bytes]:
    places = sorted({0, len(stream), *(end % (len(stream) + 1) for end in ends)})
    return [stream[a:b] for a, b in pairwise(places)]


@given(PACKETS, st.lists(st.integers(0, 10_000), max_size=8))
def test_without_losses_every_byte_passes(packets, ends):
    stream, loss = b"".join(packet(*each) for each in packets), PacketLoss()
    assert b"".join(loss.without(piece, lambda: False) for piece in pieces(stream, ends)) == stream


@given(PACKETS)
def test_of_one_piece_exactly_the_packets_of_qos_0_are_lost(packets):
    stream = b"".join(packet(*each) for each in packets)
    kept = b"".join(packet(*each) for each in packets if each[0] not in (0x30, 0x31))
    assert PacketLoss().without(stream, lambda: True) == kept


@given(PACKETS, st.lists(st.integers(0, 10_000), max_size=8), st.randoms(use_true_random=False))
def test_what_arrives_is_a_stream_of_whole_packets_in_their_order(packets, ends, random):
    stream, loss = b"".join(packet(*each) for each in packets), PacketLoss()
    arrived = b"".join(loss.without(piece, lambda: random.random() < 0.5) for piece in pieces(stream, ends))
    for each in packets:
        whole = packet(*each)
        if arrived.startswith(whole) and each[0] not in (0x30, 0x31):
            arrived = arrived[len(whole) :]
        elif each[0] in (0x30, 0x31):
            arrived = arrived.removeprefix(whole)
    assert arrived == b""
