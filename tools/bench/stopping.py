"""The figures of the stopping distance: what the gateway has said against what the device then did, in virtual time.

`python -m gemelo.tools.bench.stopping` measures 1,000 holds.

In a random moment of a random motion over a random wire all is lost: the gateway falls silent, and what is on its way
arrives or not. The way of the tool from there until it rests is measured on the device's own path, slot by slot.
"""

from __future__ import annotations

import math
import random
from itertools import pairwise
from typing import NamedTuple

import msgspec

from gemelo.libraries.arm.kinematics.tool_jacobian import ToolJacobian
from gemelo.libraries.arm.model.description import ArmDescription, Joint
from gemelo.schemas.device import DeviceCommandKind
from gemelo.schemas.ledger import StoppingDistance
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.schemas.topics import STOPPING_DISTANCE
from gemelo.tools.bench.figures import Figure, NotMeasured, quantile, rounded
from gemelo.tools.bench.scenes import rm1
from gemelo.tools.virtual_arm.gateway_driver import asked
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire

HOLDS = 1000
QUICK = 100  # holds of `make bench`
MOST_CAREFUL = 1.3  # the goal: said distance / true one, in the median
NEAR = 0.001  # [m] distances below it say nothing about care: a step of the arm is as long
LONGEST = 6.0  # [s] that any stop takes
SMOOTH = 0.02  # [s] between points of a move
STEP = 2000  # [us] between two places of the way


class MeasuredHold(NamedTuple):
    """What was said when all was lost, and what came."""

    said: StoppingDistance
    distance: float  # [m] of the tool's true way
    duration: float  # [s]


def stopping_distance(holds: int = QUICK) -> Figure:
    """Said distance / true distance over random holds; no true one may be longer than the said one."""
    found = [lost_in_motion(seed) for seed in range(holds)]
    ratios = [hold.said.distance / hold.distance for hold in found if hold.distance >= NEAR]
    if not ratios:
        raise NotMeasured("in no hold did the tool move on")
    longer = sum(hold.distance > hold.said.distance for hold in found)
    later = sum(hold.duration > hold.said.duration for hold in found)
    median = quantile(ratios, 0.5)
    note = (
        f"virtual time, {holds} random holds; longer than said: {longer}; later than said: {later}; smallest ratio "
        f"{min(ratios):.3f}; true way median {1e3 * quantile([hold.distance for hold in found], 0.5):.0f} mm, longest "
        f"{1e3 * max(hold.distance for hold in found):.0f} mm"
    )
    care = [hold.said.duration / hold.duration for hold in found if hold.duration > 0.02]
    return Figure(
        median=rounded(median),
        p99=rounded(quantile(ratios, 0.99)),
        goal=f"median < {MOST_CAREFUL}, none longer",
        met=median < MOST_CAREFUL and longer == 0 and later == 0,
        reference={"said time / true time, median": rounded(quantile(care, 0.5))},
        note=note,
    )


def lost_in_motion(seed: int) -> MeasuredHold:
    """One hold in a motion of rm1; the same for the same seed."""
    rng, arm = random.Random(seed), rm1()
    wire = VirtualWire(delay=rng.uniform(0.0003, 0.01), jitter=rng.uniform(0.0, 0.008), is_ordered=True, spared=())
    start = _place(arm, rng)
    rig = VirtualArm(
        wire, seed=seed, start=start, arm=arm, phase_us=rng.randrange(0, 20_000, STEP), step_us=STEP
    ).ready()
    rig.run(rng.uniform(0.0, 0.2))
    duration = _set_off(rig, rng)
    rig.run(rng.uniform(0.0, max(0.1, duration)))
    told = len(rig.messages(STOPPING_DISTANCE))
    rig.run(1.0, lambda: len(rig.messages(STOPPING_DISTANCE)) > told)
    return _lose_all(rig, rng)


def _set_off(rig: VirtualArm, rng: random.Random) -> float:
    """Begins a random motion: a move, a slowed one, one after another, or a streamed target; how long [s] it takes."""
    goal = _place(rig.arm, rng)
    kind = rng.random()
    if kind < 0.2:
        rig.target(**dict(zip(rig.arm.joint_names, goal, strict=True)))
        return 0.4  # silence ends it
    if kind < 0.3:
        rig.ask(asked(DeviceCommandKind.SPEED, scale=rng.uniform(0.2, 0.9)))
        rig.run(0.3)
    trajectory = smooth_move(rig.arm, rig.position, goal, rng.uniform(1.0, 3.0))
    verdict = rig.goal(trajectory)
    if not verdict.accepted:
        raise NotMeasured(f"a move was refused: {verdict.reason}")
    return trajectory.points[-1].time_from_start


def smooth_move(arm: ArmDescription, start: Vector, end: Vector, slower: float) -> JointTrajectory:
    """From rest to rest (n,) along a quintic in time, `slower` times, dimensionless, as long as the limits allow."""
    duration = 0.2
    for joint, a, b in zip(arm.joints, start, end, strict=True):
        span = abs(b - a)
        duration = max(duration, 1.875 * span / joint.velocity, math.sqrt(5.774 * span / joint.acceleration))
        duration = max(duration, (60.0 * span / joint.jerk) ** (1.0 / 3.0))
    duration *= 1.01 * slower
    count = max(2, round(duration / SMOOTH))
    points = tuple(_point(start, end, i / count, duration) for i in range(count + 1))
    return JointTrajectory(joint_names=arm.joint_names, points=points)


def _point(start: Vector, end: Vector, u: float, duration: float) -> TrajectoryPoint:
    place = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    rate = 30.0 * u * u * (1.0 - u) ** 2 / duration
    bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / duration**2
    spans = [b - a for a, b in zip(start, end, strict=True)]
    return TrajectoryPoint(
        positions=tuple(a + place * span for a, span in zip(start, spans, strict=True)),
        velocities=tuple(rate * span for span in spans),
        accelerations=tuple(bend * span for span in spans),
        time_from_start=u * duration,
    )


def random_place(joint: Joint, rng: random.Random, share: float = 0.9) -> float:
    """A position [rad] or [m] within the middle `share` of the joint's limits."""
    return joint.lower + (joint.upper - joint.lower) * (0.5 + share * rng.uniform(-0.5, 0.5))


def _place(arm: ArmDescription, rng: random.Random) -> Vector:
    return tuple(random_place(joint, rng) for joint in arm.joints)


def _lose_all(rig: VirtualArm, rng: random.Random) -> MeasuredHold:
    said: StoppingDistance = rig.messages(STOPPING_DISTANCE)[-1]
    rig.gateway_is_on = False
    if rng.random() < 0.5:
        rig.drop()
    since, began = len(rig.path) - 1, rig.now
    if not rig.run(LONGEST, lambda: not rig.device.moving):
        raise NotMeasured("the arm did not come to rest")
    return MeasuredHold(said, *_way(rig, since, began))


def _way(rig: VirtualArm, since: int, began: float) -> tuple[float, float]:
    """[m] of the tool's way along the device's path, and [s] until the last slot in which it moved."""
    jacobian = ToolJacobian(rig.arm)
    scales = [joint.steps for joint in rig.arm.joints]
    rows = rig.path[since:]
    places = [
        jacobian.tool([scale.to_position(count) for scale, count in zip(scales, row, strict=True)]) for row in rows
    ]
    moved = [index for index, (a, b) in enumerate(pairwise(rows), 1) if a != b]
    return sum(math.dist(a, b) for a, b in pairwise(places)), 1e-6 * STEP * (moved[-1] if moved else 0)


def main() -> None:
    """Prints the figure of 1,000 holds."""
    print(msgspec.json.format(msgspec.json.encode(stopping_distance(HOLDS)), indent=2).decode())


if __name__ == "__main__":
    main()
