"""A serial line to the device: the frames of MQTT as COBS packets, firmware/PROTOCOL.md.

One thread opens the port, again and again, and reads; another one writes, so that a line which takes nothing holds
nobody up. Both end with the port, and what has not been written by then is forgotten.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable

from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, json_frame, packet, parse_json_frame
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.connection import ReceiveQueue, keep_connected
from gemelo.services.stepper_gateway.links.frames import FrameType
from gemelo.services.stepper_gateway.links.link import Kind, Received
from gemelo.services.stepper_gateway.links.serial_port import OpenPort, complaint, open_port

TYPES = {
    FrameType.ACK: Kind.TRAJ_ACK,
    FrameType.CMD_ACK: Kind.CMD_ACK,
    FrameType.SYNC_R: Kind.SYNC_R,
    FrameType.STATE: Kind.STATE,
}
TEXTS = {
    JsonFrame.CONFIG: Kind.CONFIG,
    JsonFrame.CONFIG_ACK: Kind.CONFIG_ACK,
    JsonFrame.SENSORS: Kind.SENSORS,
    JsonFrame.STATUS: Kind.STATUS,
    JsonFrame.EVENT: Kind.EVENT,
    JsonFrame.INJECT: Kind.INJECT,
    JsonFrame.SHAFT: Kind.SHAFT,
}
FRAMES = {kind: frame for frame, kind in TEXTS.items()}  # of the kinds that are JSON
BACKLOG = 16_384  # [bytes] that may wait; chosen: 0.2 s at 921,600 baud


class SerialLink:
    """A link to the one device at the other end of `port`."""

    def __init__(self, port: str, baud: int, wake: Callable[[], None]) -> None:
        self._port, self._baud, self._wake = port, baud, wake
        self._inbox = ReceiveQueue(wake)
        self._outgoing: deque[bytes] = deque()
        self._has_outgoing = threading.Event()
        self._line: OpenPort | None = None
        self._reason = because("link.port.unopened", port=port)
        self._stop = threading.Event()
        self._thread = threading.Thread(
            target=keep_connected, args=(self._connection, self._stop), name="serial-link", daemon=True
        )
        self._thread.start()

    @property
    def connected(self) -> bool:
        return self._line is not None

    @property
    def reason(self) -> Reason | None:
        return None if self._line is not None else self._reason

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        has_room = urgent or sum(map(len, tuple(self._outgoing))) + len(payload) <= BACKLOG
        if self._line is None or not has_room:
            return False
        put = self._outgoing.appendleft if urgent else self._outgoing.append
        put(packet(json_frame(FRAMES[kind], payload) if kind in FRAMES else payload))
        self._has_outgoing.set()
        return True

    def take(self, most: int) -> list[Received]:
        return self._inbox.take(most)

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=3.0)

    def _connection(self) -> bool:
        """One open port from beginning to end; true if there was one."""
        try:
            line = open_port(self._port, self._baud)
        except (OSError, ValueError) as error:
            self._lose(complaint(self._port, error))
            return False
        self._outgoing.clear()
        self._line = line
        writer = threading.Thread(target=self._write, args=(line,), name="serial-writer", daemon=True)
        writer.start()
        self._wake()
        try:
            self._read(line)
        except OSError as error:
            self._lose(because("link.port.failed", port=self._port, error=str(error)))
        self._line = None
        self._has_outgoing.set()
        writer.join()
        line.close()
        self._wake()
        return True

    def _read(self, line: OpenPort) -> None:
        """Until the port fails, the writer gives it up, or the link is closed."""
        packets = PacketDecoder()
        while self._line is line and not self._stop.is_set():
            data = line.read(max(1, line.in_waiting))
            arrival, bad = time.monotonic_ns(), packets.bad
            received = [found for frame in packets.feed(data) if (found := _received(frame, arrival)) is not None]
            # What is no packet comes as no bytes at all: it is counted with the other bad ones.
            received += [Received(Kind.STATE, b"", False, arrival)] * (packets.bad - bad)
            if received:
                self._inbox.put(*received)

    def _write(self, line: OpenPort) -> None:
        while self._line is line:
            self._has_outgoing.wait()
            self._has_outgoing.clear()
            try:
                while self._outgoing and self._line is line:
                    line.write(self._outgoing.popleft())
            except OSError as error:
                self._line = None
                self._lose(because("link.port.takes_nothing", port=self._port, error=str(error)))

    def _lose(self, reason: Reason) -> None:
        self._reason = reason
        self._wake()


def _received(frame: bytes, arrival: int) -> Received | None:
    """A frame under its kind; one that is damaged stays as it is, to be counted; None for what is not the gateway's."""
    text = parse_json_frame(frame)
    if text is not None:
        return Received(TEXTS[text.kind], text.text, False, arrival) if text.kind in TEXTS else None
    kind = TYPES.get(FrameType(frame[2])) if len(frame) > 2 and frame[2] in FrameType._value2member_map_ else None
    return Received(kind or Kind.STATE, frame, False, arrival)
