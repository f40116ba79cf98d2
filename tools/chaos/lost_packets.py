"""Single packets out of a stream of MQTT: those of QoS 0, which nobody would say again. Pure."""

from __future__ import annotations

from collections.abc import Callable

TYPE_AND_QOS = 0xF6  # bits of a packet's first byte (MQTT 3.1.1, section 3.3.1)
PUBLISH_QOS_0 = 0x30
MORE = 0x80  # in a byte of the length: another one follows (section 2.2.3)


class PacketLoss:
    """One direction of one connection, piece by piece; of a packet that lies in two pieces nothing is left out."""

    def __init__(self) -> None:
        self._header = bytearray()  # of the packet that has begun, while it is not complete
        self._left = 0  # [B] of the present packet that are still to come

    def without(self, data: bytes, is_lost: Callable[[], bool]) -> bytes:
        """The piece without the packets of QoS 0 for which `is_lost` is True."""
        kept, place = bytearray(), 0
        while place < len(data):
            if self._left:
                end = min(len(data), place + self._left)
                kept += data[place:end]
                self._left -= end - place
                place = end
                continue
            begins_here, start = not self._header, place
            place = self._read_header(data, place)
            length = self._length()
            if length is None:  # the piece ends within the header
                kept += data[start:]
                break
            is_droppable = begins_here and self._header[0] & TYPE_AND_QOS == PUBLISH_QOS_0
            self._header.clear()
            if is_droppable and place + length <= len(data) and is_lost():
                place += length
            else:
                kept += data[start:place]
                self._left = length
        return bytes(kept)

    def _read_header(self, data: bytes, place: int) -> int:
        """Takes the bytes of the header; returns the place after them."""
        while place < len(data) and self._length() is None:
            self._header.append(data[place])
            place += 1
        return place

    def _length(self) -> int | None:
        """[B] after the header, or None while that is not complete."""
        if len(self._header) < 2 or self._header[-1] & MORE:
            return None
        return sum((byte & ~MORE) << 7 * index for index, byte in enumerate(self._header[1:]))
