"""MQTT and bus traffic from processes of its own: a bare MQTT echo as a reference, and floods against a stop.

`python -m gemelo.tools.bench.traffic echo --port ... --bytes-there ...` prints round trips [ms] as JSON: QoS 1 there as
chunks are sent, QoS 0 back as they are acknowledged, TCP_NODELAY on both sides.
`python -m gemelo.tools.bench.traffic flood WHAT --port PORT --robot NAME --rate 5000 --seconds 10` ends by itself.
"""

from __future__ import annotations

import argparse
import itertools
import json
import multiprocessing
import socket
import struct
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import msgspec
from paho.mqtt.client import Client, MQTTMessage
from paho.mqtt.enums import CallbackAPIVersion

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.libraries.runtime.bus.pace import Pace, Rate
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.libraries.runtime.errors import BusError
from gemelo.schemas.actions import GoalRequest
from gemelo.schemas.deployment import RouterSection
from gemelo.schemas.device import (
    ConfigureRequest,
    DeviceCommandRequest,
    DeviceStopRequest,
    InjectKind,
    InjectRequest,
    SpeedCommand,
    StopKind,
)
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Message, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import PlanRequest
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_CONFIGURE,
    DEVICE_INJECT,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_TARGETS,
    PLAN,
)

THERE, BACK = "gemelo-bench/there", "gemelo-bench/back"
PATIENCE = 5.0  # [s] for a connection
_COUNT = struct.Struct("<I")
RATE = 5000.0  # [1/s]
BURST = 0.005  # [s] between two bursts: a sleep is hardly more exact
WARM_UP = 1.0  # [s] until the flood has its full rate
NO_PACE = Rate(1e9, 1_000_000)  # of a client that is not ours; `OURS` is flooded by one that is
OURS = "loop"
GOAL = GoalRequest(goal_id="flood", client="flood", goal=msgspec.Raw(encode(FollowJointTrajectoryGoal())))
REQUESTS: dict[str, tuple[tuple[str, Message], ...]] = {
    "requests": (
        (DEVICE_COMMAND.key, DeviceCommandRequest(command=SpeedCommand())),
        (DEVICE_CONFIGURE.key, ConfigureRequest()),
        (DEVICE_INJECT.key, InjectRequest(kind=InjectKind.SENSOR)),
        (f"{FOLLOW_JOINT_TRAJECTORY.key}/goal", GOAL),
        (PLAN.key, PlanRequest()),
    ),
    OURS: ((DEVICE_COMMAND.key, DeviceCommandRequest(command=SpeedCommand())),),
    "commands": ((DEVICE_COMMAND.key, DeviceCommandRequest(command=SpeedCommand())),),
    "holds": ((DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.HOLD)),),
    "stops": ((DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.STOP)),),
}
FORGED = "forged "  # before one of these: each request under another name
GARBAGE, SESSIONS = "garbage connections", "sessions"  # at the router's port
RATES = {
    GARBAGE: 30.0,
    SESSIONS: 250.0,
}  # [1/s] of those: more than twice the 12, and the 1,000 in 4 s, that kept others
MOST_SESSIONS = 1000  # from joining; so many are kept open, and then ended and opened anew
MOST_GARBAGE = 50  # connections that are kept open
NO_HANDSHAKE = b"GET / HTTP/1.1\r\n\r\n"
SHORTLY = 0.3  # [s] for the router to take a connection


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser()
    kinds = parser.add_subparsers(dest="kind", required=True)
    echo = kinds.add_parser("echo")
    echo.add_argument("--port", type=int, required=True)
    echo.add_argument("--bytes-there", type=int, required=True)
    echo.add_argument("--bytes-back", type=int, required=True)
    echo.add_argument("--rate", type=float, required=True, help="[Hz]")
    echo.add_argument("--count", type=int, required=True)
    flood = kinds.add_parser("flood")
    forged = [FORGED + what for what in REQUESTS]
    flood.add_argument("what", choices=[*REQUESTS, *forged, GARBAGE, SESSIONS, "targets", "mqtt"])
    flood.add_argument("--port", type=int, required=True, help="of the router; for mqtt of the broker")
    flood.add_argument("--robot", required=True)
    flood.add_argument("--rate", type=float, default=RATE, help="[1/s]")
    flood.add_argument("--seconds", type=float, required=True)
    options = parser.parse_args()
    _echo(options) if options.kind == "echo" else _flood(options)


def _echo(options: argparse.Namespace) -> None:
    ready = multiprocessing.Event()
    echo = multiprocessing.Process(target=serve, args=(options.port, options.bytes_back, ready), daemon=True)
    echo.start()
    if not ready.wait(PATIENCE):
        sys.exit("the echo did not connect")
    print(json.dumps(ask(options.port, options.bytes_there, options.rate, options.count)))
    echo.terminate()
    echo.join()


def send_at_once(client: Client, userdata: object, opened: Any) -> None:
    """Sets TCP_NODELAY: Nagle's algorithm and delayed acknowledgements would cost 40 ms."""
    opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


def connected(port: int, subscribe_to: str, name: str) -> Client:
    """A client with TCP_NODELAY that has subscribed to `subscribe_to`; exits the process if it cannot."""
    client = Client(CallbackAPIVersion.VERSION2, client_id=f"bench-{name}-{time.time_ns()}")
    subscribed = threading.Event()
    client.on_socket_open = send_at_once
    client.on_connect = lambda c, userdata, flags, code, properties: c.subscribe(subscribe_to, qos=1)
    client.on_subscribe = lambda c, userdata, message, codes, properties: subscribed.set()
    client.connect("127.0.0.1", port)
    client.loop_start()
    if not subscribed.wait(PATIENCE):
        sys.exit("no subscription")
    return client


def serve(port: int, size: int, ready: threading.Event) -> None:
    """Answers every message with `size` [bytes] until the process ends."""
    filler = bytes(size - _COUNT.size)
    client = connected(port, THERE, "echo")

    def on_message(client: Client, userdata: object, message: MQTTMessage) -> None:
        client.publish(BACK, bytes(message.payload[: _COUNT.size]) + filler, qos=0)

    client.on_message = on_message
    ready.set()
    threading.Event().wait()


def ask(port: int, size: int, rate: float, count: int) -> list[float]:
    """Round trip times [ms] of those of `count` messages of `size` [bytes] at `rate` [Hz] that were answered."""
    sent: dict[int, float] = {}
    took: list[float] = []

    def on_message(client: Client, userdata: object, message: MQTTMessage) -> None:
        number = _COUNT.unpack(message.payload[: _COUNT.size])[0]
        took.append((time.perf_counter() - sent[number]) * 1e3)

    client = connected(port, BACK, "ask")
    client.on_message = on_message
    filler = bytes(size - _COUNT.size)
    began = time.perf_counter()
    for number in range(count):
        time.sleep(max(0.0, began + number / rate - time.perf_counter()))
        sent[number] = time.perf_counter()
        client.publish(THERE, _COUNT.pack(number) + filler, qos=1)
    time.sleep(0.5)
    client.disconnect()
    stop_loop(client)
    return took


@contextmanager
def flood(what: str, port: int, robot: str, seconds: float) -> Iterator[None]:
    """Sends `what` at its rate [1/s], for most RATE, from another process, until the block ends."""
    rate = RATES.get(what, RATE)
    options = ["--port", str(port), "--robot", robot, "--rate", str(rate), "--seconds", str(seconds)]
    process = subprocess.Popen(
        [sys.executable, "-m", "gemelo.tools.bench.traffic", "flood", what, *options], stdout=subprocess.PIPE
    )
    try:
        assert process.stdout is not None
        process.stdout.readline()  # it has begun
        time.sleep(WARM_UP)
        yield
    finally:
        process.terminate()
        process.wait()


def _flood(options: argparse.Namespace) -> None:
    match options.what:
        case "mqtt":
            send = _mqtt(options.port, options.robot)
        case what if what == GARBAGE:
            send = _garbage(options.port)
        case what if what == SESSIONS:
            send = _sessions(options.port, options.robot)
        case what:
            send = _bus(what, options)
    print("begun", flush=True)
    _pace(send, options.rate, options.seconds)


def _bus(what: str, options: argparse.Namespace) -> Callable[[], None]:
    bus = ZenohBus(RouterSection(port=options.port), options.robot, None if what == OURS else Pace(NO_PACE))
    if what == "targets":
        publication = bus.publish(JOINT_TARGETS.key, JointTargets.__name__, JOINT_TARGETS.delivery, "flood")
        payload = encode(JointTargets())
        return lambda: publication.put(payload)
    asked = itertools.cycle(
        [(key, type(message).__name__, encode(message)) for key, message in REQUESTS[what.removeprefix(FORGED)]]
    )

    def ask() -> None:
        key, schema, payload = next(asked)
        if what.startswith(FORGED):
            bus.take_new_name()
        bus.ask(key, schema, payload, 1.0, lambda answer: None)

    return ask


def _garbage(port: int) -> Callable[[], None]:
    """Connects to the router and sends what is no handshake."""
    kept: deque[socket.socket] = deque()

    def connect() -> None:
        with suppress(OSError):
            opened = socket.create_connection(("127.0.0.1", port), SHORTLY)
            kept.append(opened)
            opened.send(NO_HANDSHAKE)
        if len(kept) > MOST_GARBAGE:
            kept.popleft().close()

    return connect


def _sessions(port: int, robot: str) -> Callable[[], None]:
    """Opens sessions of the bus, up to as many as the router takes, and then ends them all."""
    kept: list[ZenohBus] = []

    def join() -> None:
        try:
            kept.append(ZenohBus(RouterSection(port=port), robot))
            is_full = len(kept) >= MOST_SESSIONS
        except BusError:
            is_full = True
        if is_full:
            while kept:
                kept.pop().close()

    return join


def _mqtt(port: int, robot: str) -> Callable[[], None]:
    """Publishes invalid states on the topic that the gateway subscribes to."""
    client = connected(port, "gemelo-bench/nothing", "flood")
    topic, payload = f"gemelo/v1/{robot}/state", bytes(100)

    def publish() -> None:
        client.publish(topic, payload, qos=0)

    return publish


def _pace(send: Callable[[], None], rate: float, seconds: float) -> None:
    """Calls `send` at `rate` [1/s] on average, in small bursts, for `seconds`."""
    began, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - began) < seconds:
        while sent < elapsed * rate:
            send()
            sent += 1
        time.sleep(BURST)


if __name__ == "__main__":
    main()
