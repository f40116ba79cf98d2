"""Planners of every arm that is tested, and what must hold of whatever they return, as another library sees it."""

from __future__ import annotations

import math
from functools import cache
from pathlib import Path

import numpy as np

from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    Goal,
    JointGoal,
    NamedGoal,
    PlanCode,
    PlanRequest,
    PlanResponse,
    PoseGoal,
    Refusal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.verification.verify import DENSITY, LOOSE_JERK
from tests.planner.independent import Array, Judge, Motion, resampled

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = (ROOT / "urdf", Path(__file__).parent / "arms")
FINER = 10  # times as many samples as the planner looks at itself
ROUNDING = 1e-9  # [rad] or [m], and a share of a limit
REACHED = 2e-6  # [m] and [rad] that a pose may be missed by, where it is asked for exactly


_shared: list[Planner] = []


@cache
def planner_of(name: str) -> Planner:
    """One for all tests of this process; `forget_scenes` empties its scene before each of them."""
    planner = Planner(arm_of(name))
    planner.prepare()  # its links' spheres would cost the first plan its time
    _shared.append(planner)
    return planner


def forget_scenes() -> None:
    for planner in _shared:
        if planner.checker.newest.scene.objects:
            show(planner, PlanningScene())


@cache
def arm_of(name: str) -> ArmDescription:
    (folder,) = (folder / name for folder in FOLDERS if (folder / name).is_dir())
    return load_arm(folder)


def show(planner: Planner, scene: PlanningScene) -> None:
    planner.set_world(World(planner.arm, planner.kinematics, scene))


def asked(planner: Planner, start: Array | tuple[float, ...], goal: Goal, **options: object) -> PlanRequest:
    standing = JointState(name=planner.arm.joint_names, position=tuple(map(float, start)))
    whole: dict[str, object] = {"allowed_time": 20.0, **options}
    return PlanRequest(start=standing, goal=goal, **whole)


def joints(planner: Planner, goal: Array | tuple[float, ...]) -> JointGoal:
    return JointGoal(name=planner.arm.joint_names, position=tuple(map(float, goal)))


def configuration_at(planner: Planner, shares: tuple[float, ...]) -> tuple[float, ...]:
    """A configuration by the share of each joint's travel, which is a turn where there is no limit."""
    configuration = []
    for joint, share in zip(planner.arm.joints, shares, strict=False):
        low, high = (joint.lower, joint.upper) if math.isfinite(joint.lower) else (-math.pi, math.pi)
        configuration.append(float(joint.clamp(low + share * (high - low))))
    return tuple(configuration)


def require_refused(response: PlanResponse) -> Refusal:
    """A refusal says what, why and what would do, in words, and comes without a trajectory."""
    assert response.code is not PlanCode.SUCCESS
    assert response.code is not PlanCode.FAILURE, response.refusal
    assert response.trajectory.points == ()
    assert response.refusal is not None
    assert response.refusal.check
    assert response.refusal.message
    assert response.refusal.remedy
    is_too_slow = "86400 s is the most" in response.refusal.message
    assert response.refusal.check != "verification" or is_too_slow, response.refusal
    return response.refusal


def require_sound(planner: Planner, request: PlanRequest, response: PlanResponse) -> Motion:
    """What holds for every trajectory that is returned; gives it sampled ten times as finely as the planner looks."""
    assert response.code is PlanCode.SUCCESS, response.refusal
    points = response.trajectory.points
    assert response.trajectory.joint_names == planner.arm.joint_names
    assert request.start is not None
    assert points[0].positions == request.start.position
    assert not any(points[0].velocities + points[0].accelerations + points[-1].velocities + points[-1].accelerations)
    assert points[0].time_from_start == 0.0
    assert response.duration == points[-1].time_from_start
    motion = resampled(response.trajectory, FINER * DENSITY)
    require_within_limits(planner.arm, request, motion)
    touch = Judge(planner.arm, planner.checker.newest.scene).touch(motion.positions)
    assert touch is None, touch
    return motion


def require_within_limits(arm: ArmDescription, request: PlanRequest, motion: Motion) -> None:
    for column, joint in enumerate(arm.joints):
        positions = motion.positions[:, column]
        assert joint.lower - ROUNDING <= positions.min()
        assert positions.max() <= joint.upper + ROUNDING
        velocity = joint.velocity * request.velocity_scaling
        assert np.abs(motion.velocities[:, column]).max() <= velocity * (1.0 + ROUNDING)
        acceleration = joint.acceleration * request.acceleration_scaling
        assert np.abs(motion.accelerations[:, column]).max() <= acceleration * (1.0 + ROUNDING)
        if request.timing is Timing.JERK_LIMITED:
            jerk = joint.jerk * request.acceleration_scaling
            assert np.abs(motion.jerks[:, column]).max() <= jerk * LOOSE_JERK


def require_reached(planner: Planner, request: PlanRequest, response: PlanResponse) -> None:
    """The last point is the goal: to the bit in joints, in pose by the judge's kinematics."""
    last = np.array(response.trajectory.points[-1].positions)
    goal = request.goal.points[-1] if isinstance(request.goal, WaypointGoal) else request.goal
    if isinstance(goal, NamedGoal):
        assert tuple(last) == planner.arm.named_states[goal.name]
    elif isinstance(goal, JointGoal):
        values = dict(zip(planner.arm.joint_names, last.tolist(), strict=True))
        assert tuple(values[name] for name in goal.name) == goal.position
    elif isinstance(goal, PoseGoal):
        require_pose(planner, goal, request, last)


def require_pose(planner: Planner, goal: PoseGoal, request: PlanRequest, configuration: Array) -> None:
    """In all forms of a pose goal; in a link's frame as it stands at the start."""
    judge = Judge(planner.arm)
    assert request.start is not None
    origin, frame = judge.pose(goal.frame or planner.arm.base_frame, np.array(request.start.position))
    position, rotation = judge.tool(configuration)
    assert np.linalg.norm(origin + frame @ goal.position - position) <= goal.position_tolerance + REACHED
    most = goal.orientation_tolerance + REACHED
    if goal.tool_axis:
        assert angle(rotation @ unit(goal.tool_axis), frame @ unit(goal.direction)) <= most
    elif goal.orientation:
        wanted = frame @ turn(goal.orientation)
        if goal.free_axis:
            assert angle(rotation @ unit(goal.free_axis), wanted @ unit(goal.free_axis)) <= most
        else:
            assert np.arccos(np.clip(0.5 * (np.trace(wanted.T @ rotation) - 1.0), -1.0, 1.0)) <= most


def unit(vector: tuple[float, ...]) -> Array:
    return np.array(vector) / np.linalg.norm(vector)


def angle(one: Array, other: Array) -> float:
    """[rad]; exact for small ones too."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


def turn(quaternion: tuple[float, ...]) -> Array:
    """(3, 3) of (x, y, z, w)."""
    x, y, z, w = unit(quaternion)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation: Array = np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross
    return rotation


def quaternion_of(rotation: Array) -> tuple[float, ...]:
    """(x, y, z, w), by the eigenvector of the largest eigenvalue (Bar-Itzhack 2000)."""
    r = rotation
    matrix = np.array([
        [r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]],
        [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]],
        [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], r[1, 0] - r[0, 1]],
        [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]],
    ])  # fmt: skip
    return tuple(np.linalg.eigh(matrix)[1][:, -1].tolist())
