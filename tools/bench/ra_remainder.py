"""`ra_remainder_steps`: what a sketch of dialect "ra" has not made of what it was sent, over conversions and passes."""

from __future__ import annotations

import itertools
import json
import random
from collections.abc import Iterator

from gemelo.firmware.platform.host.sketch import HostSketch
from gemelo.libraries.arm.motors.relative_moves import Loop, Ramp, ramp_of
from gemelo.schemas.robot import DeviceRecord
from gemelo.services.stepper_gateway.links.foreign.ra_messages import joints_message
from gemelo.services.stepper_gateway.links.foreign.ra_sender import RaSender
from gemelo.tools.bench.figures import Figure
from gemelo.tools.bench.scenes import rm1

MESSAGES = 10_000
LARGEST_MOVE = 20_000  # [steps] more than a turn of rm1's first joint
PASSES = (20e-6, 60e-6, 100e-6, 150e-6, 200e-6, 250e-6)  # [s] mean pass of the sketch's loop()
MESSAGE_TIMES = (1.0, 2.0, 5.0)  # [s]
LOOP = Loop(DeviceRecord(name="rm1").loop_time, DeviceRecord(name="rm1").telemetry_time)  # where nobody says another
STEP = 0.005  # [s] of virtual time
MOVED = 6  # messages' time that a path goes there and back


def ra_remainder_steps() -> Figure:
    """Steps sent minus steps made, the largest of all joints: of random messages, and of paths at every pass."""
    worst = max(*conversions(), *paths())
    note = (
        f"of {MESSAGES} random messages to a sketch that truncates and to one that rounds, with floats of 24 bits; and "
        f"of paths as fast as messages of {MESSAGE_TIMES[0]:g} to {MESSAGE_TIMES[-1]:g} s can follow, to loops of "
        f"{1e6 * PASSES[0]:g} to {1e6 * PASSES[-1]:g} us that publish 10 times a second"
    )
    return Figure(median=worst, p99=worst, goal="0", met=worst == 0, note=note)


def conversions() -> Iterator[int]:
    """[steps] left after all messages, by joint: degrees that the sketch does not turn into the steps meant."""
    rng = random.Random(3)
    ramps = tuple(ramp_of(joint.drive) for joint in rm1().joints)
    for truncates in (True, False):
        sketch, left = HostSketch(ramps, truncates), [0] * len(ramps)
        for _ in range(MESSAGES):
            move = [rng.randint(-LARGEST_MOVE, LARGEST_MOVE) for _ in ramps]
            message = json.loads(joints_message(move, ramps, False))
            left = [
                old + steps - sketch.steps(message[ramp.name], ramp)
                for old, steps, ramp in zip(left, move, ramps, strict=True)
            ]
        yield from map(abs, left)


def paths() -> Iterator[int]:
    """[steps] discarded, or left to make at the end, by ramp, message time and pass."""
    first = ramp_of(rm1().joints[0].drive)
    ramps = (first, first._replace(acceleration=3110.0), first._replace(speed=8000.0, acceleration=8000.0))
    for seed, case in enumerate(itertools.product(ramps, MESSAGE_TIMES, PASSES)):
        sketch, sender = driven(*case, seed)
        yield max(sketch.discarded, abs(sender.sent[0] - sketch.shafts[0]))


def driven(
    ramp: Ramp, message_time: float, pass_time: float, seed: int, loop: Loop = LOOP
) -> tuple[HostSketch, RaSender]:
    """Sketch and sender after a path there and back, as fast as messages of `message_time` [s] can follow.

    The sketch has passes of `pass_time` [s]; the sender believes in `loop`.
    """
    sketch, sender = HostSketch([ramp], pass_time=pass_time, seed=seed), RaSender([ramp], [0], loop)
    speed, end = ramp.path_speed(message_time, loop), MOVED * message_time
    now = 0.0
    while now < end + 4.0 * message_time:
        now += STEP
        if sketch.advance(now):
            sender.heard(now)
        commanded = round(speed * max(0.0, min(now, end - now)))
        move = sender.take([commanded], now > end, now)
        if move is not None:
            sketch.receive(joints_message(move, [ramp], False))
    return sketch, sender
