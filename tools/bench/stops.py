"""The figure of a stop: from the client's call to the command frame on the wire, and to rest, under load.

An MQTT client beside the device watches the wire, so the broker's own time is part of the figure.
"""

from __future__ import annotations

import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from queue import Empty, SimpleQueue

from paho.mqtt.client import Client, MQTTMessage

from gemelo.libraries.mqtt.client import stop_loop
from gemelo.libraries.runtime.bus.interface import BusReply
from gemelo.libraries.runtime.bus.zenoh_bus import ZenohBus
from gemelo.schemas.device import (
    ConfigureRequest,
    DeviceCommandKind,
    DeviceCommandResponse,
    DeviceStopRequest,
    InjectKind,
    InjectRequest,
    StopKind,
)
from gemelo.schemas.joints import JointState
from gemelo.schemas.message import decode, encode
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.topics import DEVICE_CONFIGURE, DEVICE_INJECT, DEVICE_STOP, FOLLOW_JOINT_TRAJECTORY, JOINT_STATES
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile, rounded
from gemelo.tools.bench.latency import sharp_start
from gemelo.tools.bench.stack import Running, Stacks, families
from gemelo.tools.bench.traffic import FORGED, GARBAGE, OURS, SESSIONS, connected, flood

GOAL = FigureGoal(p99=20.0)  # [ms]
CALLS = 200  # for each condition in which the device answers
CALLS_TO_A_FROZEN_DEVICE = 20  # each waits 2 s for its answer
CALLS_TO_A_FROZEN_BROKER = 3  # as well
MOVES = 5  # stopped in each condition in which the arm can move
RAMP = 0.8  # [s] of acceleration: the arm is stopped during it
SPEED = 0.01  # [rad/s] below which the arm stands
PATIENCE = 3.0  # [s]
FLOOD_SECONDS = 60.0  # at the most
FLOODS = (
    "requests",
    "commands",
    "holds",
    "stops",
    f"{FORGED}requests",
    f"{FORGED}holds",
    f"{FORGED}stops",
    GARBAGE,
    SESSIONS,
)
STOPPING = ("holds", "stops", f"{FORGED}holds", f"{FORGED}stops")
NEVER_MOVING = ("planner frozen", *(f"flood of {what}" for what in STOPPING))  # conditions in which no move begins
SLEEP = 0.002  # [s] of the thread that measures how late the bench itself wakes


class StopWire:
    """Receives every STOP frame."""

    def __init__(self, port: int, device: str) -> None:
        self._frames: SimpleQueue[float] = SimpleQueue()
        self._client = connected(port, f"gemelo/v1/{device}/cmd", "wire")
        self._client.on_message = self._on_message

    def _on_message(self, client: Client, userdata: object, message: MQTTMessage) -> None:
        arrived = time.monotonic()
        if message.payload[20] == DeviceCommandKind.STOP:
            self._frames.put(arrived)

    def next(self, since: float) -> float:
        """Time [s monotonic] of the first frame after `since`; raises NotMeasured after PATIENCE."""
        while True:
            try:
                at = self._frames.get(timeout=PATIENCE)
            except Empty:
                raise NotMeasured("a stop did not reach the wire") from None
            if at >= since:
                return at

    def close(self) -> None:
        self._client.disconnect()
        stop_loop(self._client)


class StopCaller:
    """A client that calls for stops, and for what may delay them."""

    def __init__(self, running: Running) -> None:
        router = running.deployment.router
        self._running = running
        self.bus = ZenohBus(router, running.arm.name)
        self.wire = StopWire(running.deployment.mqtt.port, running.arm.device.name)
        self.states = running.node.latest(JOINT_STATES)

    def stop(self) -> float:
        """Time [ms] from one call to the wire."""
        answers: SimpleQueue[object] = SimpleQueue()
        payload = encode(DeviceStopRequest(kind=StopKind.STOP))
        called = time.monotonic()
        self.bus.ask(DEVICE_STOP.key, DeviceStopRequest.__name__, payload, PATIENCE, answers.put, True)
        seen = self.wire.next(called)
        answers.get(timeout=2 * PATIENCE)  # a stop that is not answered yet would absorb the next one
        return (seen - called) * 1e3

    def stop_that_cannot_leave(self) -> float:
        """Time [ms] from one call to the answer that it was not carried out; raises NotMeasured for another answer."""
        answers: SimpleQueue[BusReply | None] = SimpleQueue()
        payload = encode(DeviceStopRequest(kind=StopKind.STOP))
        called = time.monotonic()
        self.bus.ask(DEVICE_STOP.key, DeviceStopRequest.__name__, payload, 2 * PATIENCE, answers.put, True)
        answer = answers.get(timeout=3 * PATIENCE)
        took = (time.monotonic() - called) * 1e3
        if answer is None or not answer.ok or decode(DeviceCommandResponse, answer.payload).accepted:
            raise NotMeasured(f"a stop with the broker frozen was answered with {answer}")
        return took

    def stops(self, count: int) -> list[float]:
        """Times [ms] of `count` calls, one after the other."""
        return [self.stop() for _ in range(count)]

    def stops_of_moves(self) -> list[float]:
        """Times [ms] from a call during a move to the first state at rest, for MOVES moves."""
        return [self._stop_of_a_move() for _ in range(MOVES)]

    def _stop_of_a_move(self) -> float:
        node = self._running.node
        here = self._until(lambda state: abs(state.velocity[0]) < SPEED).position
        trajectory = sharp_start(self._running.arm, here, -math.copysign(1.0, here[0]), RAMP)
        goal = FollowJointTrajectoryGoal(trajectory=trajectory)
        handle = node.action(FOLLOW_JOINT_TRAJECTORY).send(goal)
        self._until(lambda state: abs(state.velocity[0]) > SPEED)
        called = time.time_ns()
        self.stop()
        stood = self._until(lambda state: state.stamp > called and abs(state.velocity[0]) < SPEED)
        handle.wait(PATIENCE)
        return (stood.stamp - called) * 1e-6

    def _until(self, holds: Callable[[JointState], bool]) -> JointState:
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            self._running.node.wait(0.005)
            if self.states.message is not None and holds(self.states.message):
                return self.states.message
        raise NotMeasured("the arm neither moved nor stood in time")

    def wait_for_states(self) -> None:
        """Returns once the device says its state now; raises NotMeasured if it does not."""
        asked = time.time_ns()
        self._until(lambda state: state.stamp > asked)

    def leave_unanswered(self) -> None:
        """Sends a configuration and twenty presses, which a frozen device does not answer."""
        for request in (ConfigureRequest(), *(InjectRequest(kind=InjectKind.SENSOR) for _ in range(20))):
            key = (DEVICE_CONFIGURE if isinstance(request, ConfigureRequest) else DEVICE_INJECT).key
            self.bus.ask(key, type(request).__name__, encode(request), PATIENCE, lambda answer: None)

    def close(self) -> None:
        self.wire.close()
        self.bus.close()


class WakeUps:
    """Measures in a thread how late the bench's own process gets the processor: that is in every figure of a stop."""

    def __init__(self) -> None:
        self.late: list[float] = []  # [ms]
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="wake-ups", daemon=True)

    def __enter__(self) -> WakeUps:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._is_over.is_set():
            due = time.monotonic() + SLEEP
            time.sleep(SLEEP)
            self.late.append((time.monotonic() - due) * 1e3)


def stop_ms(stacks: Stacks) -> Figure:
    """Time [ms] from the call of a stop to its frame on the wire, in the worst of all conditions."""
    running = stacks.with_broker("mosquitto")
    router, broker, robot = running.deployment.router.port, running.deployment.mqtt.port, running.arm.name
    caller = StopCaller(running)
    under: dict[str, AbstractContextManager[None]] = {
        "idle": nullcontext(),
        **{f"flood of {what}": flood(what, router, robot, FLOOD_SECONDS) for what in FLOODS},
        "loop of commands, by a client of ours": flood(OURS, router, robot, FLOOD_SECONDS),
        "flood of targets": flood("targets", router, robot, FLOOD_SECONDS),
        "flood of MQTT": flood("mqtt", broker, running.arm.device.name, FLOOD_SECONDS),
        "planner frozen": _frozen(running, "planner"),
    }
    wire: dict[str, list[float]] = {}
    rest: dict[str, list[float]] = {}
    late: dict[str, list[float]] = {}
    try:
        for name, condition in under.items():
            with condition:
                with WakeUps() as wake_ups:
                    wire[name] = caller.stops(CALLS)
                late[name] = wake_ups.late
                if name not in NEVER_MOVING:
                    rest[name] = caller.stops_of_moves()
        wire["device frozen, configure and 20 presses unanswered"] = _to_a_frozen_device(running, caller)
        to_answer, after_thaw = _to_a_frozen_broker(running, caller)
    finally:
        caller.close()
    worst = max(wire, key=lambda name: quantile(wire[name], 0.99))
    reference = {f"{name} p99": quantile(samples, 0.99) for name, samples in wire.items()}
    at_rest = quantile(wire["idle"], 0.99)
    reference |= {f"{name}, times the idle p99": quantile(samples, 0.99) / at_rest for name, samples in wire.items()}
    reference["broker frozen, to the answer that it was not carried out, median"] = quantile(to_answer, 0.5)
    reference["broker frozen, from its thaw to the stop on the wire, median"] = quantile(after_thaw, 0.5)
    reference |= {f"{name}, the bench itself woke late p99": quantile(samples, 0.99) for name, samples in late.items()}
    reference |= {f"to rest, {name}, median": quantile(samples, 0.5) for name, samples in rest.items()}
    note = (
        f"the worst condition is given: {worst}; load average {os.getloadavg()[0]:.1f}; "
        f"{CALLS} calls each, broker mosquitto, floods of 5,000 a second from a process on the same cores that keeps "
        "to no pace, a loop from one that does; p99 is "
        f"{rounded(quantile(wire[worst], 0.99) / at_rest):g} times that of the idle stack"
    )
    return of_samples(wire[worst], GOAL, reference, note)


def _to_a_frozen_device(running: Running, caller: StopCaller) -> list[float]:
    with _frozen(running, "virtual_esp32"):
        took = []
        for _ in range(CALLS_TO_A_FROZEN_DEVICE):
            caller.leave_unanswered()
            took.append(caller.stop())
        return took


def _to_a_frozen_broker(running: Running, caller: StopCaller) -> tuple[list[float], list[float]]:
    """Times [ms] of stops from the call to the answer while the broker is frozen, and from its thaw to the wire."""
    to_answer, after_thaw = [], []
    for _ in range(CALLS_TO_A_FROZEN_BROKER):
        caller.wait_for_states()
        with _frozen(running, "broker"):
            called = time.monotonic()
            to_answer.append(caller.stop_that_cannot_leave())
        thawed = time.monotonic()
        after_thaw.append((caller.wire.next(called) - thawed) * 1e3)
    return to_answer, after_thaw


@contextmanager
def _frozen(running: Running, name: str) -> Iterator[None]:
    """Stops a process of the stack and its children, for the block."""
    pids = [process.pid for process in families(running.stack)[name]]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)
