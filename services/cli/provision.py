"""`gemelo device provision`: speaks with a board over its serial line, without the stack."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar

import msgspec

from services.cli.credentials import Credentials
from services.cli.exits import CommandError, ExitCode
from services.runtime.serial_frames import JsonFrame, Packets, json_frame, packet, parse_json_frame, sync_frame

T = TypeVar("T", bound=msgspec.Struct)

BAUD = 921_600
PATIENCE = 15.0  # [s] for a board to start and answer
AGAIN = 2.0  # [s] between two tries
TO_RESTART = 8.0  # [s] for the first word after it


class Line(Protocol):
    """A serial line; `read` waits a moment at most."""

    def write(self, data: bytes, /) -> int | None: ...
    def read(self, size: int = 1, /) -> bytes: ...


class Answer(msgspec.Struct, frozen=True):
    """The JSON of `provision/ack`."""

    accepted: bool
    reason: str = ""


class Who(msgspec.Struct, frozen=True):
    """What counts here of the JSON of `status`."""

    device: str = ""
    firmware: str = ""


def provision(port: str, baud: int, credentials: Credentials) -> ExitCode:
    """Tells the board, and says what it answered."""
    with open_line(port, baud) as line:
        conversation = Conversation(line)
        answer = conversation.tell(credentials.text())
        if not answer.accepted:
            raise CommandError(f"the device refused: {answer.reason or 'without a reason'}")
        said = "everything forgotten" if credentials.factory_reset else f"taken: {credentials.summary()}"
        print(f"{said}; the device starts anew", flush=True)
        who = conversation.meet()
    if who is None:
        print(f"no word from it for {TO_RESTART:g} s: look at `gemelo device status`, or at the port's own messages")
    else:
        print(f"it is back: {who.device or 'without a name'}, firmware {who.firmware}")
    return ExitCode.OK


class Conversation:
    """Frames to and from one board."""

    def __init__(self, line: Line) -> None:
        self._line = line
        self._packets = Packets()

    def tell(self, text: bytes, patience: float = PATIENCE) -> Answer:
        """Sends `text` again and again until the board answers: it may be starting because the port was opened."""
        ack = self._exchange(packet(json_frame(JsonFrame.PROVISION, text)), JsonFrame.PROVISION_ACK, patience, AGAIN)
        if ack is None:
            raise CommandError(
                f"no answer in {patience:g} s: is it the right --serial port and --baud, and does gemelo's firmware "
                "run there? `python -m serial.tools.list_ports` lists the ports"
            )
        return _decoded(ack, Answer)

    def meet(self, patience: float = TO_RESTART) -> Who | None:
        """Who it is when it has started; None if it says nothing."""
        status = self._exchange(packet(sync_frame(0)), JsonFrame.STATUS, patience, 1.0)
        return None if status is None else _decoded(status, Who)

    def _exchange(self, question: bytes, answer: JsonFrame, patience: float, again: float) -> bytes | None:
        deadline, next_try = time.monotonic() + patience, 0.0
        while (now := time.monotonic()) < deadline:
            if now >= next_try:
                self._line.write(question)
                next_try = now + again
            for frame in self._packets.feed(self._line.read(4096)):
                found = parse_json_frame(frame)
                if found is not None and found.kind is answer:
                    return found.text
        return None


def _decoded(text: bytes, kind: type[T]) -> T:
    try:
        return msgspec.json.decode(text, type=kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise CommandError(f"the device answered what is no {kind.__name__}: {error}") from error


@contextmanager
def open_line(port: str, baud: int) -> Iterator[Line]:
    """The port; what is wrong with it is one sentence. Its control lines stay low: many boards reset by them."""
    import serial

    try:
        line = serial.Serial(None, baud, timeout=0.05, write_timeout=2.0, exclusive=True)
        line.dtr = line.rts = False
        line.port = port
        line.open()
    except (serial.SerialException, ValueError, OSError) as error:
        raise CommandError(
            f"cannot open {port}: {error}; is it plugged in, may you use it (group dialout), and does no other program "
            "(a gateway with wire = serial) hold it?"
        ) from error
    try:
        yield line
    except (serial.SerialException, OSError) as error:
        raise CommandError(f"{port} failed: {error}") from error
    finally:
        line.close()
