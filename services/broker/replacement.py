"""The broker's own program in the place of this process (exec), so that a signal to this process ends the broker."""

from __future__ import annotations

import contextlib
import os
import resource
import select
import signal
import socket
import ssl
import sys
from collections.abc import Callable, Sequence

from gemelo.schemas.deployment import MqttSection
from gemelo.schemas.errors import ReasonedError

BEAT = 1.0  # [s]
PATIENCE = 1.5  # [s] for the handshake, and again for the answer: with BEAT less than the watchdog of its unit
FILES = 16_384  # descriptors: above any flood that is held off, and no more than the system allows
# MQTT 3.1.1, 3.1: protocol, level 4, a session that leaves nothing, 5 s of keep-alive, no name, no user.
CONNECT = b"\x10\x0c\x00\x04MQTT\x04\x02\x00\x05\x00\x00"
CONNACK = b"\x20"
PINGREQ, PINGRESP = b"\xc0\x00", b"\xd0"


class NotInstalled(ReasonedError):
    """The broker's program is not on this machine; the reason has the remedy."""


def become(command: Sequence[str], section: MqttSection, beat: Callable[[], None], on_end: Callable[[], None]) -> int:
    """Becomes the program; a child process calls `beat` once a second while it answers, and `on_end` when it has ended.

    Does not return in the process that becomes it.
    """
    alive, held = os.pipe()
    if os.fork() == 0:
        os.close(held)
        _watch_broker(section, alive, beat, on_end)
        os._exit(0)
    os.close(alive)
    # Held open by the broker, never written: its end is seen by the companion whatever way it ends.
    os.set_inheritable(held, True)
    _allow_files()
    with contextlib.suppress(OSError):  # a disk that is full takes no words
        sys.stdout.flush()
        sys.stderr.flush()
    os.execv(command[0], list(command))


def _allow_files() -> None:
    limit, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES if most == resource.RLIM_INFINITY else min(FILES, most)
    if limit != resource.RLIM_INFINITY and limit < wanted:
        with contextlib.suppress(OSError, ValueError):
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


def _watch_broker(section: MqttSection, alive: int, beat: Callable[[], None], on_end: Callable[[], None]) -> None:
    for number in (signal.SIGTERM, signal.SIGINT):  # they are the broker's; this one ends with it
        signal.signal(number, signal.SIG_IGN)
    interval, own = 0.02, OwnClient(section)
    while not select.select([alive], [], [], interval)[0]:
        if own.is_answered():
            interval = BEAT
            beat()
    on_end()


class OwnClient:
    """A client of our own broker that stays connected: it is answered also where the broker has no descriptor left for
    another one, and is not answered by a broker that stands still, for which the kernel accepts connections."""

    def __init__(self, section: MqttSection) -> None:
        self._section = section
        self._link: socket.socket | None = None

    def is_answered(self) -> bool:
        """Says hello, or pings where it is known; waits up to PATIENCE [s] for the answer."""
        try:
            if self._link is None:
                self._link = _wrapped(
                    self._section, socket.create_connection(self._section.listening, timeout=PATIENCE)
                )
                return self._exchange(CONNECT, CONNACK, 4)
            return self._exchange(PINGREQ, PINGRESP, 2)
        except OSError:
            self.leave()
            return False

    def _exchange(self, said: bytes, wanted: bytes, length: int) -> bool:
        assert self._link is not None
        self._link.sendall(said)
        answer = self._link.recv(length)
        # One that is refused, as a stranger to a locked broker, was answered too; it has no connection then.
        if answer[:1] != wanted or (wanted == CONNACK and answer[3:4] != b"\x00"):
            self.leave()
        return answer[:1] == wanted

    def leave(self) -> None:
        """Closes its connection; the next question makes another."""
        if self._link is not None:
            with contextlib.suppress(OSError):
                self._link.close()
            self._link = None


def _wrapped(section: MqttSection, link: socket.socket) -> socket.socket:
    if not section.secure_folder:
        return link
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    # It is our own broker, at our own address; one whose certificate has ended still answers.
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    return context.wrap_socket(link)
