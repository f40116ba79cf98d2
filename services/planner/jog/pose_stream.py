"""Joint targets for streamed poses of the tool: the nearest configuration, by steps from the one before.

Newton's steps through the damped inverse of the Jacobian, as far as the joints can go until then: the arm never leaves
its branch, and singularities slow it as they slow a jog.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from gemelo.libraries.arm.kinematics.kinematics import FramePose, Kinematics
from gemelo.schemas.errors import ReasonedError
from gemelo.schemas.message import Vector
from gemelo.schemas.planning import JogLimit, PoseTarget
from gemelo.schemas.reasons import because
from gemelo.services.planner.jog.jog_limits import joint_limit, singularity, speed_limit
from gemelo.services.planner.jog.twist import TwistSolver

Array = NDArray[np.float64]

# Tuning constants: chosen, where a line does not say measured or standard.
PAUSE = 0.5  # [s] between two targets, after which a stream begins anew where the arm is
SHORTEST, LONGEST = 0.005, 0.1  # [s] between two targets, for what the joints can do meanwhile
ROUNDS = 5  # of Newton's method: quadratic, so that a step of one period needs two or three
MET = 1e-6  # [m] and [rad] that are no error
HALVINGS = 6  # of a step towards a singularity: to a sixty-fourth
MISSED = (0.005, 0.05)  # [m] and [rad] that the tool is away from a target that it does not reach
WAY = 0.02  # of what the joints could do, below which the arm makes no way
PATIENCE = 0.25  # [s] without way, after which a target is out of reach
FARTHEST = 100.0  # [m] from the base; what is farther loses its digits


class BadPose(ReasonedError, ValueError):
    """A target that is no pose; the reason names what is wrong with it."""


class Posed(NamedTuple):
    """Where a target leads."""

    position: Vector  # [rad] or [m]
    scale: float  # share of the way to the target that the joints go now
    limits: tuple[JogLimit, ...]


class PoseStream:
    """Of one arm; times are [s] of one monotonic clock."""

    def __init__(self, kinematics: Kinematics) -> None:
        self._kinematics, self._twists = kinematics, TwistSolver(kinematics)
        self._joints = kinematics.arm.joints
        self._speeds = np.array([joint.velocity for joint in self._joints])
        self._lower = np.array([joint.lower for joint in self._joints])
        self._upper = np.array([joint.upper for joint in self._joints])
        self._positions: Array | None = None  # (n,) where the newest target has led
        self._rotation: Array = np.eye(3)  # of the newest target
        self._time = self._on_way = -1.0e9  # of the newest target, and when the arm last came nearer

    def begins(self, now: float) -> bool:
        """True if a target at `now` [s] is the first of a stream."""
        return self._positions is None or now - self._time > PAUSE

    def take(self, pose: PoseTarget, present: Vector, now: float) -> Posed:
        """The joint values for a target at `now` [s], of an arm that is at `present` [rad] or [m]; raises `BadPose`."""
        require_pose(pose)
        if self.begins(now) or self._positions is None:
            self._positions = np.array(present)
            self._rotation = self._kinematics.tool(self._positions).rotation
            self._time, self._on_way = now - LONGEST, now
        if pose.orientation:
            self._rotation = pin.Quaternion(np.array(pose.orientation)).normalized().matrix()
        target = FramePose(np.array(pose.position), self._rotation)
        dt = max(SHORTEST, min(now - self._time, LONGEST))
        self._time = now
        found, scale, limits = self._nearer(self._positions, target, dt)
        made = float(np.max(np.abs(found - self._positions) / self._speeds)) / dt
        self._positions = found
        return Posed(tuple(found.tolist()), scale, (*limits, *self._out_of_reach(target, made, now)))

    def _nearer(self, start: Array, target: FramePose, dt: float) -> tuple[Array, float, tuple[JogLimit, ...]]:
        """The nearest configuration (n,) that the joints can have `dt` [s] after `start` (n,) [rad] or [m]."""
        positions, limits, scale = start, dict[str, JogLimit](), 1.0
        for _ in range(ROUNDS):
            missing = self._missing(positions, target)
            if np.max(np.abs(missing)) < MET:
                break
            motion = self._twists.solve(positions, missing / dt)
            if motion.scale < 1.0:
                limits["singularity"] = singularity(motion.regularity)
            step = dt * motion.velocity
            fast, fastest = _share(positions, step, start - dt * self._speeds, start + dt * self._speeds)
            free, stuck = _share(positions, step, np.minimum(self._lower, start), np.maximum(self._upper, start))
            if fast < 1.0:
                limits["speed"] = speed_limit(self._joints[fastest], float(step[fastest]) / dt)
            if free < fast:
                limits["travel"] = joint_limit(self._joints[stuck], float(positions[stuck]), float(step[stuck]))
            share = min(fast, free)
            positions = positions + share * step
            scale = min(scale, share * motion.scale)
            if share < 1.0:
                break
        return self._regular(start, positions, scale, limits)

    def _regular(
        self, start: Array, positions: Array, scale: float, limits: dict[str, JogLimit]
    ) -> tuple[Array, float, tuple[JogLimit, ...]]:
        """As far towards `positions` (n,) as no singularity forbids."""
        displacement, share = positions - start, 1.0
        for _ in range(HALVINGS):
            found = self._twists.singularity_on(start, share * displacement)
            if found is None:
                break
            limits["singularity"] = singularity(found)
            share *= 0.5
        else:
            share = 0.0
        return start + share * displacement, share * scale, tuple(limits.values())

    def _missing(self, positions: Array, target: FramePose) -> Array:
        """(6,) [m] and [rad] from the tool to the target; no turn where the arm cannot choose it."""
        tool = self._kinematics.tool(positions)
        turn = pin.log3(target.rotation @ tool.rotation.T) if self._twists.turns else np.zeros(3)
        return np.concatenate((target.position - tool.position, turn))

    def _out_of_reach(self, target: FramePose, made: float, now: float) -> tuple[JogLimit, ...]:
        """The limit where the arm stands away from its target; `made` is the share of its speed that it goes with."""
        assert self._positions is not None
        missing = self._missing(self._positions, target)
        distance, angle = float(np.linalg.norm(missing[:3])), float(np.linalg.norm(missing[3:]))
        if made > WAY or (distance < MISSED[0] and angle < MISSED[1]):
            self._on_way = now
        if now - self._on_way < PATIENCE:
            return ()
        why = because("jog.limit.reach", distance=distance, angle=angle)
        return (JogLimit(check="reach", subject="tool", value=distance, limit=MISSED[0], why=why),)


def _share(positions: Array, step: Array, lower: Array, upper: Array) -> tuple[float, int]:
    """How much of `step` (n,) from `positions` (n,) stays within the bounds (n,), and the first joint to leave."""
    room = np.where(step > 0.0, upper - positions, positions - lower)
    shares = np.where(np.abs(step) > room, room / np.maximum(np.abs(step), 1e-12), 1.0)
    first = int(np.argmin(shares))
    return max(0.0, float(shares[first])), first


def require_pose(pose: PoseTarget) -> None:
    """Raises `BadPose` unless `position` is (3,) [m] and `orientation` a unit quaternion or empty."""
    if len(pose.position) != 3:
        raise BadPose(because("jog.command.values", part="position", count=len(pose.position)))
    farthest = max(pose.position, key=abs)
    if abs(farthest) > FARTHEST:
        raise BadPose(because("jog.pose.far", value=farthest, limit=FARTHEST))
    if len(pose.orientation) not in (0, 4):
        raise BadPose(because("jog.pose.orientation", count=len(pose.orientation)))
    length = math.hypot(*pose.orientation) if pose.orientation else 1.0
    if abs(length - 1.0) > 1e-3:
        raise BadPose(because("jog.pose.quaternion", length=length))
