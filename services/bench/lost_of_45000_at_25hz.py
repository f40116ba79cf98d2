"""How many of 45,000 chunks at 25 Hz are lost: half an hour of motion, in virtual time.

The gateway's core and the firmware's core are the real ones; the wire between them delays and delivers in order, as TCP
does. Lost is a chunk that the device never acknowledged; the step counts are compared as well.
"""

from __future__ import annotations

import math

from schemas.device import CommandAck, CommandChunk
from schemas.message import Message
from schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from services.arm.description import Arm
from services.bench.arms import rm1
from services.bench.figure import Figure, NotMeasured
from services.bench.virtual_arm import DELAY, VirtualArm

UNIT = "chunks"
CHUNKS = 45_000
SECONDS = 60.0  # of one goal; one after another until all chunks are sent
PERIOD, POINT = 6.0, 0.1  # [s] of the swing, [s] between points
SPEED_SHARE = 0.5  # of the limits


class Tally:
    """Chunks sent and acknowledged."""

    def __init__(self) -> None:
        self.sent: set[tuple[int, int]] = set()
        self.acknowledged: set[tuple[int, int]] = set()
        self.refused = 0
        self.last: tuple[int, ...] = ()  # [1/256 step] of the last knot sent

    def on_message(self, message: Message) -> None:
        match message:
            case CommandChunk():
                self.sent.add((message.stream, message.seq))
                self.last = message.steps[-1]
            case CommandAck() if message.code in (0, 1):
                self.acknowledged.add((message.stream, message.seq))
            case CommandAck():
                self.refused += 1


def measure() -> Figure:
    arm, tally = rm1(), Tally()
    world = VirtualArm(arm, tally.on_message)
    world.run(1.0)
    trajectory = swinging(arm, SECONDS)
    goals = 0
    while len(tally.sent) < CHUNKS:
        goals += 1
        goal = FollowJointTrajectoryGoal(trajectory=trajectory)
        verdict, outputs = world.gateway.on_goal(f"goal-{goals}", goal, world.moment)
        world.carry_out(outputs)
        if not verdict.accepted:
            raise NotMeasured(f"goal {goals} was refused: {verdict.reason}")
        world.run(SECONDS + 1.0)
    missing = [abs(((q8 + 128) >> 8) - made) for q8, made in zip(tally.last, world.device.steps, strict=True)]
    lost = len(tally.sent - tally.acknowledged)
    note = (
        f"virtual time: {world.now * 1e-6:.0f} s, {len(tally.sent)} chunks in {goals} goals, {tally.refused} refused "
        f"and sent again, a wire of {DELAY[0] / 1e3:g} to {DELAY[1] / 1e3:g} ms; {sum(missing)} steps missing at the "
        f"end, largest |commanded - executed| at any slot end {world.device.max_slot_error / 256:.3f} steps"
    )
    return Figure(
        unit=UNIT, median=float(lost), p99=float(lost), goal="0 lost, 0 steps missing", met=lost + sum(missing) == 0,
        reference={"seed: mean round trip at 12.5 Hz [ms]": 29.8}, note=note,
    )  # fmt: skip


def swinging(arm: Arm, seconds: float) -> JointTrajectory:
    """All joints from rest at zero, to and fro, back to rest at zero; velocities with the points."""
    amplitudes = [amplitude_of(arm, index) for index in range(len(arm.joints))]
    rate = math.tau / PERIOD
    points = []
    for index in range(round(seconds / POINT) + 1):
        time = index * POINT
        points.append(
            TrajectoryPoint(
                positions=tuple(a * (1.0 - math.cos(rate * time)) for a in amplitudes),
                velocities=tuple(a * rate * math.sin(rate * time) if 0.0 < time < seconds else 0.0 for a in amplitudes),
                time_from_start=time,
            )
        )
    return JointTrajectory(joint_names=arm.joint_names, points=tuple(points))


def amplitude_of(arm: Arm, index: int) -> float:
    """[rad] or [m], half of what the joint may do."""
    joint, rate = arm.joints[index], math.tau / PERIOD
    fastest = SPEED_SHARE * min(joint.velocity / rate, joint.acceleration / rate**2)
    return min(fastest, 0.45 * joint.upper)
