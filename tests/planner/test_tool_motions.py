"""Lines, arcs and waypoints as they will be executed, on both arms."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.libraries.arm.interpolation import TrajectorySampler
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import (
    CircularMotion,
    FreeMotion,
    Goal,
    JointGoal,
    LinearMotion,
    Motion,
    NamedGoal,
    PlanCode,
    PlanRequest,
    PlanResponse,
    PointToPoint,
    PoseGoal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.timing.profile import joint_limits
from gemelo.services.planner.verification.verify import require_jerk, require_within_limits, sample
from tests.profiles import examples

URDF = Path(__file__).parents[2] / "urdf"
PLANNERS = {name: Planner(load_arm(URDF / name)) for name in ("rm1", "parol6")}
ARMS = pytest.mark.parametrize("name", PLANNERS)
OFF = 1e-4  # [m] that a line or an arc may be left by
SHARES = st.lists(st.floats(0.15, 0.85), min_size=6, max_size=6)
DIRECTIONS = st.tuples(*[st.floats(-1.0, 1.0)] * 3).map(np.array)


def configuration(planner: Planner, shares: list[float]) -> tuple[float, ...]:
    joints = planner.arm.joints
    found = tuple(j.lower + share * (j.upper - j.lower) for j, share in zip(joints, shares, strict=False))
    assume(planner.kinematics.collisions.distance(found) > 2.0 * CLEARANCE)
    return found


def plan(planner: Planner, goal: Goal, motion: Motion, start: tuple[float, ...], **more: object) -> PlanResponse:
    standing = JointState(name=planner.arm.joint_names, position=start)
    return planner.plan(PlanRequest(goal=goal, motion=motion, start=standing, **more), None)


def tool_rows(planner: Planner, response: PlanResponse, density: int = 10) -> tuple[np.ndarray, np.ndarray]:
    """Times and tool positions, looked at ten times between two points, by another interpolation."""
    sampler = TrajectorySampler(response.trajectory)
    stamps = [point.time_from_start for point in response.trajectory.points]
    times = np.interp(np.arange(density * (len(stamps) - 1) + 1) / density, np.arange(len(stamps)), stamps)
    return times, np.array([planner.kinematics.tool(sampler.at(t)[0]).position for t in times.tolist()])


def off_line(rows: np.ndarray, start: np.ndarray, end: np.ndarray) -> float:
    way = (end - start) / np.linalg.norm(end - start)
    offset = rows - start
    return float(np.linalg.norm(offset - np.outer(offset @ way, way), axis=1).max())


def require_sound(planner: Planner, response: PlanResponse, start: tuple[float, ...]) -> None:
    samples = sample(response.trajectory)
    require_within_limits(planner.arm, samples, joint_limits(planner.arm))
    require_jerk(planner.arm, samples, joint_limits(planner.arm))
    points = response.trajectory.points
    assert points[0].positions == start
    assert not any(points[0].velocities + points[-1].velocities + points[-1].accelerations)


@ARMS
@examples(quick=8, full=25)
@given(shares=SHARES, direction=DIRECTIONS, length=st.floats(0.005, 0.2), speed=st.sampled_from((0.0, 0.04)))
def test_a_line_is_a_line_or_says_why_it_ends(
    name: str, shares: list[float], direction: np.ndarray, length: float, speed: float
):
    planner = PLANNERS[name]
    start = configuration(planner, shares)
    assume(np.linalg.norm(direction) > 0.1)
    begin = planner.kinematics.tool(start)
    end = begin.position + length * direction / np.linalg.norm(direction)
    motion = LinearMotion(speed=speed, least_fraction=0.0)
    response = plan(planner, PoseGoal(position=tuple(end.tolist())), motion, start)
    if response.code is not PlanCode.SUCCESS:
        assert response.refusal is not None
        assert response.refusal.check in ("singularity", "joint limit", "collision")
        assert "the path cannot be begun" in response.refusal.message
        return
    require_sound(planner, response, start)
    times, rows = tool_rows(planner, response)
    assert off_line(rows, begin.position, end) < OFF
    assert np.linalg.norm(rows[-1] - begin.position) == pytest.approx(response.fraction * length, abs=1e-6)
    if response.fraction == 1.0:
        assert rows[-1] == pytest.approx(end, abs=1e-7)
    else:
        assert response.stopped_by is not None
        assert "along the path" in response.stopped_by.message
    if name == "parol6":
        last = planner.kinematics.tool(response.trajectory.points[-1].positions)
        assert last.rotation == pytest.approx(begin.rotation, abs=1e-6)
    if speed:
        assert (np.linalg.norm(np.diff(rows, axis=0), axis=1) / np.diff(times)).max() <= speed * (1.0 + 1e-6)


@ARMS
@examples(quick=5, full=15)
@given(shares=SHARES, one=DIRECTIONS, other=DIRECTIONS)
def test_an_arc_is_an_arc_through_its_point(name: str, shares: list[float], one: np.ndarray, other: np.ndarray):
    planner = PLANNERS[name]
    start = configuration(planner, shares)
    begin = planner.kinematics.tool(start).position
    interim, end = begin + 0.05 * one, begin + 0.05 * other
    motion = CircularMotion(interim=tuple(interim.tolist()), acceleration=0.1)
    response = plan(planner, PoseGoal(position=tuple(end.tolist())), motion, start)
    assume(response.code is PlanCode.SUCCESS)
    require_sound(planner, response, start)
    times, rows = tool_rows(planner, response)
    a, b = interim - begin, end - begin
    normal = np.cross(a, b)
    centre = begin + np.cross((a @ a) * b - (b @ b) * a, normal) / (2.0 * normal @ normal)
    assert np.abs(np.linalg.norm(rows - centre, axis=1) - np.linalg.norm(begin - centre)).max() < OFF
    assert np.abs((rows - centre) @ normal / np.linalg.norm(normal)).max() < OFF
    assert np.linalg.norm(rows - interim, axis=1).min() < 5e-3
    assert rows[-1] == pytest.approx(end, abs=1e-7)
    velocity = np.diff(rows, axis=0) / np.diff(times)[:, None]
    between = 0.5 * (times[2:] - times[:-2])
    assert (np.linalg.norm(np.diff(velocity, axis=0), axis=1) / between).max() <= 0.1 * 1.02


def test_a_line_beyond_a_joints_limit_ends_there():
    planner = PLANNERS["rm1"]
    start = (0.3, 0.8, 0.1)
    x, y, z = planner.kinematics.tool(start).position.tolist()
    goal = PoseGoal(position=(x, y, z + 0.16))
    refused = plan(planner, goal, LinearMotion(), start)
    assert refused.code is PlanCode.NO_IK_SOLUTION
    assert refused.trajectory.points == ()
    half = plan(planner, goal, LinearMotion(least_fraction=0.5), start)
    assert half.code is PlanCode.SUCCESS
    assert half.fraction == pytest.approx(0.1 / 0.16, abs=1e-3)
    assert half.stopped_by is not None
    assert (half.stopped_by.check, half.stopped_by.subject) == ("joint limit", "efector_joint")
    assert half.stopped_by.limit == 0.2
    assert half.stopped_by.message.startswith(("at 0.1000 m of 0.1600 m", "at 0.0999 m of 0.1600 m"))
    more = plan(planner, goal, LinearMotion(least_fraction=0.7), start)
    assert more.code is PlanCode.NO_IK_SOLUTION


def test_a_line_through_a_box_ends_before_it_and_names_it():
    planner = Planner(PLANNERS["rm1"].arm)
    start = (-0.5, 1.2, 0.1)
    begin = planner.kinematics.tool(start).position
    end = planner.kinematics.tool((0.9, 1.2, 0.1)).position
    place = Transform(translation=tuple((0.5 * (begin + end)).tolist()))
    box = SceneObject(name="crate", shape=BoxShape(size=(0.04, 0.04, 0.3)), pose=place)
    goal = PoseGoal(position=tuple(end.tolist()))
    assert plan(planner, goal, LinearMotion(), start).code is PlanCode.SUCCESS
    world = World(planner.arm, planner.kinematics, PlanningScene(version=1, objects=(box,)))
    planner.set_world(world)
    refused = plan(planner, goal, LinearMotion(), start)
    assert refused.code is PlanCode.PLANNING_FAILED
    assert refused.refusal is not None
    assert refused.refusal.check == "collision"
    assert "crate" in refused.refusal.subject
    part = plan(planner, goal, LinearMotion(least_fraction=0.01), start)
    assert 0.05 < part.fraction < 0.5
    last = world.distance(part.trajectory.points[-1].positions)
    assert CLEARANCE < last < CLEARANCE + 0.002
    assert all(world.distance(row) > CLEARANCE for row in sample(part.trajectory).positions)


@pytest.mark.parametrize(
    ("name", "state", "way"), [("parol6", "home", (0.0, 0.05, 0.0)), ("rm1", "ready", (2.0, 0.0, 0.0))]
)
def test_a_singular_wrist_or_a_stretched_arm_is_named(name: str, state: str, way: tuple[float, float, float]):
    planner = PLANNERS[name]
    start = planner.arm.named_states[state]
    end = planner.kinematics.tool(start).position + way
    response = plan(planner, PoseGoal(position=tuple(end.tolist())), LinearMotion(least_fraction=0.0), start)
    reason = response.refusal or response.stopped_by
    assert reason is not None
    assert reason.check == "singularity"
    assert "manipulability" in reason.message
    assert response.fraction < 0.2 or response.code is PlanCode.NO_IK_SOLUTION


def test_a_line_in_a_wrists_plane_passes_its_singularity():
    planner = PLANNERS["parol6"]
    start = planner.arm.named_states["home"]
    x, y, z = planner.kinematics.tool(start).position.tolist()
    response = plan(planner, PoseGoal(position=(x + 0.03, y, z)), LinearMotion(), start)
    assert response.code is PlanCode.SUCCESS


@ARMS
def test_a_joint_that_moves_more_than_the_jump_threshold_ends_the_line(name: str):
    planner = PLANNERS[name]
    start = planner.arm.named_states["ready"]
    end = np.add(planner.kinematics.tool(start).position, (0.0, -0.05, -0.02))
    goal = PoseGoal(position=tuple(end.tolist()))
    assert plan(planner, goal, LinearMotion(max_step=0.005, jump_threshold=0.3), start).code is PlanCode.SUCCESS
    refused = plan(planner, goal, LinearMotion(max_step=0.005, jump_threshold=0.003), start)
    assert refused.code is PlanCode.NO_IK_SOLUTION
    assert refused.refusal is not None
    assert (refused.refusal.check, refused.refusal.limit) == ("jump", 0.003)
    assert refused.refusal.subject in planner.arm.joint_names


@ARMS
def test_blended_waypoints_stay_near_their_corners_and_do_not_stop(name: str):
    planner = PLANNERS[name]
    start = planner.arm.named_states["ready"]
    begin = planner.kinematics.tool(start).position
    corner, end = np.add(begin, (0.0, 0.05, 0.0)), np.add(begin, (0.0, 0.05, 0.05))
    points = tuple(PoseGoal(position=tuple(place.tolist())) for place in (corner, end))
    stopping, blended = (
        plan(planner, WaypointGoal(points=points, blend=blend), LinearMotion(), start) for blend in (0.0, 0.015)
    )
    for response in (stopping, blended):
        assert response.code is PlanCode.SUCCESS
        require_sound(planner, response, start)
    assert np.linalg.norm(tool_rows(planner, stopping)[1] - corner, axis=1).min() < 1e-9
    times, rows = tool_rows(planner, blended)
    nearest = np.linalg.norm(rows - corner, axis=1)
    assert 1e-3 < nearest.min() < 0.015
    outside = nearest > 0.015 + OFF
    legs = [off_line(rows[outside & part], *ends) for part, ends in (
        (np.arange(len(rows)) < nearest.argmin(), (begin, corner)),
        (np.arange(len(rows)) > nearest.argmin(), (corner, end)),
    )]  # fmt: skip
    assert max(legs) < OFF
    speed = np.linalg.norm(np.diff(rows, axis=0), axis=1) / np.diff(times)
    inner = speed[len(speed) // 10 : -len(speed) // 10]
    assert inner.min() > 0.1 * inner.max()


@ARMS
@pytest.mark.parametrize("motion", [PointToPoint(), FreeMotion()])
def test_joints_go_by_their_waypoints(name: str, motion: Motion):
    planner = PLANNERS[name]
    states = planner.arm.named_states
    start, corner = states["left"], states["ready"]
    goal = WaypointGoal(points=(NamedGoal(name="ready"), NamedGoal(name="right")))
    stopping = plan(planner, goal, motion, start)
    blended = plan(planner, WaypointGoal(points=goal.points, blend=0.05), motion, start)
    for response in (stopping, blended):
        assert response.code is PlanCode.SUCCESS
        require_sound(planner, response, start)
        assert response.trajectory.points[-1].positions == states["right"]
    assert corner in [point.positions for point in stopping.trajectory.points]
    assert corner not in [point.positions for point in blended.trajectory.points]
    there = planner.kinematics.tool(corner).position
    assert np.linalg.norm(tool_rows(planner, blended)[1] - there, axis=1).min() <= 0.05


@ARMS
@pytest.mark.parametrize("motion", [PointToPoint(), LinearMotion()])
def test_corners_whose_blends_meet_are_one_after_the_other(name: str, motion: Motion):
    planner = PLANNERS[name]
    start = planner.arm.named_states["ready"]
    begin = planner.kinematics.tool(start).position
    ways = ((0.0, 0.02, 0.0), (0.0, 0.02, 0.02), (0.0, 0.0, 0.02), (0.0, -0.02, 0.02))
    points = tuple(PoseGoal(position=tuple(np.add(begin, way).tolist())) for way in ways)
    response = plan(planner, WaypointGoal(points=points, blend=0.5), motion, start)
    assert response.code is PlanCode.SUCCESS
    require_sound(planner, response, start)


@ARMS
def test_a_line_to_a_joint_goal_ends_at_its_pose(name: str):
    planner = PLANNERS[name]
    start = planner.arm.named_states["ready"]
    goal = tuple(value + 0.05 for value in start)
    response = plan(planner, JointGoal(name=planner.arm.joint_names, position=goal), LinearMotion(), start)
    assert response.code is PlanCode.SUCCESS
    assert response.tool_goal == pytest.approx(planner.kinematics.tool(goal).position, abs=1e-7)
    if name == "parol6":
        last = planner.kinematics.tool(response.trajectory.points[-1].positions)
        assert last.rotation == pytest.approx(planner.kinematics.tool(goal).rotation, abs=1e-6)


@pytest.mark.parametrize(
    ("motion", "subject"),
    [
        (LinearMotion(speed=-0.1), "speed"),
        (LinearMotion(acceleration=-1.0), "acceleration"),
        (LinearMotion(max_step=-1.0), "max_step"),
        (LinearMotion(jump_threshold=-1.0), "jump_threshold"),
        (LinearMotion(least_fraction=1.5), "least_fraction"),
        (LinearMotion(max_step=1e-9), "max_step"),
        (CircularMotion(), "interim"),
        (CircularMotion(interim=(0.1, 0.1, 0.1), center=(0.1, 0.1, 0.1)), "interim"),
        (CircularMotion(interim=(0.1, 0.1)), "interim"),
        (CircularMotion(center=(5.0, 5.0, 5.0)), "center"),
    ],
)
def test_nonsense_is_refused_by_name(motion: Motion, subject: str):
    planner = PLANNERS["rm1"]
    response = plan(planner, PoseGoal(position=(0.25, 0.15, 0.10)), motion, planner.arm.named_states["ready"])
    assert response.code is not PlanCode.SUCCESS
    assert response.refusal is not None
    assert response.refusal.subject == subject
    assert response.refusal.message
    assert response.refusal.remedy


@pytest.mark.parametrize(
    ("goal", "motion"),
    [
        (WaypointGoal(), LinearMotion()),
        (WaypointGoal(), FreeMotion()),
        (WaypointGoal(points=(NamedGoal(name="home"),), blend=-1.0), PointToPoint()),
        (WaypointGoal(points=(NamedGoal(name="home"),)), CircularMotion(interim=(0.1, 0.1, 0.1))),
        (WaypointGoal(points=(NamedGoal(name="nowhere"),)), LinearMotion()),
    ],
)
def test_waypoints_that_are_none_are_refused(goal: Goal, motion: Motion):
    planner = PLANNERS["rm1"]
    response = plan(planner, goal, motion, planner.arm.named_states["ready"])
    assert response.code is PlanCode.INVALID_GOAL_CONSTRAINTS
    assert response.trajectory.points == ()


def test_what_is_not_a_number_is_no_message():
    with pytest.raises(ValueError, match="must be finite"):
        LinearMotion(speed=float("nan"))


OPTIMAL = [
    (NamedGoal(name="left"), PointToPoint()),
    (PoseGoal(position=(0.0, 0.05, 0.01)), LinearMotion()),
    (PoseGoal(position=(0.0, 0.05, 0.01)), LinearMotion(speed=0.05, acceleration=0.3)),
    (PoseGoal(position=(0.0, 0.05, 0.01)), CircularMotion(interim=(0.01, 0.025, 0.01), speed=0.08, acceleration=0.4)),
    (WaypointGoal(points=(PoseGoal(position=(0.0, 0.05, 0.0)), PoseGoal(position=(0.0, 0.05, 0.03)))), LinearMotion()),
    (
        WaypointGoal(points=(PoseGoal(position=(0.0, 0.05, 0.0)), PoseGoal(position=(0.0, 0.05, 0.03))), blend=0.01),
        LinearMotion(acceleration=0.5),
    ),
    (WaypointGoal(points=(NamedGoal(name="home"), NamedGoal(name="left"))), FreeMotion()),
    (WaypointGoal(points=(NamedGoal(name="left"), NamedGoal(name="right")), blend=0.05), PointToPoint()),
]


def beside(goal: Goal, begin: np.ndarray) -> Goal:
    """Positions are from where the tool is."""
    match goal:
        case PoseGoal():
            return replace(goal, position=tuple(np.add(goal.position, begin).tolist()))
        case WaypointGoal():
            return replace(goal, points=tuple(beside(point, begin) for point in goal.points))
    return goal


@ARMS
@pytest.mark.parametrize(("goal", "motion"), OPTIMAL)
def test_what_is_timed_optimally_is_no_slower_and_heeds_all_limits_but_the_jerk(name: str, goal: Goal, motion: Motion):
    planner = PLANNERS[name]
    start = planner.arm.named_states["ready"]
    begin = planner.kinematics.tool(start).position
    if isinstance(motion, CircularMotion):
        motion = replace(motion, interim=tuple(np.add(motion.interim, begin).tolist()))
    fast, smooth = (plan(planner, beside(goal, begin), motion, start, timing=timing) for timing in reversed(Timing))
    assert fast.code is smooth.code is PlanCode.SUCCESS
    assert fast.duration < smooth.duration + 0.05  # its accelerations come and go in 0.03 s
    require_within_limits(planner.arm, sample(fast.trajectory, 50), joint_limits(planner.arm))
    assert fast.trajectory.points[-1].positions == pytest.approx(smooth.trajectory.points[-1].positions, abs=1e-9)
    speed, acceleration = tool_peaks(planner, fast)
    if isinstance(motion, LinearMotion | CircularMotion):
        assert speed <= (motion.speed or math.inf) * (1.0 + 1e-3)
        assert acceleration <= (motion.acceleration or math.inf) * 1.01


def tool_peaks(planner: Planner, response: PlanResponse) -> tuple[float, float]:
    """Speed [m/s] and acceleration [m/s^2] by differences of the tool's places at even times."""
    sampler, step = TrajectorySampler(response.trajectory), 1e-3
    times = np.arange(0.0, response.duration, step)
    rows = np.array([planner.kinematics.tool(sampler.at(t)[0]).position for t in times.tolist()])
    velocity = np.diff(rows, axis=0) / step
    return (
        float(np.linalg.norm(velocity, axis=1).max()),
        float(np.linalg.norm(np.diff(velocity, axis=0) / step, axis=1).max()),
    )


@pytest.mark.parametrize("timing", Timing)
@pytest.mark.parametrize("motion", [PointToPoint(), LinearMotion()])
@pytest.mark.parametrize("which", ["velocity_scaling", "acceleration_scaling"])
def test_a_scaling_near_nothing_is_told_in_seconds_that_nobody_waits(timing: Timing, motion: Motion, which: str):
    planner = PLANNERS["rm1"]
    start = planner.arm.named_states["ready"]
    goal = JointGoal(name=planner.arm.joint_names, position=tuple(value + 0.05 for value in start))
    response = plan(planner, goal, motion, start, timing=timing, **{which: 1e-300})
    assert response.refusal is not None
    assert "86400 s is the most" in response.refusal.message
    assert "scaling" in response.refusal.remedy
    slow = plan(planner, goal, motion, start, timing=timing, **{which: 1e-3})
    assert slow.code is PlanCode.SUCCESS
    assert slow.duration > 10.0


def test_a_line_to_where_the_tool_is_stands():
    planner = PLANNERS["rm1"]
    start = planner.arm.named_states["ready"]
    response = plan(planner, NamedGoal(name="ready"), LinearMotion(), start)
    assert (response.code, response.duration) == (PlanCode.SUCCESS, 0.1)
