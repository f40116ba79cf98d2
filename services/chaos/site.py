"""The site: a stack of its own with a slow link before its broker, an arm on it, and strangers on both buses."""

from __future__ import annotations

import os
import shutil
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from functools import cached_property
from pathlib import Path
from random import Random
from types import TracebackType

from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

import gemelo
from firmware.platform.host.slot_record import VARIABLE
from schemas.deployment import Deployment, RouterSection
from schemas.topics import ACTIONS, CAMERA_TOPICS, TOPICS, Delivery
from services.arm.cell.cell_file import deployed_cell
from services.broker import mosquitto
from services.broker.replacement import NotInstalled
from services.chaos.clocks import ClockError, SteppingClocks
from services.chaos.slots import SlotFile
from services.chaos.slow_link import SlowLink
from services.chaos.small_disk import SmallDisk, may_mount
from services.mqtt.client import stop_loop
from services.runtime.actions.keys import feedback_topic, status_topic
from services.runtime.bus.zenoh_bus import ZenohBus
from services.runtime.deployment import load_deployment, project_root
from services.runtime.saved_parameters import SavedParameters
from services.stack.stack import PROCESSES, Stack, StackError, free_ports

EYES = ("camera", "detector")
KEPT = 200  # frames of the wire that can be said again
TO_CONNECT = 30.0  # [s] for the arm to be there


def program(process: str) -> str:
    """What is in the command line of a process of the stack."""
    return f"gemelo-{process.replace('_', '-')}"


def installed_broker() -> str:
    """mosquitto, or the embedded broker where mosquitto is not installed."""
    with suppress(NotInstalled):
        mosquitto.find()
        return "mosquitto"
    return "embedded"


def cell_of(deployment: Deployment) -> str:
    """The file of the cell around the arm: the deployment's, else the robot's own; empty where there is none."""
    own = f"{deployment.robot}/cell.toml"
    return deployment.cell or (own if (project_root() / own).is_file() else "")


def processes_of(deployment: Deployment) -> tuple[str, ...]:
    """What runs in chaos: everything, but for those that have nothing to do without a cell."""
    return tuple(name for name in PROCESSES if name not in EYES or cell_of(deployment))


class ChaosSite:
    """Starts on entering, stops on leaving; `out` gets recordings and logs.

    `is_judged`: `processes_of` the deployment run, clocks can step, and `out` gets the slots of the device; else only
    what a move needs, and what records and draws it. Raises `StackError` where it cannot.
    """

    def __init__(self, out: Path, broker: str, seed: int, is_judged: bool = True) -> None:
        out.mkdir(parents=True, exist_ok=True)
        self.slots = SlotFile(out / "slots")
        self._out = out
        self._port, self._broker_port = free_ports(2)
        self.stack = Stack(
            broker=broker,
            viewer="web" if is_judged else "none",
            panel=is_judged,
            out=out,
            environment={
                "GEMELO_MQTT_PORT": str(self._port),
                "GEMELO_MQTT_LISTEN_PORT": str(self._broker_port),
                "GEMELO_DEVICE": "virtual",
                "GEMELO_WIRE": "mqtt",
                **(self._judged() if is_judged else {}),
            },
        )
        self.disk: SmallDisk | None = None  # of the run folder alone, while the site stands; only root may mount one
        self._keep_all_recordings()
        self._seed = seed
        self._closing = ExitStack()

    def _judged(self) -> dict[str, str]:
        cell = cell_of(load_deployment())
        return {VARIABLE: str(self.slots.path), **self.clocks.environment, **({"GEMELO_CELL": cell} if cell else {})}

    @cached_property
    def clocks(self) -> SteppingClocks:
        """Of all that may run; made when first asked for, since that takes a compiler. Raises `StackError`."""
        try:
            return SteppingClocks(self._out, [*map(program, PROCESSES), "mosquitto"])  # which takes a broker's place
        except ClockError as error:
            raise StackError(str(error)) from error

    def __enter__(self) -> ChaosSite:
        with ExitStack() as closing:
            self.link = SlowLink(self._port, self._broker_port, self._seed)
            closing.callback(self.link.close)
            if may_mount():
                closing.callback(shutil.rmtree, self.stack.folder, ignore_errors=True)  # after the disk has gone
                self.disk = closing.enter_context(SmallDisk(self.stack.run))
                self._keep_all_recordings()
            closing.enter_context(self.stack)
            os.environ.update(self.stack.deployment)  # where the arm is found
            self.arm = closing.enter_context(self._connect())
            self.wire = WireStranger(self._broker_port)
            closing.callback(self.wire.close)
            cameras = deployed_cell(load_deployment()).camera_names
            self.bus = BusStranger(int(self.stack.deployment["GEMELO_ROUTER_PORT"]), self.arm.name, cameras)
            closing.callback(self.bus.close)
            self._closing = closing.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closing.close()

    def _keep_all_recordings(self) -> None:
        """None is removed: all are judged at the end."""
        SavedParameters(self.stack.run, "logger").keep({"keep_files": 0})

    def _connect(self) -> gemelo.Arm:
        """Raises `StackError` with the reason of each process that is not ready."""
        try:
            return gemelo.connect(name="chaos", timeout=TO_CONNECT)
        except gemelo.Error as error:
            unready = self.stack.why_not_ready()
            raise StackError("\n".join([f"no arm to move: {error}", *map(str, unready)]), unready) from error


class WireStranger:
    """A client of the broker that hears every frame, and says old, changed or meaningless ones."""

    def __init__(self, port: int) -> None:
        self._heard: deque[tuple[str, bytes]] = deque(maxlen=KEPT)
        self._client = Client(CallbackAPIVersion.VERSION2, client_id="chaos")
        self._client.on_connect = lambda client, *_: client.subscribe("gemelo/v1/#", qos=0)
        self._client.on_message = self._hear
        self._client.reconnect_delay_set(1, 2)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()

    def close(self) -> None:
        """Leaves the broker."""
        self._client.disconnect()
        stop_loop(self._client)

    def repeat(self, random: Random, count: int) -> None:
        """Says `count` of the newest frames once more."""
        self._say(self._some(random, count))

    def garble(self, random: Random, count: int) -> None:
        """Says `count` of the newest frames with some of their bytes changed."""
        self._say([(topic, _changed(random, frame)) for topic, frame in self._some(random, count) if frame])

    def noise(self, random: Random, count: int) -> None:
        """Says `count` frames of random bytes on topics that are in use."""
        self._say([(topic, random.randbytes(random.randrange(300))) for topic, _ in self._some(random, count)])

    def _some(self, random: Random, count: int) -> list[tuple[str, bytes]]:
        return [random.choice(self._heard) for _ in range(count) if self._heard]

    def _say(self, frames: list[tuple[str, bytes]]) -> None:
        for topic, frame in frames:
            self._client.publish(topic, frame, qos=0)

    def _hear(self, _client: Client, _data: object, message: MQTTMessage) -> None:
        self._heard.append((message.topic, bytes(message.payload)))


class BusStranger:
    """A participant of the bus that puts what nobody can read on every key."""

    def __init__(self, router_port: int, robot: str, cameras: Sequence[str]) -> None:
        self._bus = ZenohBus(RouterSection(port=router_port), robot)
        seen = [make(camera) for camera in cameras for make in CAMERA_TOPICS]
        actions = [make(action) for action in ACTIONS for make in (feedback_topic, status_topic)]
        self._keys: list[tuple[str, str, Delivery]] = [
            (topic.key, topic.message.__name__, topic.delivery) for topic in (*TOPICS, *seen, *actions)
        ]

    def close(self) -> None:
        """Leaves the bus."""
        self._bus.close()

    def noise(self, random: Random) -> None:
        """Random bytes on every key, under its own schema's name or another."""
        for key, schema, delivery in self._keys:
            publication = self._bus.publish(key, random.choice((schema, "", "Nonsense")), delivery)
            publication.put(random.randbytes(random.randrange(300)))
            publication.close()


def _changed(random: Random, frame: bytes) -> bytes:
    changed = bytearray(frame)
    for _ in range(random.randint(1, 4)):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)
