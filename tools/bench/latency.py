"""Figures of latency on a running stack: chunk to acknowledgement, accepted goal to first step pulse."""

from __future__ import annotations

import json
import math
import statistics
import subprocess
import sys
import time

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import CommandAck, CommandChunk, DeviceEvent
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.planning import JointGoal, PlanRequest
from gemelo.schemas.topics import (
    COMMAND_ACKS,
    COMMANDS,
    DEVICE_EVENTS,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_STATES,
    JOINT_TARGETS,
    PLAN,
)
from gemelo.tools.bench.figures import Figure, FigureGoal, NotMeasured, of_samples, quantile, rounded
from gemelo.tools.bench.stack import Running, Stacks

CHUNKS = 600
CHUNK_RATE = 25.0  # [Hz] targets, each of which is a chunk that replaces the path
WARM_UP = 2.0  # [s] that is not counted
STREAMED_SWING, STREAMED_PERIOD = 0.4, 6.0  # [rad] or [m] of the first joint, [s]
FRAME_BYTES, REPLACE_BYTES, KNOT_BYTES, ACK_BYTES = 36, 16, 8, 48  # firmware/PROTOCOL.md
ECHO_FACTOR = 1.5  # of the bare echo's p99
TLS_FACTOR = 1.5  # of the plain connection's p99


def chunk_ack_ms(stacks: Stacks, broker: str) -> Figure:
    """Time [ms] from sending a chunk over MQTT to its acknowledgement, as the gateway measures it, during a motion.

    The reference is a bare echo of the same sizes at the same rate through the same broker at the same time.
    """
    running = stacks.with_broker(broker)
    size = chunk_bytes(running)
    echo = start_echo(running, size)
    acks = collect(running, CHUNKS / CHUNK_RATE)
    output, _ = echo.communicate(timeout=30.0)
    if echo.returncode:
        raise NotMeasured(f"the reference echo through {broker} failed")
    echoes: list[float] = json.loads(output)
    bound = ECHO_FACTOR * quantile(echoes, 0.99)
    took = [ack.round_trip * 1e3 for ack in acks]
    note = (
        f"{broker}, {len(took)} chunks of {size} bytes at {CHUNK_RATE:g} Hz, "
        f"{sum(ack.code > 1 for ack in acks)} refused; the echo ran at the same time "
        f"({len(echoes)} of {CHUNKS} came back); goal: 1.5 x the echo's p99"
    )
    reference = {"bare echo median": statistics.median(echoes), "bare echo p99": quantile(echoes, 0.99)}
    return of_samples(took, FigureGoal(p99=bound), reference, note)


def chunk_ack_tls_ms(stacks: Stacks) -> Figure:
    """The same over TLS with users and an ACL, after the same over a plain connection in this run."""
    plain = stacks.with_broker("mosquitto")
    device = plain.arm.device.name
    swing(plain, WARM_UP)
    without = [ack.round_trip * 1e3 for ack in collect(plain, CHUNKS / CHUNK_RATE)]
    locked = stacks.with_broker("mosquitto", device)
    swing(locked, WARM_UP)
    took = [ack.round_trip * 1e3 for ack in collect(locked, CHUNKS / CHUNK_RATE)]
    reference = {"plain median": statistics.median(without), "plain p99": quantile(without, 0.99)}
    note = (
        f"mosquitto with TLS, users and an ACL: {len(took)} chunks at {CHUNK_RATE:g} Hz, after {len(without)} without; "
        f"goal: {TLS_FACTOR:g} x the plain p99"
    )
    return of_samples(took, FigureGoal(p99=TLS_FACTOR * quantile(without, 0.99)), reference, note)


def chunk_bytes(running: Running) -> int:
    """Median size of a chunk on the wire [bytes]; raises NotMeasured if none is sent."""
    chunks: list[CommandChunk] = []
    running.node.subscribe(COMMANDS, chunks.append)
    swing(running, WARM_UP)
    if not chunks:
        raise NotMeasured("the gateway sent no chunk for a streamed target")
    knots = round(statistics.median(len(chunk.steps) for chunk in chunks))
    return FRAME_BYTES + REPLACE_BYTES * chunks[-1].replaces + KNOT_BYTES * len(running.arm.joints) * knots


def collect(running: Running, duration: float) -> list[CommandAck]:
    """All acknowledgements during `duration` [s] of motion; raises NotMeasured if there is none."""
    acks: list[CommandAck] = []
    running.node.subscribe(COMMAND_ACKS, acks.append)
    swing(running, duration)
    if not acks:
        raise NotMeasured("no chunk was acknowledged")
    return acks


def swing(running: Running, duration: float) -> None:
    """Streams a triangle wave on the first joint for `duration` [s]; the gateway rounds its corners."""
    targets = running.node.publisher(JOINT_TARGETS)
    joint = running.arm.joints[0].name
    began = time.monotonic()
    while (elapsed := time.monotonic() - began) < duration:
        phase = (elapsed / STREAMED_PERIOD) % 1.0
        position = STREAMED_SWING * (1.0 - 4.0 * abs(phase - 0.5))
        targets.put(JointTargets(stamp=running.node.now(), name=(joint,), position=(position,)))
        running.node.wait(1.0 / CHUNK_RATE)


def start_echo(running: Running, size: int) -> subprocess.Popen[str]:
    """Starts the bare echo with frames of `size` [bytes]; it prints its round trips."""
    numbers = {"port": running.deployment.mqtt.port, "bytes-there": size, "bytes-back": ACK_BYTES, "count": CHUNKS}
    options = [f"--{name}={value}" for name, value in numbers.items()]
    command = [sys.executable, "-m", "gemelo.tools.bench.traffic", "echo", *options, f"--rate={CHUNK_RATE}"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


START_GOAL = FigureGoal(median=25.0, p99=50.0)  # [ms]
START_ROUNDS = 40
SHARE = 0.95  # of the first joint's acceleration limit
RAMP = 0.2  # [s] of acceleration, and of deceleration
SWING = 0.05  # [rad] or [m] to either side of zero, for planned moves
GRID = 0.0002  # [s] to which the trajectory's own first step is found


def move_accept_to_first_step_ms(stacks: Stacks) -> Figure:
    """Time [ms] from accepting a goal to the first step pulse of the virtual ESP32 in real time.

    The device's `started` event has the time of the first step, mapped to this machine's clock by the gateway's clock
    synchronisation. The trajectories start with nearly the full acceleration from a whole step, so that their own first
    step is due as early as the limits allow. The planner's jerk-limited moves are a reference, with the time at which
    their own first step is due.
    """
    running = stacks.any_broker()
    started: list[DeviceEvent] = []

    def on_event(event: DeviceEvent) -> None:
        if event.event == "started":
            started.append(event)

    running.node.subscribe(DEVICE_EVENTS, on_event)
    states = running.node.latest(JOINT_STATES)

    def took(trajectory: JointTrajectory) -> float:
        """Time [ms] from acceptance to the first step; raises NotMeasured without a first step."""
        started.clear()
        accepted = follow(running, trajectory)
        if not started:
            raise NotMeasured("the device reported no first step")
        return (started[0].stamp - accepted) * 1e-6

    sharp, sharp_due, gentle, gentle_due = [], [], [], []
    for number in range(START_ROUNDS):
        running.node.wait(0.1)
        if states.message is None:
            raise NotMeasured("no joint states")
        trajectory = sharp_start(running.arm, states.message.position, (-1.0) ** number)
        sharp.append(took(trajectory))
        sharp_due.append(first_step_due(running.arm, trajectory) * 1e3)
    for number in range(START_ROUNDS // 2):
        trajectory = planned(running, SWING * (-1.0) ** number)
        gentle.append(took(trajectory))
        gentle_due.append(first_step_due(running.arm, trajectory) * 1e3)
    reference = {
        "planned (jerk-limited) move median": rounded(quantile(gentle, 0.5)),
        "its own first step due": rounded(quantile(gentle_due, 0.5)),
        "PAROL6's Python API median": 50.0,
    }
    note = (
        f"{START_ROUNDS} moves of one joint at {SHARE:.0%} of its acceleration from the start; their own first step is "
        f"due {rounded(quantile(sharp_due, 0.5)):g} ms after it, which is part of the figure; PAROL6: published"
    )
    return of_samples(sharp, START_GOAL, reference=reference, note=note)


def sharp_start(arm: ArmDescription, here: Vector, direction: float, ramp: float = RAMP) -> JointTrajectory:
    """The first joint from `here` [rad] or [m] with constant acceleration and deceleration of `ramp` [s] each."""
    joint = arm.joints[0]
    acceleration = SHARE * joint.acceleration * direction
    points = []
    for moment, share, speed in ((0.0, 0.0, 0.0), (ramp, 0.5, 1.0), (2 * ramp, 1.0, 0.0)):
        position = (here[0] + share * acceleration * ramp**2, *here[1:])
        velocity = (speed * acceleration * ramp, *(0.0 for _ in here[1:]))
        points.append(TrajectoryPoint(positions=position, velocities=velocity, time_from_start=moment))
    return JointTrajectory(joint_names=arm.joint_names, points=tuple(points))


def planned(running: Running, position: float) -> JointTrajectory:
    """The planner's trajectory to `position` [rad] or [m] of the first joint; raises NotMeasured if it refuses."""
    goal = JointGoal(name=(running.arm.joints[0].name,), position=(position,))
    plan = running.node.call(PLAN, PlanRequest(goal=goal), timeout=3.0)
    if plan.refusal is not None:
        raise NotMeasured(f"the planner refused: {plan.refusal.message}")
    return plan.trajectory


def follow(running: Running, trajectory: JointTrajectory) -> int:
    """Executes `trajectory`; returns the time of acceptance [ns UNIX]; raises NotMeasured unless it succeeds."""
    client = running.node.action(FOLLOW_JOINT_TRAJECTORY)
    handle = client.send(FollowJointTrajectoryGoal(trajectory=trajectory))
    outcome = handle.wait(30.0)
    if outcome.status is not GoalStatusCode.SUCCEEDED:
        raise NotMeasured(f"a move ended as {outcome.status.name}: {outcome.result and outcome.result.error_string}")
    running.node.wait(0.1)
    return handle.accepted


def first_step_due(arm: ArmDescription, trajectory: JointTrajectory) -> float:
    """Time [s] from the start until some joint's path, rounded to whole steps, leaves the steps it started on."""
    sampler = TrajectorySampler(trajectory)
    scales = [arm.joint(name).steps for name in trajectory.joint_names]

    def counts(moment: float) -> tuple[int, ...]:
        """Positions [steps], rounded to whole ones, at `moment` [s]."""
        positions = sampler.at(moment)[0]
        return tuple(math.floor(s.to_steps(p) + 0.5) for s, p in zip(scales, positions, strict=True))

    standing = counts(0.0)
    for index in range(int(sampler.duration / GRID) + 1):
        if counts(index * GRID) != standing:
            return index * GRID
    raise NotMeasured("the trajectory has no step")
