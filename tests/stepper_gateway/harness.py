"""Moves for the gateway's tests, and the check that the device has kept every limit on its path."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise
from pathlib import Path

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import JointTrajectory, TrajectoryPoint
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits
from gemelo.services.stepper_gateway.motion.paths import profile
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1

ROOT = Path(__file__).resolve().parents[2]


def move(
    start: Vector, end: Vector, period: float = 0.05, slower: float = 1.0, arm: ArmDescription | None = None
) -> JointTrajectory:
    """A jerk-limited move from rest to rest in points of `period` seconds, as the planner makes them."""
    arm = arm or rm1()
    path = profile(Knot.at_rest(start), Knot.at_rest(end), Limits.of(arm.joints))
    assert path is not None
    count = max(1, round(path.duration / period))
    times = [path.duration * i / count for i in range(count + 1)]
    knots = [path.at(t) for t in times]
    points = [
        TrajectoryPoint(
            positions=knot.position,
            velocities=tuple(v / slower for v in knot.velocity),
            accelerations=tuple(a / slower**2 for a in knot.acceleration),
            time_from_start=t * slower,
        )
        for t, knot in zip(times, knots, strict=True)
    ]
    last = TrajectoryPoint(
        positions=end, velocities=(0.0,) * 3, accelerations=(0.0,) * 3, time_from_start=times[-1] * slower
    )
    points = points[:-1] if path.duration > 0.0 else []
    return JointTrajectory(joint_names=arm.joint_names, points=(*points, last))


@dataclass(frozen=True)
class Peak:
    """The largest speed and acceleration of one joint, as shares of its limits."""

    velocity: float
    acceleration: float


WINDOW = 40  # [ms] over which rates are taken
KNOT_NOISE = 3.0 / 256.0  # [steps] by which rounding to the wire may bend a window


def peaks(rig: VirtualArm, since: int = 0) -> list[Peak]:
    """Of the device's path from the millisecond `since` on; the wire's rounding is allowed for."""
    found = []
    seconds = WINDOW * 1e-3
    for column, joint in enumerate(rig.arm.joints):
        track = _without_starts([row[column] for row in rig.path[max(0, since - 1) :]])[min(since, 1) :]
        rates = [(track[i + WINDOW] - track[i]) / seconds for i in range(len(track) - WINDOW)]
        bends = [abs(rates[i + WINDOW] - rates[i]) / seconds for i in range(len(rates) - WINDOW)]
        noise = KNOT_NOISE / seconds
        speed = max(0.0, max(map(abs, rates), default=0.0) - noise)
        bend = max(0.0, max(bends, default=0.0) - noise / seconds)
        scale = joint.steps.per_unit
        found.append(Peak(speed / scale / joint.velocity, bend / scale / joint.acceleration))
    return found


def _without_starts(track: list[float]) -> list[float]:
    """A stream may begin up to a step beside where the path ended, at rest and without a pulse: no motion."""
    rises = [b - a for a, b in pairwise(track)]
    moved = [0.0 if before == 0.0 and 0.01 < abs(rise) <= 1.0 else rise for before, rise in pairwise([0.0, *rises])]
    return [track[0] + rise for rise in accumulate(moved, initial=0.0)]


def assert_within_limits(rig: VirtualArm, since: int = 0) -> None:
    """The device's path kept every limit and every slot was executed to half a step."""
    for joint, peak in zip(rig.arm.joints, peaks(rig, since), strict=True):
        assert peak.velocity <= 1.005, f"{joint.name} {peak}"
        assert peak.acceleration <= 1.1, f"{joint.name} {peak}"
    assert rig.device.max_slot_error <= 128
