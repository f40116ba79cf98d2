"""The wire between gateway and board in memory: what MQTT does, with a delay, losses and cuts as they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue

from gemelo.firmware.bindings.device import CoreDevice
from gemelo.firmware.bindings.frames import OutFrame
from gemelo.firmware.platform.host.flash import NetworkCredentials
from gemelo.firmware.platform.host.link import REPORTS, Connected, Item, MqttMessage
from gemelo.firmware.platform.host.network import offline_status
from gemelo.schemas.simulation import WireConditions
from gemelo.services.stepper_gateway.links.connection import ReceiveQueue
from gemelo.services.stepper_gateway.links.link import FROM_DEVICE, Kind, Received
from gemelo.tools.simulation.virtual_clock import VirtualClock

# A broker keeps status, event and configuration until they are delivered. Heartbeats are spared because two lost ones
# hold the device, as they should: who wants that cuts the wire.
SPARED = (Kind.STATUS, Kind.EVENT, Kind.HB, Kind.CONFIG, Kind.CONFIG_ACK)
REPORT_KINDS = {kind.value: kind for kind in FROM_DEVICE if kind.value in REPORTS}
CUT = "the wire of the simulation is cut: `arm.sim.wire.restore()`"


class MemoryWire:
    """Both ends and what is between them; frames arrive in order, as over TCP."""

    def __init__(self, clock: VirtualClock, conditions: WireConditions) -> None:
        self.conditions = conditions
        self.is_cut = False
        self._clock = clock
        self.inbox: SimpleQueue[Item] = SimpleQueue()
        self._wake_board: Callable[[], None] = lambda: None
        self._link: MemoryLink | None = None
        self._last = {True: 0.0, False: 0.0}  # [s] monotonic when the last frame arrives, at the board and back
        self._is_joined = False  # the board
        self._status: bytes | None = None  # retained by the broker
        self._will = b""
        self.is_connected = False  # the board has been accepted

    # The gateway's end

    def link(self, wake: Callable[[], None]) -> MemoryLink:
        """The gateway's end, connected from now on."""
        self._link = MemoryLink(self, wake)
        if self._status is not None:
            self._to_gateway(Kind.STATUS, self._status, retained=True)
        return self._link

    def cut(self) -> None:
        """Nothing goes through any more, and the gateway knows it."""
        self.is_cut = True
        if self._link is not None:
            self._link.wake()

    def restore(self) -> None:
        """The gateway is connected again, and reads the status that the broker has kept."""
        self.is_cut = False
        if self._link is not None:
            self._link.wake()
            if self._status is not None:
                self._to_gateway(Kind.STATUS, self._status, retained=True)

    def from_gateway(self, kind: Kind, payload: bytes) -> bool:
        """False where the wire is cut."""
        if self.is_cut:
            return False
        if self._is_joined:
            self._fly(True, kind, lambda: self._at_board(kind, payload))
        return True

    # The board's end: what `Wires` asks of its network

    def attach(self, wake: Callable[[], None]) -> None:
        """`wake` is called when something has arrived for the board."""
        self._wake_board = wake

    def join(self, device: CoreDevice, name: str, credentials: NetworkCredentials) -> None:
        self.break_off()
        self._is_joined, self._will = True, offline_status(name, device.boot_id)
        self._clock.later(self.conditions.delay, self._accept)

    def break_off(self) -> None:
        """The board has vanished: the broker publishes its last will."""
        was_joined, self._is_joined, self.is_connected = self._is_joined, False, False
        if was_joined and self._status is not None:
            self._retain(self._will)

    def leave(self) -> None:
        self.break_off()

    def publish(self, frame: OutFrame) -> None:
        if not self.is_connected or frame.kind not in REPORT_KINDS:
            return
        kind = REPORT_KINDS[frame.kind]
        if kind is Kind.STATUS:
            return self._retain(frame.payload)
        self._to_gateway(kind, frame.payload)

    def on_connected(self) -> None:
        self.is_connected = True

    def on_disconnected(self, reason: str) -> None:
        self.is_connected = False

    def on_denied(self, reason: str) -> None:
        """There is no ACL here."""

    def subscribe_anew(self) -> None:
        """No subscription is ever lost here."""

    def take(self) -> list[Item]:
        """What has arrived for the board, oldest first."""
        items = []
        while not self.inbox.empty():
            items.append(self.inbox.get())
        return items

    def _accept(self) -> None:
        if self._is_joined and not self.is_connected:
            self.inbox.put(Connected())
            self._wake_board()

    def _retain(self, status: bytes) -> None:
        self._status = status
        self._to_gateway(Kind.STATUS, status)

    def _at_board(self, kind: Kind, payload: bytes) -> None:
        if self._is_joined:
            self.inbox.put(MqttMessage(str(kind), payload, False, self._clock.monotonic()))
            self._wake_board()

    def _to_gateway(self, kind: Kind, payload: bytes, retained: bool = False) -> None:
        link = self._link
        if link is not None and not self.is_cut:
            self._fly(False, kind, lambda: link.receive(kind, payload, retained))

    def _fly(self, to_board: bool, kind: Kind, arrive: Callable[[], None]) -> None:
        """Lets a frame arrive later, or never."""
        wire, is_spared = self.conditions, kind in SPARED
        if not is_spared and wire.loss and self._clock.draw() < wire.loss:
            return
        late = wire.delay + (self._clock.draw() * wire.jitter if wire.jitter and not is_spared else 0.0)
        now = self._clock.monotonic()
        due = self._last[to_board] = max(now + late, self._last[to_board])
        self._clock.later(due - now, lambda: None if self.is_cut else arrive())

    @property
    def now(self) -> float:
        """[s] monotonic."""
        return self._clock.monotonic()


class MemoryLink:
    """The gateway's end of the wire."""

    def __init__(self, wire: MemoryWire, wake: Callable[[], None]) -> None:
        self._wire, self.wake = wire, wake
        self._received = ReceiveQueue(wake)

    @property
    def connected(self) -> bool:
        return not self._wire.is_cut

    @property
    def reason(self) -> str:
        return CUT if self._wire.is_cut else ""

    def send(self, kind: Kind, payload: bytes, urgent: bool = False) -> bool:
        return self._wire.from_gateway(kind, payload)

    def take(self, most: int) -> list[Received]:
        return self._received.take(most)

    def close(self) -> None:
        pass

    def receive(self, kind: Kind, payload: bytes, retained: bool) -> None:
        """A frame has arrived."""
        arrival = round(self._wire.now * 1e9)
        self._received.put(Received(kind, payload, retained, arrival))
