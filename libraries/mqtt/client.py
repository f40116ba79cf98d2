"""paho's client, made for one broker: password, TLS, MQTT 5 where the broker speaks it, and why it failed."""

from __future__ import annotations

import contextlib
import logging
import socket
import ssl
import struct
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager

from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion, MQTTErrorCode
from paho.mqtt.reasoncodes import ReasonCode

from gemelo.libraries.mqtt.access import BrokerAccess

log = logging.getLogger("mqtt")

CONNECT_TIMEOUT = 2.0  # [s]
OLD_BROKER = 132  # CONNACK: Unsupported protocol version
NO_ANSWER = 141  # DISCONNECT: Keep alive timeout


class Waker(socket.socket):
    """The socket by which paho wakes its thread for what is queued; not for a thread that writes it itself."""

    writer = 0  # the thread that does
    count = 0  # how often it has woken paho's

    def send(self, data: object, flags: int = 0, /) -> int:
        if threading.get_ident() == self.writer:
            return 0
        self.count += 1
        return super().send(data, flags)  # type: ignore[arg-type]


class MqttClient(paho.Client):
    """A client whose session ends with its connection; it keeps the error that made a connection fail."""

    def __init__(
        self, access: BrokerAccess, client_id: str, *, speaks_5: bool = True, reconnect_on_failure: bool = False
    ) -> None:
        super().__init__(
            CallbackAPIVersion.VERSION2,
            client_id=client_id,
            clean_session=None if speaks_5 else True,
            protocol=paho.MQTTv5 if speaks_5 else paho.MQTTv311,
            reconnect_on_failure=reconnect_on_failure,
        )
        if access.user:
            self.username_pw_set(access.user, access.password or None)
        self._tls = access.tls
        if access.tls is not None:
            self.tls_set_context(access.tls)
        self.connect_timeout = CONNECT_TIMEOUT
        self.on_socket_open = _send_at_once
        self.failure: OSError | None = None  # of the newest connection
        self._writing = threading.RLock()  # two that write parts of frames would mix them
        # OpenSSL does not let one thread read from a connection while another writes to it; TCP does.
        self._tls_turn: AbstractContextManager[object] = threading.RLock() if access.tls else contextlib.nullcontext()

    @property
    def speaks_5(self) -> bool:
        """True if the broker says by MQTT 5 what came of a message."""
        return self.protocol == paho.MQTTv5

    def speak_older(self) -> None:
        """MQTT 3.1.1 from the next connection on."""
        self._protocol, self._clean_session = paho.MQTTv311, True

    def write_now(self) -> None:
        """Writes what is queued, as far as the socket takes it without blocking; from any thread.

        paho's thread has to be woken and to wait for its turn among the threads of the process: in a flood tens of
        milliseconds. It still writes what the socket did not take at once, and handles every error.
        """
        with self._writing:
            self._packet_write()

    @property
    def _sockpairW(self) -> socket.socket | None:  # noqa: N802 - paho's name
        return self.waker

    @_sockpairW.setter
    def _sockpairW(self, waker: socket.socket | None) -> None:  # noqa: N802 - before paho's thread begins
        self.waker = None if waker is None else Waker(fileno=waker.detach())
        if self.waker is not None:
            self.waker.setblocking(False)

    @contextlib.contextmanager
    def written_here(self) -> Iterator[None]:
        """What is published in it is written by this thread at its end; paho's is woken for what the socket does not
        take at once, or where the connection has failed. For one thread."""
        waker = self.waker
        if waker is None:
            yield
            return
        waker.writer = threading.get_ident()
        try:
            yield
            self.write_now()
        finally:
            waker.writer = 0
            if self.want_write():
                with contextlib.suppress(OSError):  # full: it is woken already; closed: it has ended
                    waker.send(b"0")

    def loop_write(self) -> MQTTErrorCode:
        """As paho's; its thread calls it."""
        with self._writing:
            return super().loop_write()

    def loop_start(self) -> MQTTErrorCode:
        """As paho's; raises OSError, and leaves no connection open, where its thread gets no descriptor to wake it."""
        try:
            return super().loop_start()
        except OSError as error:
            self.failure = error
            self._sock_close()
            raise

    def loop_stop(self) -> MQTTErrorCode:
        """As paho's, by `stop_loop`."""
        return stop_loop(self)

    def reconnect(self) -> MQTTErrorCode:
        """As paho's; keeps the error of a connection that cannot be made."""
        self.failure = None
        try:
            return super().reconnect()
        except OSError as error:
            self.failure = error
            raise

    def _packet_handle(self) -> MQTTErrorCode:
        """As paho's, whose thread ends without a word at a topic that is no UTF-8: a packet that is none ends the
        connection (MQTT 3.1.1, 1.5.3 and 4.8), and another one is made."""
        try:
            return super()._packet_handle()
        except (ValueError, IndexError, struct.error) as error:
            log.warning("what the broker at %s:%d says is no MQTT (%s): connecting anew", self.host, self.port, error)
            return MQTTErrorCode.MQTT_ERR_PROTOCOL

    def _ssl_wrap_socket(self, tcp_sock: socket.socket) -> ssl.SSLSocket:
        """As paho's, which leaves a connection open whose handshake has failed."""
        assert self._tls is not None
        wrapped = self._tls.wrap_socket(tcp_sock, server_hostname=self.host, do_handshake_on_connect=False)
        try:
            wrapped.settimeout(CONNECT_TIMEOUT)
            wrapped.do_handshake()
        except OSError:
            wrapped.close()
            raise
        return wrapped

    def _sock_recv(self, bufsize: int) -> bytes:
        """As paho's; the alerts of TLS 1.3 come with the first bytes, not with the handshake."""
        try:
            with self._tls_turn:
                return super()._sock_recv(bufsize)
        except ssl.SSLError as error:
            self.failure = error
            raise

    def _sock_send(self, buf: bytes | bytearray) -> int:
        with self._tls_turn:
            return super()._sock_send(buf)


def stop_loop(client: paho.Client) -> MQTTErrorCode:
    """`loop_stop` of paho's, which at times fails where a disconnect went before: its thread, ending by itself, takes
    itself away between two looks at it."""
    with contextlib.suppress(AttributeError):
        return paho.Client.loop_stop(client)
    return MQTTErrorCode.MQTT_ERR_SUCCESS


def is_failure(reason: object) -> bool:
    """True for a reason code by which a broker says no."""
    return isinstance(reason, ReasonCode) and reason.is_failure


def code_of(reason: object) -> int:
    """The number of a reason code."""
    return int(reason.value) if isinstance(reason, ReasonCode) else 0


def _send_at_once(_client: paho.Client, _data: object, sock: object) -> None:
    # Without it Nagle's algorithm and delayed acknowledgements cost 20 to 40 ms a frame.
    if isinstance(sock, socket.socket):
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
