"""From sending a chunk over MQTT to its acknowledgement, as the gateway measures it, while the arm tracks a sine.

The reference is a bare echo of the same sizes at the same rate through the same broker at the same time.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time

from schemas.device import CommandAck, CommandChunk
from schemas.joints import JointTargets
from schemas.topics import COMMAND_ACKS, COMMANDS, JOINT_TARGETS
from services.bench.figure import Figure, Goal, NotMeasured, of_samples, quantile
from services.bench.stacks import Running, Stacks

UNIT = "ms"
CHUNKS = 600
RATE = 25.0  # [Hz] chunks of 2 knots of 20 ms
WARM_UP = 2.0  # [s] that is not counted
SWING, PERIOD = 0.4, 6.0  # [rad] or [m] of the first joint, [s]
FRAME_BYTES, KNOT_BYTES, ACK_BYTES = 36, 8, 48  # firmware/PROTOCOL.md
FACTOR = 1.5


def measure(stacks: Stacks, broker: str = "mosquitto") -> Figure:
    running = stacks.with_broker(broker)
    size = chunk_bytes(running)
    echo = start_echo(running, size)
    acks = collect(running, CHUNKS / RATE)
    output, _ = echo.communicate(timeout=30.0)
    if echo.returncode:
        raise NotMeasured(f"the reference echo through {broker} failed")
    echoes: list[float] = json.loads(output)
    bound = FACTOR * quantile(echoes, 0.99)
    took = [ack.round_trip * 1e3 for ack in acks]
    note = (
        f"{broker}, {len(took)} chunks of {size} bytes at {RATE:g} Hz, {sum(ack.code > 1 for ack in acks)} refused; "
        f"the echo ran at the same time ({len(echoes)} of {CHUNKS} came back); goal: 1.5 x the echo's p99"
    )
    reference = {"bare echo median": statistics.median(echoes), "bare echo p99": quantile(echoes, 0.99)}
    return of_samples(took, UNIT, Goal(p99=bound), reference, note)


def chunk_bytes(running: Running) -> int:
    """The usual size of a chunk on the wire [bytes], from some that are sent."""
    chunks: list[CommandChunk] = []
    running.node.subscribe(COMMANDS, chunks.append)
    swing(running, WARM_UP)
    if not chunks:
        raise NotMeasured("the gateway sent no chunk for a streamed target")
    return FRAME_BYTES + KNOT_BYTES * len(running.arm.joints) * round(statistics.median(len(c.steps) for c in chunks))


def collect(running: Running, duration: float) -> list[CommandAck]:
    """All acknowledgements while the arm swings."""
    acks: list[CommandAck] = []
    running.node.subscribe(COMMAND_ACKS, acks.append)
    swing(running, duration)
    if not acks:
        raise NotMeasured("no chunk was acknowledged")
    return acks


def swing(running: Running, duration: float) -> None:
    """A triangle on the first joint, streamed at 10 Hz; its corners are the gateway's to round."""
    targets = running.node.publisher(JOINT_TARGETS)
    joint = running.arm.joints[0].name
    began = time.monotonic()
    while (elapsed := time.monotonic() - began) < duration:
        phase = (elapsed / PERIOD) % 1.0
        position = SWING * (1.0 - 4.0 * abs(phase - 0.5))
        targets.put(JointTargets(stamp=running.node.now(), name=(joint,), position=(position,)))
        running.node.wait(0.1)


def start_echo(running: Running, size: int) -> subprocess.Popen[str]:
    numbers = {"port": running.deployment.mqtt.port, "bytes-there": size, "bytes-back": ACK_BYTES, "count": CHUNKS}
    options = [f"--{name}={value}" for name, value in numbers.items()]
    command = [sys.executable, "-m", "services.bench.echo", *options, f"--rate={RATE}"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
