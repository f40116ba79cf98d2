"""A serial line to a board that speaks `<SEQ,J1,...,Jn>`, at any baud rate."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from functools import partial

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.reasons import Reason, because
from gemelo.services.stepper_gateway.links.connection import keep_connected
from gemelo.services.stepper_gateway.links.foreign.adapter import Adapter, ForeignCall, FrameFor
from gemelo.services.stepper_gateway.links.foreign.text_device import TextDevice
from gemelo.services.stepper_gateway.links.link import Kind, Received
from gemelo.services.stepper_gateway.links.serial_port import OpenPort, complaint, open_port


class TextLink:
    """A link to the one board at the other end of `port`."""

    def __init__(self, port: str, baud: int, arm: ArmDescription, wake: Callable[[], None]) -> None:
        self._port, self._baud, self._wake = port, baud, wake
        self._line: OpenPort | None = None
        self._reason = because("link.port.unopened", port=port)
        self._stop = threading.Event()
        self.device = TextDevice(arm, lambda: secrets.randbelow((1 << 32) - 1) + 1, time.monotonic(), baud)
        self._adapter = Adapter(self.device, self._write, wake)
        self._thread = threading.Thread(
            target=keep_connected, args=(self._connection, self._stop), name="text-link", daemon=True
        )
        self._thread.start()

    @property
    def connected(self) -> bool:
        return self._line is not None and self.device.objection is None

    @property
    def reason(self) -> Reason | None:
        if self._line is None:
            return self._reason
        objection = self.device.objection
        return None if objection is None else because("link.on_port", objection, port=self._port)

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        return self.connected and self._adapter.put(FrameFor(kind, payload))

    def take(self, most: int) -> list[Received]:
        return self._adapter.take(most)

    def close(self) -> None:
        self._stop.set()
        self._thread.join(timeout=3.0)
        self._adapter.close()

    def _connection(self) -> bool:
        """One open port from beginning to end; true if there was one."""
        try:
            line = open_port(self._port, self._baud)
        except (OSError, ValueError) as error:
            self._lose(complaint(self._port, error))
            return False
        self._line = line
        self._wake()
        try:
            self._read(line)
        except OSError as error:
            self._lose(because("link.port.failed", port=self._port, error=str(error)))
        self._line = None
        line.close()
        self._wake()
        return True

    def _read(self, line: OpenPort) -> None:
        """Until the port fails, the writer gives it up, or the link is closed."""
        while self._line is line and not self._stop.is_set():
            data = line.read(max(1, line.in_waiting))
            if data:
                self._adapter.put(ForeignCall(partial(self.device.hear, data)))

    def _write(self, payload: bytes) -> None:
        line = self._line
        if line is None:
            return
        try:
            line.write(payload)
        except OSError as error:
            self._line = None
            self._lose(because("link.port.takes_nothing", port=self._port, error=str(error)))

    def _lose(self, reason: Reason) -> None:
        self._reason = reason
        self._wake()
