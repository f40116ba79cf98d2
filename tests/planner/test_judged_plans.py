"""Plans of both arms for any request: each holds before another library's eyes, or is a refusal with a reason."""

from __future__ import annotations

import time
from collections import Counter

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.planners import NAMES
from gemelo.schemas.planning import (
    CircularMotion,
    FkRequest,
    FreeMotion,
    IkRequest,
    LinearMotion,
    PlanCode,
    PlanRequest,
    PlanResponse,
    PointToPoint,
    PoseGoal,
    WaypointGoal,
)
from gemelo.schemas.planning import (
    Motion as AskedMotion,
)
from gemelo.schemas.scene import PlanningScene
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.core import Planner
from gemelo.services.planner.kinematics.kinematic_requests import KinematicRequests
from tests.planner.drawn_requests import INNER, cases, pose_goals, tool_cases
from tests.planner.independent import Array, Judge, Motion
from tests.planner.judging import (
    arm_of,
    asked,
    configuration_at,
    joints,
    planner_of,
    require_pose,
    require_reached,
    require_refused,
    require_sound,
    show,
)
from tests.profiles import count, examples

ARMS = pytest.mark.parametrize("name", ["rm1", "parol6"])
UNSURE = 1e-5  # [m] within which coal and MuJoCo may disagree on a touch
OFF = 1e-4  # [m] that a line or an arc may be left by


def judged(planner: Planner, request: PlanRequest, scene: PlanningScene) -> tuple[PlanResponse, Motion | None]:
    """The plan and its motion, sound and at its goal; None for a refusal, whose touches are true."""
    show(planner, scene)
    response = planner.plan(request, None, clock=time.monotonic)
    assert request.start is not None
    begin = Judge(planner.arm, scene).nearest(np.array(request.start.position)).distance
    if abs(begin) > UNSURE:
        assert (response.code is PlanCode.START_STATE_IN_COLLISION) == (begin < 0.0)
    if response.code is not PlanCode.SUCCESS:
        refusal = require_refused(response)
        if refusal.configuration:
            near = Judge(planner.arm, scene).nearest(np.array(refusal.configuration)).distance
            assert near <= CLEARANCE + 0.001, refusal
        return response, None
    motion = require_sound(planner, request, response)
    if response.fraction == 1.0:
        require_reached(planner, request, response)
    return response, motion


@pytest.mark.scaled
@ARMS
def test_no_plan_of_the_joints_touches_anything_or_breaks_a_limit(name: str):
    planner, outcomes = planner_of(name), Counter[str]()

    @examples(quick=15, full=60)
    @given(case=cases(planner))
    def check(case: tuple[PlanningScene, PlanRequest]) -> None:
        scene, request = case
        response = judged(planner, request, scene)[0]
        outcomes[response.planner_id or response.code.name] += 1

    check()
    assert outcomes["straight"] >= count(quick=3, full=10), outcomes
    assert sum(outcomes[searched] for searched in NAMES) >= count(quick=1, full=3), outcomes


@pytest.mark.scaled
@ARMS
def test_no_line_leaves_its_line(name: str):
    planner, outcomes = planner_of(name), Counter[PlanCode]()

    @examples(quick=10, full=40)
    @given(case=tool_cases(planner, is_arc=False))
    def check(case: tuple[PlanningScene, PlanRequest]) -> None:
        scene, request = case
        response, motion = judged(planner, request, scene)
        outcomes[response.code] += 1
        if motion is not None:
            assert isinstance(request.goal, PoseGoal)
            rows = Judge(planner.arm).tool_way(motion.positions[::5])
            way = np.array(request.goal.position) - rows[0]
            along = (rows - rows[0]) @ way / (way @ way)
            assert np.linalg.norm(rows - rows[0] - np.outer(along, way), axis=1).max() < OFF
            assert along[-1] == pytest.approx(response.fraction, abs=1e-4)
            assert (np.diff(along) > -1e-9).all()
            require_tool_limits(request, motion, rows)

    check()
    assert outcomes[PlanCode.SUCCESS] >= count(quick=2, full=8), outcomes


@pytest.mark.scaled
@ARMS
def test_no_arc_leaves_its_arc(name: str):
    planner, outcomes = planner_of(name), Counter[PlanCode]()

    @examples(quick=10, full=40)
    @given(case=tool_cases(planner, is_arc=True))
    def check(case: tuple[PlanningScene, PlanRequest]) -> None:
        scene, request = case
        response, motion = judged(planner, request, scene)
        outcomes[response.code] += 1
        if motion is not None:
            assert isinstance(request.goal, PoseGoal)
            assert isinstance(request.motion, CircularMotion)
            rows = Judge(planner.arm).tool_way(motion.positions[::5])
            begin, interim, end = rows[0], np.array(request.motion.interim), np.array(request.goal.position)
            assert off_arc(rows, begin, interim, end) < OFF
            assert np.linalg.norm(rows - interim, axis=1).min() < 2e-3
            require_tool_limits(request, motion, rows)

    check()
    assert outcomes[PlanCode.SUCCESS] >= count(quick=1, full=4), outcomes


def off_arc(rows: Array, begin: Array, interim: Array, end: Array) -> float:
    """[m] that the worst row is away from the circle through three points."""
    a, b = interim - begin, end - begin
    normal = np.cross(a, b)
    centre = begin + np.cross((a @ a) * b - (b @ b) * a, normal) / (2.0 * normal @ normal)
    up = (rows - centre) @ normal / np.linalg.norm(normal)
    flat = np.sqrt(np.maximum(np.sum((rows - centre) ** 2, axis=1) - up**2, 0.0))
    return float(np.hypot(up, flat - np.linalg.norm(begin - centre)).max())


def require_tool_limits(request: PlanRequest, motion: Motion, rows: Array) -> None:
    """The tool's own speed, by differences."""
    assert isinstance(request.motion, LinearMotion | CircularMotion)
    if request.motion.speed:
        speed = np.linalg.norm(np.diff(rows, axis=0), axis=1) / np.diff(motion.times[::5])
        assert speed.max() <= request.motion.speed * 1.001


@pytest.mark.scaled
@ARMS
def test_every_configuration_that_ik_gives_has_the_pose_that_was_asked_for(name: str):
    planner = planner_of(name)
    served = KinematicRequests(planner.arm, planner.kinematics)
    ready = planner.arm.named_states["ready"]
    standing = asked(planner, ready, joints(planner, ready))

    @examples(quick=15, full=60)
    @given(goal=pose_goals(planner, ready))
    def check(goal: PoseGoal) -> None:
        response = served.ik(IkRequest(goal=goal, near=standing.start, solutions=8, avoid_collisions=False), None)
        assert response.code is PlanCode.SUCCESS, response.refusal
        for solution in response.solutions:
            require_pose(planner, goal, standing, np.array(solution.position))
            assert all(j.is_within(value) for j, value in zip(planner.arm.joints, solution.position, strict=True))
            position = Judge(planner.arm).tool(np.array(solution.position))[0]
            (told,) = served.fk(FkRequest(name=response.name, position=solution.position), None).poses
            assert told.translation == pytest.approx(position, abs=1e-9)

    check()


@ARMS
@examples(quick=5, full=15)
@given(start=INNER, goal=INNER, share=st.floats(0.1, 1.0))
def test_half_the_scaling_is_half_the_speed(name: str, start: tuple[float, ...], goal: tuple[float, ...], share: float):
    """Half the velocity's scaling, a quarter of the acceleration's: a jerk limit of its own keeps it from being exact
    but where the full speed is reached."""
    planner = planner_of(name)
    show(planner, PlanningScene())
    begin, end = (configuration_at(planner, shares) for shares in (start, goal))
    if max(abs(a - b) for a, b in zip(begin, end, strict=True)) < 0.01:
        return
    peaks, durations = [], []
    for scaling in (share, 0.5 * share):
        request = asked(planner, begin, joints(planner, end), motion=PointToPoint(), velocity_scaling=scaling)
        response = planner.plan(request, None)
        if response.code is not PlanCode.SUCCESS:
            require_refused(response)
            return
        peaks.append(peak(planner, require_sound(planner, request, response)))
        durations.append(response.duration)
    assert peaks[1] <= 0.5 * share
    assert durations[1] > durations[0]
    if peaks[0] > 0.99 * share:
        assert peaks[1] == pytest.approx(0.5 * peaks[0], rel=0.01)


def peak(planner: Planner, motion: Motion) -> float:
    """The largest share of a joint's speed."""
    return float((np.abs(motion.velocities).max(axis=0) / [joint.velocity for joint in planner.arm.joints]).max())


@pytest.mark.scaled
@ARMS
def test_the_same_seed_gives_the_same_plan_in_another_planner_too(name: str):
    one, other = planner_of(name), Planner(arm_of(name))
    other.prepare()
    compared = 0

    @examples(quick=5, full=15)
    @given(case=cases(one))
    def check(case: tuple[PlanningScene, PlanRequest]) -> None:
        nonlocal compared
        scene, request = case
        request = msgspec.structs.replace(request, allowed_time=20.0)
        answers = []
        for planner in (one, other):
            show(planner, scene)
            quick = msgspec.structs.replace(request, allowed_time=1.0)
            if planner is one and one.plan(quick, None, clock=time.monotonic).code is PlanCode.TIMED_OUT:
                return
            answers.append(planner.plan(request, None, clock=time.monotonic))
        first, second = answers
        assert first.code == second.code
        assert first.trajectory == second.trajectory
        compared += first.code is PlanCode.SUCCESS

    check()
    assert compared >= count(quick=1, full=3)


@ARMS
@pytest.mark.parametrize("motion", [PointToPoint(), FreeMotion(), LinearMotion()])
def test_a_links_frame_is_where_it_is_at_the_start_whatever_comes_before(name: str, motion: AskedMotion):
    planner = planner_of(name)
    show(planner, PlanningScene())
    start = planner.arm.named_states["ready"]
    frame, begin = planner.arm.model.links[1].name, Judge(planner.arm).tool(np.array(start))[0]
    origin, turned = Judge(planner.arm).pose(frame, np.array(start))
    first, last = (
        PoseGoal(position=tuple((turned.T @ (begin + way - origin)).tolist()), frame=frame)
        for way in ((-0.02, 0.05, 0.0), (-0.02, 0.05, 0.02))
    )
    request = asked(planner, start, WaypointGoal(points=(first, last)), motion=motion)
    response = planner.plan(request, None)
    require_sound(planner, request, response)
    require_reached(planner, request, response)


def test_an_arc_that_leaves_a_joints_limit_between_two_configurations_ends_at_the_limit():
    """joint_5 bulges 0.03 degrees beyond its limit, and comes back, all within one step along the arc."""
    planner = planner_of("parol6")
    show(planner, PlanningScene())
    start = (0.30819208941302545, -2.026106195422172, 3.003444209680637, 1.1929009039732086, 1.5079644737231006,
             3.8799085962705906)  # fmt: skip
    goal = PoseGoal(position=(0.10610979159991403, 0.0865623976603225, 0.44163359910628397))
    interim = (0.11198497190528284, 0.08041448214710362, 0.4396034407190639)
    whole = asked(planner, start, goal, motion=CircularMotion(interim=interim))
    refusal = require_refused(planner.plan(whole, None))
    assert (refusal.check, refusal.subject) == ("joint limit", "joint_5")
    part = asked(planner, start, goal, motion=CircularMotion(interim=interim, least_fraction=0.1))
    response = planner.plan(part, None)
    motion = require_sound(planner, part, response)
    assert response.stopped_by is not None
    assert response.stopped_by.subject == "joint_5"
    limit = planner.arm.joint("joint_5").upper
    assert motion.positions[-1, 4] == pytest.approx(limit, abs=2e-3)
