"""The ends of lines, arcs and waypoint paths and their reasons, alike for all of them; at singularities above all."""

from __future__ import annotations

import math

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from gemelo.schemas.frames import Transform
from gemelo.schemas.planning import (
    CircularMotion,
    Goal,
    JointGoal,
    LinearMotion,
    NamedGoal,
    PlanCode,
    PlanResponse,
    PointToPoint,
    PoseGoal,
    Timing,
    WaypointGoal,
)
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneObject
from tests.planner.independent import Array, Judge, Motion, resampled
from tests.planner.judging import asked, planner_of, show

OFF = 1e-4  # [m] that a line or an arc may be left by
DENSITY = 20  # looks between two points
ARMS = pytest.mark.parametrize("name", ["rm1", "parol6"])
KINDS = pytest.mark.parametrize("kind", ["line", "arc", "waypoints"])
Way = tuple[Goal, LinearMotion | CircularMotion]


def way(kind: str, begin: Array, end: Array, least: float) -> Way:
    """To `end`, straight, by a flat arc, or straight by a point half-way."""
    goal = PoseGoal(position=tuple(end.tolist()))
    middle = 0.5 * (begin + end)
    match kind:
        case "arc":
            off = np.cross(end - begin, (0.0, 0.0, 1.0) if abs((end - begin)[2]) < 0.01 else (1.0, 0.0, 0.0))
            interim = middle + 0.05 * off
            return goal, CircularMotion(interim=tuple(interim.tolist()), least_fraction=least)
        case "waypoints":
            points = (PoseGoal(position=tuple(middle.tolist())), goal)
            return WaypointGoal(points=points), LinearMotion(least_fraction=least)
    return goal, LinearMotion(least_fraction=least)


def planned(name: str, start: tuple[float, ...], goal: Goal, motion: object, **options: object) -> PlanResponse:
    planner = planner_of(name)
    return planner.plan(asked(planner, start, goal, motion=motion, **options), None)


def seen(name: str, response: PlanResponse) -> tuple[Motion, Array]:
    """The motion and the tool's places, by another library; within the joints' speeds, and without a jump."""
    arm = planner_of(name).arm
    motion = resampled(response.trajectory, DENSITY)
    assert (np.abs(motion.velocities) <= np.array([joint.velocity for joint in arm.joints]) * (1.0 + 1e-9)).all()
    steps = np.abs(np.diff(motion.positions, axis=0)) / np.diff(motion.times)[:, None]
    assert (steps <= np.array([joint.velocity for joint in arm.joints]) * (1.0 + 1e-6)).all()
    return motion, Judge(arm).tool_way(motion.positions)


def off_line(rows: Array, way: Array) -> float:
    """[m] that the worst row is away from the line along `way` through the first of them."""
    along = (rows - rows[0]) @ way / (way @ way)
    return float(np.linalg.norm(rows - rows[0] - np.outer(along, way), axis=1).max())


@KINDS
def test_a_joints_limit_ends_every_kind_of_way_at_its_place(kind: str):
    start = (0.3, 0.8, 0.1)
    begin = planner_of("rm1").kinematics.tool(start).position
    end = np.add(begin, (0.0, 0.0, 0.16))
    refused = planned("rm1", start, *way(kind, begin, end, 1.0))
    assert refused.code is PlanCode.NO_IK_SOLUTION
    assert refused.fraction == pytest.approx(0.1 / 0.16, abs=0.01)
    part = planned("rm1", start, *way(kind, begin, end, 0.5))
    assert part.code is PlanCode.SUCCESS
    assert part.stopped_by is not None
    assert (part.stopped_by.check, part.stopped_by.subject) == ("joint limit", "efector_joint")
    assert part.stopped_by.message.startswith("at 0.1")
    assert part.fraction == pytest.approx(refused.fraction)
    assert seen("rm1", part)[0].positions[-1, 2] == pytest.approx(0.2, abs=1e-4)


@KINDS
def test_what_is_in_the_way_ends_every_kind_of_way_before_it(kind: str):
    planner, start = planner_of("rm1"), (-0.5, 1.2, 0.1)
    begin, end = (planner.kinematics.tool(configuration).position for configuration in (start, (0.9, 1.2, 0.1)))
    place = Transform(translation=tuple((begin + 0.6 * (end - begin)).tolist()))
    crate = SceneObject(name="crate", shape=BoxShape(size=(0.04, 0.04, 0.3)), pose=place)
    scene = PlanningScene(version=1, objects=(crate,))
    show(planner, scene)
    try:
        refused, part = (planned("rm1", start, *way(kind, begin, end, least)) for least in (1.0, 0.1))
    finally:
        show(planner, PlanningScene())
    assert refused.refusal is not None
    assert part.stopped_by is not None
    for reason in (refused.refusal, part.stopped_by):
        assert reason.check == "collision"
        assert "crate" in reason.subject
        assert "along the path" in reason.message
    assert 0.1 < part.fraction == pytest.approx(refused.fraction, abs=1e-3)
    assert Judge(planner.arm, scene).touch(seen("rm1", part)[0].positions) is None


@ARMS
@KINDS
def test_a_joint_that_jumps_more_than_it_may_ends_every_kind_of_way(name: str, kind: str):
    start = planner_of(name).arm.named_states["ready"]
    begin = planner_of(name).kinematics.tool(start).position
    goal, motion = way(kind, begin, np.add(begin, (0.0, -0.05, -0.02)), 1.0)
    wide, narrow = (replace(motion, max_step=0.005, jump_threshold=jump) for jump in (0.3, 0.003))
    assert planned(name, start, goal, wide).code is PlanCode.SUCCESS
    refused = planned(name, start, goal, narrow)
    assert refused.refusal is not None
    assert (refused.refusal.check, refused.refusal.limit, refused.fraction) == ("jump", 0.003, 0.0)


@pytest.mark.parametrize("interim", [(0.01, 0.025, 0.0), (0.0, 0.0, 0.02)])
def test_an_arc_of_finer_steps_is_the_same_arc(interim: tuple[float, ...]):
    start = planner_of("parol6").arm.named_states["ready"]
    begin = planner_of("parol6").kinematics.tool(start).position
    goal = PoseGoal(position=tuple(np.add(begin, (0.0, 0.05, 0.0)).tolist()))
    coarse = CircularMotion(interim=tuple(np.add(begin, interim).tolist()))
    ends = [planned("parol6", start, goal, replace(coarse, max_step=step)) for step in (0.0, 0.001)]
    assert [end.code for end in ends] == [PlanCode.SUCCESS] * 2
    assert ends[0].trajectory.points[-1].positions == pytest.approx(ends[1].trajectory.points[-1].positions, abs=1e-9)
    refused = planned("parol6", start, goal, replace(coarse, max_step=1e-9))
    assert refused.refusal is not None
    assert refused.refusal.subject == "max_step"


WRIST_AT_ZERO = (0.0, math.radians(-90), math.radians(180), 0.0, 0.0, math.pi)
WRIST_BEFORE = (0.0, math.radians(-80), math.radians(160), 0.0, math.radians(-10), math.pi)
BESIDE_THE_AXIS = (0.0, math.radians(-125), math.radians(195), 0.0, 0.5, math.pi)
FORWARD = (0.0, math.radians(-45), math.radians(200), 0.0, math.radians(25), math.pi)
BENT, STRETCHED = (0.6, -1.2, 0.08), (0.0, 0.0, 0.0)


def over_the_base() -> tuple[float, ...]:
    """The wrist on the axis of joint 1."""
    judge = Judge(planner_of("parol6").arm)

    def off(elbow: float) -> float:
        return float(judge.pose("link_5", np.array((*BESIDE_THE_AXIS[:2], elbow, *BESIDE_THE_AXIS[3:])))[0][0])

    elbow = brentq(off, BESIDE_THE_AXIS[2] - 0.3, BESIDE_THE_AXIS[2] + 0.3, xtol=1e-15)
    return (*BESIDE_THE_AXIS[:2], float(elbow), *BESIDE_THE_AXIS[3:])


SINGULAR = [
    pytest.param("parol6", WRIST_AT_ZERO, (0.0, 0.05, 0.0), id="across a wrist that is singular at the start"),
    pytest.param("parol6", over_the_base(), (0.0, 0.06, 0.0), id="sideways from over the base"),
    pytest.param("parol6", FORWARD, (0.5, 0.0, 0.0), id="until the elbow is stretched"),
    pytest.param("rm1", BENT, (2.0, 0.0, 0.0), id="until rm1 is stretched"),
    pytest.param("rm1", STRETCHED, (0.0, 0.05, 0.0), id="across rm1 where it is stretched"),
]


@pytest.mark.parametrize(("name", "start", "step"), SINGULAR)
def test_a_line_ends_at_a_singularity_with_its_place_and_how_near_it_is(
    name: str, start: tuple[float, ...], step: tuple[float, ...]
):
    begin = planner_of(name).kinematics.tool(start).position
    goal = PoseGoal(position=tuple((begin + step).tolist()))
    response = planned(name, start, goal, LinearMotion(least_fraction=0.0))
    reason = response.refusal or response.stopped_by
    assert reason is not None
    assert reason.check == "singularity"
    assert "manipulability" in reason.message
    assert f"m of {np.linalg.norm(step):.4f} m along the path" in reason.message
    if response.code is PlanCode.SUCCESS:
        rows = seen(name, response)[1]
        assert off_line(rows, np.array(step)) < OFF
        assert np.linalg.norm(rows[-1] - rows[0]) == pytest.approx(response.fraction * np.linalg.norm(step), abs=1e-4)


PASSING = [
    pytest.param("parol6", WRIST_AT_ZERO, (0.04, 0.0, 0.0), id="in the plane of a singular wrist"),
    pytest.param("parol6", WRIST_AT_ZERO, (0.0, 0.0, -0.04), id="down from a singular wrist"),
    pytest.param("parol6", over_the_base(), (0.03, 0.0, 0.0), id="in the plane of the arm over its base"),
    pytest.param("parol6", BESIDE_THE_AXIS, (0.0, 0.06, 0.0), id="sideways from 0.2 mm beside the base's axis"),
    pytest.param("rm1", STRETCHED, (-0.05, 0.0, 0.0), id="out of rm1's stretched arm"),
    pytest.param("rm1", STRETCHED, (0.0, 0.0, 0.1), id="up with rm1's stretched arm"),
]


@pytest.mark.parametrize(("name", "start", "step"), PASSING)
def test_a_line_through_a_singularity_that_it_can_pass_keeps_to_the_joints_speeds(
    name: str, start: tuple[float, ...], step: tuple[float, ...]
):
    begin = planner_of(name).kinematics.tool(start).position
    goal = PoseGoal(position=tuple((begin + step).tolist()))
    response = planned(name, start, goal, LinearMotion())
    assert response.code is PlanCode.SUCCESS
    rows = seen(name, response)[1]
    assert off_line(rows, np.array(step)) < OFF
    assert rows[-1] == pytest.approx(begin + step, abs=1e-6)


@pytest.mark.parametrize("side", [0.0, 1e-4, 0.01])
def test_a_wrist_that_turns_through_its_singularity_or_beside_it_does_not_jump(side: float):
    """The closer beside it, the faster joints 4 and 6 have to turn: more slowly, or not at all."""
    pose = Judge(planner_of("parol6").arm).tool(np.array(WRIST_BEFORE))
    x, y, z = pose[0].tolist()
    about = np.array((side, math.radians(20), 0.0))
    goal = PoseGoal(position=(x, y, z), orientation=turned(pose[1], about))
    response = planned("parol6", WRIST_BEFORE, goal, LinearMotion(least_fraction=0.0))
    assert response.code is PlanCode.SUCCESS
    rows = seen("parol6", response)[1]
    assert np.linalg.norm(rows - pose[0], axis=1).max() < OFF
    if response.stopped_by is not None:
        assert response.stopped_by.check in ("singularity", "joint limit")
        assert "of the turn along the path" in response.stopped_by.message


def turned(rotation: Array, about: Array) -> tuple[float, ...]:
    """(x, y, z, w) after a turn about an axis of the base [rad]."""
    return tuple((Rotation.from_rotvec(about) * Rotation.from_matrix(rotation)).as_quat().tolist())


@pytest.mark.parametrize("about", [(0.0, 0.5, 0.0), (0.4, 0.0, 0.0), (0.0, 0.0, 1.2), (0.0, 0.0, math.pi)])
def test_a_line_that_only_turns_stays_where_it_is_and_turns_evenly(about: tuple[float, ...]):
    start = planner_of("parol6").arm.named_states["ready"]
    judge = Judge(planner_of("parol6").arm)
    place, rotation = judge.tool(np.array(start))
    goal = PoseGoal(position=tuple(place.tolist()), orientation=turned(rotation, np.array(about)))
    response = planned("parol6", start, goal, LinearMotion())
    assert response.code is PlanCode.SUCCESS
    motion, rows = seen("parol6", response)
    assert np.linalg.norm(rows - place, axis=1).max() < OFF
    turns = [Rotation.from_matrix(judge.tool(row)[1] @ rotation.T).as_rotvec() for row in motion.positions[::10]]
    along = np.array(turns) @ np.array(about) / np.linalg.norm(about)
    assert np.abs(np.linalg.norm(turns, axis=1) - np.abs(along)).max() < 1e-4
    assert abs(along[-1]) == pytest.approx(np.linalg.norm(about), abs=1e-4)


def test_an_arm_that_cannot_turn_its_tool_says_so_instead_of_turning():
    start = planner_of("rm1").arm.named_states["ready"]
    place, rotation = Judge(planner_of("rm1").arm).tool(np.array(start))
    goal = PoseGoal(position=tuple(place.tolist()), orientation=turned(rotation, np.array((0.0, 0.0, 0.5))))
    refused = planned("rm1", start, goal, LinearMotion())
    assert refused.refusal is not None
    assert refused.refusal.check == "orientation"
    assert "28.65 deg are missing" in refused.refusal.message


@pytest.mark.parametrize("timing", Timing)
@pytest.mark.parametrize("motion", [LinearMotion(), LinearMotion(speed=0.01, acceleration=0.1)])
def test_an_arm_that_cannot_turn_its_tool_stands_where_any_turn_will_do(timing: Timing, motion: LinearMotion):
    start = planner_of("rm1").arm.named_states["ready"]
    place, rotation = Judge(planner_of("rm1").arm).tool(np.array(start))
    turn = turned(rotation, np.array((0.0, 0.0, 0.3)))
    goal = PoseGoal(position=tuple(place.tolist()), orientation=turn, orientation_tolerance=0.5)
    response = planned("rm1", start, goal, motion, timing=timing)
    assert response.code is PlanCode.SUCCESS
    assert (response.duration, response.trajectory.points[-1].positions) == (0.1, start)


@ARMS
@pytest.mark.parametrize("motion", [LinearMotion(), PointToPoint()])
def test_a_way_to_where_the_arm_is_stands_whatever_the_goals_form(name: str, motion: object):
    arm = planner_of(name).arm
    start = arm.named_states["ready"]
    place = tuple(Judge(arm).tool(np.array(start))[0].tolist())
    here = (NamedGoal(name="ready"), JointGoal(name=arm.joint_names, position=start), PoseGoal(position=place))
    for goal in (*here, WaypointGoal(points=here, blend=0.01)):
        response = planned(name, start, goal, motion)
        assert response.code is PlanCode.SUCCESS
        assert response.duration < 0.2
        assert np.abs(np.subtract([point.positions for point in response.trajectory.points], start)).max() < 1e-6


@pytest.mark.parametrize(
    ("motion", "end", "subject"),
    [
        (CircularMotion(interim=(0.01, 0.0, 0.0)), (0.0, 0.0, 0.0), "goal"),
        (CircularMotion(center=(0.01, 0.0, 0.0)), (0.0, 0.0, 0.0), "goal"),
        (CircularMotion(interim=(0.01, 0.0, 0.0)), (0.02, 0.0, 0.0), "interim"),
        (CircularMotion(center=(0.01, 0.0, 0.0)), (0.02, 0.0, 0.0), "center"),
        (CircularMotion(interim=(0.0, 0.0, 0.0)), (0.02, 0.0, 0.0), "interim"),
        (CircularMotion(center=(0.02, 0.0, 0.0)), (0.02, 0.0, 0.0), "center"),
    ],
)
def test_three_points_that_are_no_arc_are_refused_with_what_would_do(
    motion: CircularMotion, end: tuple[float, ...], subject: str
):
    start = planner_of("parol6").arm.named_states["ready"]
    begin = planner_of("parol6").kinematics.tool(start).position
    name = "interim" if motion.interim else "center"
    motion = replace(motion, **{name: tuple(np.add(begin, getattr(motion, name)).tolist())})
    refused = planned("parol6", start, PoseGoal(position=tuple(np.add(begin, end).tolist())), motion)
    assert refused.refusal is not None
    assert (refused.code, refused.refusal.subject) == (PlanCode.INVALID_GOAL_CONSTRAINTS, subject)
    assert refused.refusal.remedy
    if subject == "goal":
        assert "for a full circle" in refused.refusal.remedy


@ARMS
def test_a_line_to_a_named_state_ends_at_its_joints_to_the_bit(name: str):
    arm = planner_of(name).arm
    start = tuple(value + 0.04 for value in arm.named_states["ready"])
    response = planned(name, start, NamedGoal(name="ready"), LinearMotion())
    assert response.code is PlanCode.SUCCESS
    assert response.trajectory.points[-1].positions == arm.named_states["ready"]
    rows = seen(name, response)[1]
    assert off_line(rows, rows[-1] - rows[0]) < OFF


def test_a_line_to_joint_values_that_it_does_not_lead_to_names_the_joint_and_where_it_leads():
    planner = planner_of("rm1")
    goal, start = (-0.6, 1.2, 0.08), (0.5, -1.1, 0.08)
    mirrored = planner.kinematics.tool(goal).position
    other = JointGoal(name=planner.arm.joint_names, position=goal)
    refused = planned("rm1", start, other, LinearMotion())
    assert refused.code is PlanCode.GOAL_VIOLATES_PATH_CONSTRAINTS
    assert refused.refusal is not None
    assert (refused.refusal.check, refused.refusal.subject) == ("configuration", "antebrazo_joint")
    assert refused.refusal.limit == 1.2
    there = JointGoal(name=planner.arm.joint_names, position=refused.refusal.nearest)
    assert Judge(planner.arm).tool(np.array(refused.refusal.nearest))[0] == pytest.approx(mirrored, abs=1e-6)
    assert planned("rm1", start, there, LinearMotion()).code is PlanCode.SUCCESS
    assert planned("rm1", start, PoseGoal(position=tuple(mirrored.tolist())), LinearMotion()).code is PlanCode.SUCCESS


def test_a_joint_that_a_waypoint_does_not_name_stays_as_the_one_before_has_it():
    arm = planner_of("parol6").arm
    start = arm.named_states["ready"]
    first = JointGoal(name=("joint_1",), position=(start[0] + 0.1,))
    points = (first, JointGoal(name=("joint_6",), position=(start[5] + 0.1,)))
    for motion in (LinearMotion(), PointToPoint()):
        response = planned("parol6", start, WaypointGoal(points=points), motion)
        assert response.code is PlanCode.SUCCESS
        assert response.trajectory.points[-1].positions == (start[0] + 0.1, *start[1:5], start[5] + 0.1)


@pytest.mark.parametrize("beyond", [0.0, 1e-10, 1e-8, 1e-6, 1e-5, 3e-5, 1e-4, 1e-3])
def test_a_line_that_ends_just_beyond_a_limit_ends_at_it(beyond: float):
    start = (0.3, 0.8, 0.1)
    begin = planner_of("rm1").kinematics.tool(start).position
    goal = PoseGoal(position=tuple(np.add(begin, (0.0, 0.0, 0.1 + beyond)).tolist()))
    response = planned("rm1", start, goal, LinearMotion(least_fraction=0.0))
    assert response.code is PlanCode.SUCCESS
    assert seen("rm1", response)[0].positions[-1, 2] == pytest.approx(0.2, abs=3e-5)
    assert (response.fraction < 1.0) == (beyond > 1e-9)


def test_a_line_along_a_joints_limit_goes_all_the_way():
    start = (0.3, 0.8, 0.2)
    begin = planner_of("rm1").kinematics.tool(start).position
    goal = PoseGoal(position=tuple(np.add(begin, (-0.03, 0.02, 0.0)).tolist()))
    response = planned("rm1", start, goal, LinearMotion())
    assert response.code is PlanCode.SUCCESS
    assert seen("rm1", response)[0].positions[:, 2].max() <= 0.2 + 1e-9


class CountingClock:
    """Every look at it takes a millisecond."""

    def __init__(self) -> None:
        self.looks = 0

    def __call__(self) -> float:
        self.looks += 1
        return 1e-3 * self.looks


@KINDS
@pytest.mark.parametrize("timing", Timing)
def test_the_time_that_is_allowed_ends_a_way_wherever_it_is(kind: str, timing: Timing):
    planner = planner_of("parol6")
    start = planner.arm.named_states["ready"]
    begin = planner.kinematics.tool(start).position
    goal, motion = way(kind, begin, np.add(begin, (0.0, 0.05, 0.0)), 1.0)
    request = asked(planner, start, goal, motion=replace(motion, max_step=0.001), timing=timing, allowed_time=100.0)
    needed = CountingClock()
    assert planner.plan(request, None, clock=needed).code is PlanCode.SUCCESS
    assert needed.looks > 50  # once for each configuration at least
    late = 0
    for share in (0.05, 0.2, 0.4, 0.6, 0.8, 0.95):
        clock = CountingClock()
        response = planner.plan(replace(request, allowed_time=1e-3 * share * needed.looks), None, clock=clock)
        late += response.code is PlanCode.TIMED_OUT
        assert response.code is PlanCode.SUCCESS or clock.looks < share * needed.looks + 20
    assert late >= 4
