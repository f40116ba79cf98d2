"""An image on its way to a device: one piece after another, each answered; and the two wires that it goes over."""

from __future__ import annotations

import hashlib
import queue
import secrets
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import msgspec
from paho.mqtt import client as paho

from gemelo.libraries.mqtt.access import BrokerAccess
from gemelo.libraries.mqtt.client import MqttClient, is_failure
from gemelo.libraries.mqtt.failures import denial
from gemelo.libraries.runtime.firmware_update import PIECE, UpdateAck, UpdateStep, begin_content, update_frame
from gemelo.libraries.runtime.serial_frames import (
    JsonFrame,
    PacketDecoder,
    build_frame,
    packet,
    parse_json_frame,
    sync_frame,
)
from gemelo.schemas.device_topics import topic
from gemelo.schemas.reasons import Reason, because
from gemelo.tools.cli.common.errors import CommandError, ExitCode
from gemelo.tools.cli.device.provision import BoardLine, refusal

ANSWER_TIME = 2.0  # [s] for a piece: the flash of a board erases and writes 4 kB in a tenth of that
CHECK_TIME = 15.0  # [s] for the first and the last step, in which a signature or the whole image is checked
TRIES = 6  # of each step
MOST_GAPS = 20  # pieces that the device has asked for again
KNOCK = 0.5  # [s] between two questions who is there
SYNC_REPLY, COMMAND, STATUS, FOR_EVER = 7, 3, 11, (1 << 64) - 1  # of firmware/PROTOCOL.md


class UpdateStatus(msgspec.Struct, frozen=True):
    """The fields of the JSON of `status` that count here."""

    online: bool
    device: str = ""
    firmware: str = ""
    boot_id: int = 0
    armed: bool = False
    slot: str = ""


class UpdateWire(Protocol):
    """A way to one device."""

    def send(self, frame: bytes) -> None:
        """Puts an UPDATE frame on its way."""

    def knock(self) -> None:
        """Asks for `status` where that does not come by itself."""

    def take(self, patience: float) -> UpdateAck | UpdateStatus | None:
        """What the device has said next; None if that is nothing in `patience` [s]."""


class Transfer:
    """Brings one signed image to a device; `show` is told the bytes that have arrived."""

    def __init__(self, wire: UpdateWire, image: bytes, signature: bytes, show: Callable[[int], None]) -> None:
        self._wire, self._image, self._signature, self._show = wire, image, signature, show
        self._session = secrets.randbelow((1 << 32) - 1) + 1
        self._boot_id = 0

    def run(self, boot_id: int) -> int:
        """Until the device has all of it and restarts into it; the bytes that it had from before. CommandError else."""
        self._boot_id = boot_id
        content = begin_content(len(self._image), hashlib.sha256(self._image).digest(), self._signature)
        had = next_byte = self._step(UpdateStep.BEGIN, 0, content, CHECK_TIME).next
        gaps = 0
        while next_byte < len(self._image):
            piece = self._image[next_byte : next_byte + PIECE]
            ack = self._step(UpdateStep.DATA, next_byte, piece, ANSWER_TIME)
            gaps += not ack.accepted
            if gaps > MOST_GAPS:
                raise CommandError(because("update.lost_pieces", self._cut_off(next_byte), count=gaps))
            next_byte = ack.next
            self._show(next_byte)
        self._step(UpdateStep.END, next_byte, b"", CHECK_TIME)
        return had

    def _step(self, step: UpdateStep, offset: int, content: bytes, patience: float) -> UpdateAck:
        """The answer to it: it is taken, or the device wants an earlier piece; raises `CommandError` for a refusal."""
        frame = update_frame(step, self._session, self._boot_id, offset, content)
        for _ in range(TRIES):
            self._wire.send(frame)
            ack = self._answer(patience)
            if ack is None:
                continue
            is_gap = step is not UpdateStep.BEGIN and ack.receiving and ack.next != offset
            if ack.accepted or is_gap:
                return ack
            raise CommandError(refusal(ack.reason))
        raise CommandError(because("update.no_answer", self._cut_off(offset), time=TRIES * patience))

    def _answer(self, patience: float) -> UpdateAck | None:
        deadline = time.monotonic() + patience
        while (left := deadline - time.monotonic()) > 0.0:
            said = self._wire.take(left)
            if isinstance(said, UpdateAck) and said.session == self._session:
                return said
            if isinstance(said, UpdateStatus) and said.online and said.boot_id != self._boot_id:
                raise CommandError(because("update.restarted"))
        return None

    def _cut_off(self, at: int) -> Reason:
        return because("update.cut_off", at=at, size=len(self._image))


def await_status(wire: UpdateWire, patience: float, is_wanted: Callable[[UpdateStatus], bool]) -> UpdateStatus | None:
    """The next status that is wanted; None if there is none in `patience` [s]."""
    deadline, next_knock = time.monotonic() + patience, 0.0
    while (now := time.monotonic()) < deadline:
        if now >= next_knock:
            wire.knock()
            next_knock = now + KNOCK
        said = wire.take(min(deadline, next_knock) - now)
        if isinstance(said, UpdateStatus) and said.online and is_wanted(said):
            return said
    return None


class SerialWire:
    """The device's serial line."""

    def __init__(self, line: BoardLine) -> None:
        self._line, self._packets = line, PacketDecoder()
        self._said: list[UpdateAck | UpdateStatus] = []

    def send(self, frame: bytes) -> None:
        self._line.write(packet(frame))

    def knock(self) -> None:
        self._line.write(packet(sync_frame(0)))

    def take(self, patience: float) -> UpdateAck | UpdateStatus | None:
        deadline = time.monotonic() + patience
        while not self._said and time.monotonic() < deadline:
            for frame in self._packets.feed(self._line.read(4096)):
                if len(frame) >= _HEADER.size and frame[2] == SYNC_REPLY:
                    self._ask_for_status(_HEADER.unpack_from(frame)[4])
                text = parse_json_frame(frame)
                if text is not None and (said := _read(text.text, text.kind)) is not None:
                    self._said.append(said)
        return self._said.pop(0) if self._said else None

    def _ask_for_status(self, boot_id: int) -> None:
        body = _STATUS.pack(secrets.randbelow(1 << 32), FOR_EVER, STATUS, 0, 0)
        self._line.write(packet(build_frame(COMMAND, body, boot_id)))


class MqttWire:
    """The device's topics at a broker."""

    def __init__(self, client: MqttClient, device: str) -> None:
        self._client, self._device = client, device
        self._said: queue.SimpleQueue[UpdateAck | UpdateStatus] = queue.SimpleQueue()
        client.on_message = self._on_message

    def send(self, frame: bytes) -> None:
        self._client.publish(topic(self._device, "update"), frame, qos=1)

    def knock(self) -> None:
        """Its status is kept by the broker, and comes with every new start."""

    def take(self, patience: float) -> UpdateAck | UpdateStatus | None:
        try:
            return self._said.get(timeout=max(0.0, patience))
        except queue.Empty:
            return None

    def _on_message(self, _client: paho.Client, _data: object, message: paho.MQTTMessage) -> None:
        kind = JsonFrame.STATUS if message.topic.endswith("/status") else JsonFrame.UPDATE_ACK
        if (said := _read(bytes(message.payload), kind)) is not None:
            self._said.put(said)


_HEADER, _STATUS = struct.Struct("<BBBBI"), struct.Struct("<IQBBH")
_KINDS: dict[JsonFrame, type[UpdateAck | UpdateStatus]] = {
    JsonFrame.UPDATE_ACK: UpdateAck,
    JsonFrame.STATUS: UpdateStatus,
}


def _read(text: bytes, kind: JsonFrame) -> UpdateAck | UpdateStatus | None:
    """None for what is neither."""
    if kind not in _KINDS:
        return None
    try:
        return msgspec.json.decode(text, type=_KINDS[kind])
    except (msgspec.DecodeError, UnicodeDecodeError):
        return None


@contextmanager
def mqtt_wire(access: BrokerAccess, device: str) -> Iterator[MqttWire]:
    """Yields the wire to `device` once its topics are subscribed; raises `CommandError` for a broker that says no."""
    client = MqttClient(access, f"gemelo-update-{secrets.token_hex(4)}")
    answers: queue.SimpleQueue[Reason | None] = queue.SimpleQueue()
    wire = MqttWire(client, device)
    wanted = [(topic(device, kind), 1) for kind in ("update/ack", "status")]

    def on_connect(_client: paho.Client, _data: object, _flags: object, reason: object, _props: object) -> None:
        if is_failure(reason):
            answers.put(because("update.broker.refuses", broker=str(access), error=str(reason)))
        else:
            client.subscribe(wanted)

    def on_subscribe(_client: paho.Client, _data: object, _mid: int, reasons: Any, _props: object) -> None:
        denied = [topic for (topic, _), reason in zip(wanted, reasons, strict=False) if is_failure(reason)]
        answers.put(because("update.broker.denied", denial(denied[0], access)) if denied else None)

    client.on_connect, client.on_subscribe = on_connect, on_subscribe
    try:
        client.connect(access.host, access.port, keepalive=5)
    except OSError as error:
        raise CommandError(
            because("update.broker.unreached", broker=str(access), error=str(error)), ExitCode.NO_STACK
        ) from error
    client.loop_start()
    try:
        complaint = answers.get(timeout=5.0)
        if complaint:
            raise CommandError(complaint)
        yield wire
    except queue.Empty:
        raise CommandError(because("update.broker.silent", broker=str(access)), ExitCode.NO_STACK) from None
    finally:
        client.disconnect()
        client.loop_stop()
