"""A proxy between an MQTT client and its broker that looks at whole packets, and passes on those that it may."""

from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from contextlib import suppress

Passes = Callable[[bytes], bool]  # of a whole packet


def always(_packet: bytes) -> bool:
    """Nothing is left out."""
    return True


class PacketProxy:
    """Listens on a port of its own; each packet reaches the other end where `to_broker` or `to_client` says so."""

    def __init__(self, broker: int, to_broker: Passes = always, to_client: Passes = always) -> None:
        """`broker` is its port."""
        self._broker, self._to_broker, self._to_client = broker, to_broker, to_client
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self._open: list[socket.socket] = [self._server]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        for each in self._open:
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._server.accept()
                try:
                    broker = socket.create_connection(("127.0.0.1", self._broker))
                except OSError:  # it starts, or has ended
                    client.close()
                    continue
                self._open += [client, broker]
                for ends in ((client, broker, self._to_broker), (broker, client, self._to_client)):
                    threading.Thread(target=_pass_on, args=ends, daemon=True).start()


def _pass_on(source: socket.socket, target: socket.socket, passes: Passes) -> None:
    with suppress(OSError, IndexError), source, target, source.makefile("rb") as stream:
        while head := stream.read(1):
            lengths = bytearray(stream.read(1))
            while lengths[-1] & 0x80:  # a variable byte integer: MQTT 5, section 1.5.5
                lengths += stream.read(1)
            size = sum((byte & 0x7F) << (7 * place) for place, byte in enumerate(lengths))
            packet = head + bytes(lengths) + stream.read(size)
            if passes(packet):
                target.sendall(packet)
