"""Every wire keeps the same promises: at once or not at all, in order, nothing stale, and a reason when it is down."""

from __future__ import annotations

import contextlib
import os
import threading
import time
import tty
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Protocol

import pytest
from paho.mqtt import client as paho
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.runtime.serial_frames import JsonFrame, PacketDecoder, json_frame, packet, parse_json_frame
from gemelo.services.stepper_gateway.links.frames import (
    Ack,
    CommandFrame,
    CommandReply,
    Heartbeat,
    StateFrame,
    SyncReply,
    decode,
    encode,
)
from gemelo.services.stepper_gateway.links.link import FROM_DEVICE, TO_DEVICE, Kind, Link, Received
from gemelo.services.stepper_gateway.links.mqtt import MqttLink
from gemelo.services.stepper_gateway.links.serial import FRAMES, TYPES, SerialLink
from tests.stepper_gateway.processes import BROKER, Processes
from tests.stepper_gateway.wired import plain

TEXT = b'{"some": "text"}'
SAID = {  # something of every kind that a device says
    Kind.STATE: encode(StateFrame(boot_id=1, t_us=5, mode=3, steps=(1, 2, 3), velocity=(0, 0, 0))),
    Kind.TRAJ_ACK: encode(Ack(boot_id=1, stream=2, seq=0, next_seq=1, code=0)),
    Kind.CMD_ACK: encode(CommandReply(boot_id=1, cmd_id=3, cmd=1, code=0, mode=3, t_us=9)),
    Kind.SYNC_R: encode(SyncReply(boot_id=1, t0=1, t1=2, t2=3)),
}


class Peer(Protocol):
    """The device's side of a wire."""

    def say(self, kind: Kind, payload: bytes) -> None: ...

    def heard(self) -> list[tuple[Kind, bytes]]: ...

    def cut(self) -> None:
        """The wire is gone."""

    def mend(self) -> None:
        """It is back, under the same name."""

    def close(self) -> None: ...


class MqttPeer:
    """A bare client of a real broker."""

    def __init__(self, folder: Path) -> None:
        self._processes = Processes("mosquitto", folder)
        self._heard: list[tuple[Kind, bytes]] = []
        self._client: paho.Client | None = None
        self.mend()

    def link(self, wake: Callable[[], None]) -> Link:
        return MqttLink(plain(self._processes.port), "rm1", wake)

    def say(self, kind: Kind, payload: bytes) -> None:
        assert self._client is not None
        self._client.publish(f"gemelo/v1/rm1/{kind}", payload, 1)

    def heard(self) -> list[tuple[Kind, bytes]]:
        return self._heard

    def cut(self) -> None:
        self._end()
        self._processes.kill(BROKER)

    def mend(self) -> None:
        self._processes.start_broker()
        subscribed = threading.Event()
        client = paho.Client(CallbackAPIVersion.VERSION2)
        client.on_connect = lambda *_: client.subscribe([(f"gemelo/v1/rm1/{kind}", 1) for kind in TO_DEVICE])
        client.on_subscribe = lambda *_: subscribed.set()
        client.on_message = lambda _client, _data, message: self._heard.append(
            (Kind(message.topic.removeprefix("gemelo/v1/rm1/")), message.payload)
        )
        client.connect("127.0.0.1", self._processes.port)
        client.loop_start()
        assert subscribed.wait(60.0)
        self._client = client

    def close(self) -> None:
        self._end()
        self._processes.close()

    def _end(self) -> None:
        if self._client is not None:
            self._client.disconnect()
            self._client.loop_stop()
            self._client = None


class SerialPeer:
    """The far end of a pseudo-terminal, reached by a stable path."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "board"
        self._heard: list[tuple[Kind, bytes]] = []
        self._packets = PacketDecoder()
        self._ours = self._theirs = -1
        self.mend()

    def link(self, wake: Callable[[], None]) -> Link:
        return SerialLink(str(self.path), 921_600, wake)

    def say(self, kind: Kind, payload: bytes) -> None:
        self.write(packet(json_frame(FRAMES[kind], payload) if kind in FRAMES else payload))

    def write(self, data: bytes) -> None:
        os.write(self._ours, data)

    def heard(self) -> list[tuple[Kind, bytes]]:
        with contextlib.suppress(BlockingIOError, OSError):
            for frame in self._packets.feed(os.read(self._ours, 65_536)):
                text = parse_json_frame(frame)
                kind = Kind(JsonFrame(text.kind).name.lower()) if text is not None else _frame_kind(frame)
                self._heard.append((kind, text.text if text is not None else frame))
        return self._heard

    def cut(self) -> None:
        self.path.unlink()
        self.close()

    def mend(self) -> None:
        self._ours, theirs = os.openpty()
        tty.setraw(theirs)
        os.set_blocking(self._ours, False)
        self.path.symlink_to(os.ttyname(theirs))
        self._theirs = theirs

    def close(self) -> None:
        for descriptor in (self._ours, self._theirs):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._ours = self._theirs = -1


def _frame_kind(frame: bytes) -> Kind:
    return Kind(
        type(decode(frame))
        .__name__.lower()
        .replace("heartbeat", "hb")
        .replace("chunk", "traj")
        .replace("commandframe", "cmd")
    )


@pytest.fixture(params=[MqttPeer, SerialPeer])
def peer(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[MqttPeer | SerialPeer]:
    with closing(request.param(tmp_path)) as found:
        yield found


class Bench:
    """A link and whatever wakes for it."""

    def __init__(self, peer: MqttPeer | SerialPeer) -> None:
        self.woken = threading.Event()
        self.link = peer.link(self.woken.set)
        self.received: list[Received] = []

    def until(self, is_true: Callable[[], bool], seconds: float = 60.0) -> bool:
        end = time.monotonic() + seconds
        while not is_true():
            if time.monotonic() > end:
                return False
            self.woken.wait(0.05)
            self.woken.clear()
            self.received += self.link.take(64)
        return True

    def close(self) -> None:
        self.link.close()


@pytest.fixture
def bench(peer: MqttPeer | SerialPeer) -> Iterator[Bench]:
    with closing(Bench(peer)) as found:
        assert found.until(lambda: found.link.connected), found.link.reason
        yield found


def test_what_the_device_says_arrives_as_it_was_with_its_kind_and_time(peer: Peer, bench: Bench) -> None:
    before = time.monotonic_ns()
    said = [(kind, SAID.get(kind, TEXT)) for kind in FROM_DEVICE]
    for kind, payload in said:
        peer.say(kind, payload)
    assert bench.until(lambda: len(bench.received) >= len(said))
    assert sorted((r.kind, r.payload) for r in bench.received) == sorted(said)
    assert all(before <= r.arrival <= time.monotonic_ns() and not r.retained for r in bench.received)


def test_the_device_hears_everything_once_and_in_order(peer: Peer, bench: Bench) -> None:
    beats = [encode(Heartbeat(session=1, counter=i)) for i in range(100)]
    assert bench.link.send(Kind.CONFIG, TEXT)
    assert all(bench.link.send(Kind.HB, beat) for beat in beats)
    assert bench.link.send(Kind.INJECT, TEXT)
    assert bench.until(lambda: len(peer.heard()) >= 102)
    assert [payload for kind, payload in peer.heard() if kind == Kind.HB] == beats
    assert (Kind.CONFIG, TEXT) in peer.heard()
    assert (Kind.INJECT, TEXT) in peer.heard()


def test_a_wire_that_is_cut_says_so_sends_nothing_and_comes_back_empty(peer: Peer, bench: Bench) -> None:
    peer.cut()
    assert bench.until(lambda: not bench.link.connected)
    assert not bench.link.send(Kind.HB, encode(Heartbeat(session=1, counter=666)))
    assert bench.until(lambda: any(word in str(bench.link.reason) for word in ("broker", "there is no serial port")))
    peer.mend()
    assert bench.until(lambda: bench.link.connected)
    assert bench.link.reason is None
    last = encode(Heartbeat(session=1, counter=7))
    assert bench.link.send(Kind.HB, last)
    assert bench.until(lambda: bool(peer.heard()))
    assert peer.heard() == [(Kind.HB, last)]
    peer.say(Kind.STATE, SAID[Kind.STATE])
    assert bench.until(lambda: bool(bench.received))


def test_a_stop_needs_no_room_and_overtakes_what_waits_for_a_slow_line(board: SerialPeer) -> None:
    with closing(Bench(board)) as bench:
        assert bench.until(lambda: bench.link.connected)
        waiting = 0
        while bench.link.send(Kind.CONFIG, b'"' + b"x" * 1000 + b'"'):
            waiting += 1
        stop = encode(CommandFrame(boot_id=0, cmd_id=1, expires_us=0, cmd=3))
        assert bench.link.send(Kind.CMD, stop, urgent=True)
        assert bench.until(lambda: len(board.heard()) == waiting + 1)
        place = [kind for kind, _ in board.heard()].index(Kind.CMD)
        assert place < waiting - 5  # only what the kernel had taken already went before it


def test_a_link_ends_when_it_is_closed(peer: Peer, bench: Bench) -> None:
    bench.link.close()
    assert not bench.link.connected
    assert not bench.link.send(Kind.HB, b"x")
    assert not [thread for thread in threading.enumerate() if thread.name in ("mqtt-link", "serial-link")]


@pytest.fixture
def board(tmp_path: Path) -> Iterator[SerialPeer]:
    with closing(SerialPeer(tmp_path)) as found:
        yield found


def test_garbage_on_the_line_costs_itself_only_and_is_counted(board: SerialPeer) -> None:
    with closing(Bench(board)) as bench:
        assert bench.until(lambda: bench.link.connected)
        board.write(b"ets Jul 29 2019 12:21:46\r\nrst:0x1 (POWERON_RESET)\r\n\xff\x03\x80")
        board.say(Kind.STATE, SAID[Kind.STATE])
        damaged = bytearray(packet(SAID[Kind.STATE]))
        damaged[9] ^= 0x40
        board.write(bytes(damaged))
        board.say(Kind.STATUS, TEXT)
        assert bench.until(lambda: any(r.kind == Kind.STATUS for r in bench.received))
        good = [r.payload for r in bench.received if r.payload in (TEXT, SAID[Kind.STATE])]
        assert good == [SAID[Kind.STATE], TEXT]
        assert len(bench.received) == 4


def test_a_port_that_cannot_be_had_says_why_and_what_to_do(board: SerialPeer, tmp_path: Path) -> None:
    with closing(Bench(board)) as first, closing(Bench(board)) as second:
        assert first.until(lambda: first.link.connected or second.link.connected)
        other = second if first.link.connected else first
        assert other.until(lambda: "another program holds" in str(other.link.reason))
    (tmp_path / "file").write_text("no port")
    with closing(SerialLink(str(tmp_path / "file"), 921_600, lambda: None)) as link:
        end = time.monotonic() + 60.0
        while "cannot be used" not in str(link.reason) and time.monotonic() < end:
            time.sleep(0.05)
        assert "[serial] device" in str(link.reason)


def test_every_kind_has_its_frame_on_a_serial_line() -> None:
    assert set(TYPES.values()) | set(FRAMES) == set(Kind) - {Kind.TRAJ, Kind.CMD, Kind.HB, Kind.SYNC}
