"""Floods of the bus and of the wire, in processes of their own: what a stop has to get through.

`python -m services.bench.flood WHAT --port PORT --robot NAME --rate 5000 --seconds 10` ends by itself.
"""

from __future__ import annotations

import argparse
import itertools
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import msgspec

from schemas.actions import GoalRequest
from schemas.device import (
    ConfigureRequest,
    DeviceCommandRequest,
    DeviceStopRequest,
    PressKind,
    PressRequest,
    ResetCommand,
    StopKind,
)
from schemas.joints import JointTargets
from schemas.message import Message, encode
from schemas.motion import FollowJointTrajectoryGoal
from schemas.planning import PlanRequest
from schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_CONFIGURE,
    DEVICE_PRESS,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_TARGETS,
    PLAN,
)
from services.bench.echo import connected
from services.runtime.zenoh_bus import ZenohBus

RATE = 5000.0  # [1/s]
BURST = 0.005  # [s] between two bursts: a sleep is not much more exact
WARM_UP = 1.0  # [s] until the flood has risen
GOAL = GoalRequest(goal_id="flood", client="flood", goal=msgspec.Raw(encode(FollowJointTrajectoryGoal())))
REQUESTS: dict[str, tuple[tuple[str, Message], ...]] = {
    "requests": (
        (DEVICE_COMMAND.key, DeviceCommandRequest(command=ResetCommand())),
        (DEVICE_CONFIGURE.key, ConfigureRequest()),
        (DEVICE_PRESS.key, PressRequest(press=PressKind.SENSOR)),
        (f"{FOLLOW_JOINT_TRAJECTORY.key}/goal", GOAL),
        (PLAN.key, PlanRequest()),
    ),
    "commands": ((DEVICE_COMMAND.key, DeviceCommandRequest(command=ResetCommand())),),
    "holds": ((DEVICE_STOP.key, DeviceStopRequest(kind=StopKind.HOLD)),),
}


@contextmanager
def flood(what: str, port: int, robot: str, seconds: float, rate: float = RATE) -> Iterator[None]:
    """Runs one in the background, from when it has risen to the end of the block."""
    options = ["--port", str(port), "--robot", robot, "--rate", str(rate), "--seconds", str(seconds)]
    process = subprocess.Popen([sys.executable, "-m", "services.bench.flood", what, *options], stdout=subprocess.PIPE)
    try:
        assert process.stdout is not None
        process.stdout.readline()  # it has begun
        time.sleep(WARM_UP)
        yield
    finally:
        process.terminate()
        process.wait()


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=[*REQUESTS, "targets", "mqtt"])
    parser.add_argument("--port", type=int, required=True, help="of the router; for mqtt of the broker")
    parser.add_argument("--robot", required=True)
    parser.add_argument("--rate", type=float, default=RATE, help="[1/s]")
    parser.add_argument("--seconds", type=float, required=True)
    options = parser.parse_args()
    send = _mqtt(options.port, options.robot) if options.what == "mqtt" else _bus(options.what, options)
    print("begun", flush=True)
    _pace(send, options.rate, options.seconds)


def _bus(what: str, options: argparse.Namespace) -> Callable[[], None]:
    bus = ZenohBus("127.0.0.1", options.port, options.robot)
    if what == "targets":
        publication = bus.publish(JOINT_TARGETS.key, JointTargets.__name__, JOINT_TARGETS.delivery)
        payload = encode(JointTargets())
        return lambda: publication.put(payload)
    asked = itertools.cycle([(key, type(message).__name__, encode(message)) for key, message in REQUESTS[what]])

    def ask() -> None:
        key, schema, payload = next(asked)
        bus.ask(key, schema, payload, 1.0, lambda answer: None)

    return ask


def _mqtt(port: int, robot: str) -> Callable[[], None]:
    """Junk where the gateway listens."""
    client = connected(port, "gemelo-bench/nothing", "flood")
    topic, payload = f"gemelo/v1/{robot}/state", bytes(100)

    def publish() -> None:
        client.publish(topic, payload, qos=0)

    return publish


def _pace(send: Callable[[], None], rate: float, seconds: float) -> None:
    """Calls `send` at `rate` [1/s] on average, in small bursts, for so long [s]."""
    began, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - began) < seconds:
        while sent < elapsed * rate:
            send()
            sent += 1
        time.sleep(BURST)


if __name__ == "__main__":
    main()
