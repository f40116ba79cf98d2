"""Arms of four, five and seven joints, that no code has been written for: the planner does all with them."""

from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.libraries.arm.checks.check import check
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import FreeMotion, JogCommand, LinearMotion, PointToPoint, PoseGoal, Timing
from gemelo.schemas.scene import BoxShape, CylinderShape, PlanningScene, SceneObject, SphereShape
from gemelo.services.planner.collision.sphere_check import show_scene
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.core import Planner
from gemelo.services.planner.jog.jog import PERIOD, Jog
from gemelo.services.planner.native.native_planner import NativePlanner
from tests.planner.drawn_requests import cases, pose_goals
from tests.planner.independent import Judge
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
from tests.profiles import examples

ARMS = pytest.mark.parametrize("name", ["reach4", "slide5", "seven"])
THINGS = PlanningScene(
    version=3,
    objects=(
        SceneObject(name="box", shape=BoxShape(size=(0.1, 0.2, 0.1)), pose=Transform(translation=(0.3, 0.1, 0.3))),
        SceneObject(name="ball", shape=SphereShape(radius=0.08), pose=Transform(translation=(-0.2, 0.25, 0.4))),
        SceneObject(
            name="post", shape=CylinderShape(radius=0.03, length=0.6), pose=Transform(translation=(0.2, -0.3, 0.3))
        ),
    ),
)


def configurations(planner: Planner, count: int) -> np.ndarray:
    shares = np.random.default_rng(7).random((count, 7))
    return np.array([configuration_at(planner, tuple(row)) for row in shares])


@ARMS
def test_its_description_is_found_to_be_well(name: str):
    assert check(arm_of(name).folder) == []


@ARMS
def test_the_judge_and_the_planner_see_the_same_arm(name: str):
    planner = planner_of(name)
    world, judge = World(planner.arm, planner.kinematics, THINGS), Judge(planner.arm, THINGS)
    told = []
    for row in configurations(planner, 300):
        told.append(world.distance(row))
        judged = judge.nearest(row).distance
        assert (told[-1] <= 0.0) == (judged <= 0.0)
        assert told[-1] <= 0.0 or judged == pytest.approx(told[-1], abs=3e-6)
        assert judge.tool(row)[0] == pytest.approx(planner.kinematics.tool(row).position, abs=1e-12)
    assert 10 < np.sum(np.array(told) <= 0.0) < 290


@ARMS
def test_what_the_compiled_core_calls_free_is_free(name: str):
    planner = planner_of(name)
    core, judge = NativePlanner(planner.arm), Judge(planner.arm, THINGS)
    show_scene(core, World(planner.arm, planner.kinematics, THINGS))
    rows = configurations(planner, 600)
    free = core.free(rows)
    distances = np.array([judge.nearest(row).distance for row in rows])
    assert distances[free].min() > core.margin - 1e-5
    assert (distances[~free] < core.margin + 0.006).all()  # the margin, and what the spheres bulge
    assert 50 < free.sum() < 550


@ARMS
@pytest.mark.parametrize("planner_id", ["", "native", "RRTConnect"])
@pytest.mark.parametrize("timing", list(Timing))
def test_it_goes_around_what_stands_between(name: str, planner_id: str, timing: Timing):
    planner = planner_of(name)
    start = planner.arm.named_states["ready"]
    goal = turned(planner, start, -1.8)
    between = planner.kinematics.tool(0.5 * np.add(start, goal)).position
    post = SceneObject(
        name="post", shape=BoxShape(size=(0.05, 0.05, 0.05)), pose=Transform(translation=tuple(between.tolist()))
    )
    show(planner, PlanningScene(version=2, objects=(post,)))
    straight = asked(planner, start, joints(planner, goal), motion=PointToPoint())
    assert require_refused(planner.plan(straight, None)).subject.endswith("post")
    around = asked(planner, start, joints(planner, goal), motion=FreeMotion(planner_id=planner_id), timing=timing)
    response = planner.plan(around, None)
    require_sound(planner, around, response)
    require_reached(planner, around, response)
    assert response.planner_id != "straight"
    assert [margin.name for margin in response.margins] == list(planner.arm.joint_names)
    assert all(0.0 <= margin.share <= 1.0 for margin in response.margins)


def turned(planner: Planner, start: tuple[float, ...], by: float) -> tuple[float, ...]:
    """With the joint that turns the column elsewhere by so much [rad]."""
    column = next(index for index, joint in enumerate(planner.arm.joints) if joint.unit == "rad")
    return tuple(value + by * (index == column) for index, value in enumerate(start))


@pytest.mark.parametrize("turns", [1.0, -3.0, 14.0])
@pytest.mark.parametrize("planner_id", ["", "RRTConnect"])
def test_a_joint_without_limits_that_has_turned_often_is_planned_from_there(turns: float, planner_id: str):
    planner = planner_of("slide5")
    rolled = 2.0 * np.pi * turns
    start = (*planner.arm.named_states["ready"][:4], rolled)
    goal = turned(planner, start, -1.8)
    between = planner.kinematics.tool(0.5 * np.add(start, goal)).position
    post = SceneObject(
        name="post", shape=BoxShape(size=(0.05, 0.05, 0.05)), pose=Transform(translation=tuple(between.tolist()))
    )
    show(planner, PlanningScene(version=2, objects=(post,)))
    for asked_for in (joints(planner, goal), PoseGoal(position=tuple(planner.kinematics.tool(goal).position.tolist()))):
        request = asked(planner, start, asked_for, motion=FreeMotion(planner_id=planner_id), allowed_time=5.0)
        response = planner.plan(request, None, clock=time.monotonic)
        motion = require_sound(planner, request, response)
        require_reached(planner, request, response)
        assert np.abs(motion.positions[:, 4] - rolled).max() < 2.0 * np.pi


def test_a_joint_without_limits_that_has_turned_too_often_is_named():
    planner = planner_of("slide5")
    show(planner, PlanningScene())
    ready = planner.arm.named_states["ready"]
    wound = (*ready[:4], 2513.0)
    for start, goal in ((wound, ready), (ready, wound)):
        refusal = require_refused(planner.plan(asked(planner, start, joints(planner, goal)), None))
        assert (refusal.check, refusal.subject) == ("joint limit", "roll")
        assert "2513 rad" in refusal.message


@ARMS
@pytest.mark.parametrize("way", [(0.0, 0.05, 0.0), (0.0, 0.0, 0.04), (-0.03, 0.02, 0.02)])
def test_it_draws_a_line(name: str, way: tuple[float, float, float]):
    planner = planner_of(name)
    show(planner, PlanningScene())
    start, judge = planner.arm.named_states["ready"], Judge(planner.arm)
    begin = judge.tool(np.array(start))[0]
    request = asked(planner, start, PoseGoal(position=tuple((begin + way).tolist())), motion=LinearMotion())
    response = planner.plan(request, None)
    rows = judge.tool_way(require_sound(planner, request, response).positions)
    require_reached(planner, request, response)
    along = (rows - begin) @ way / np.dot(way, way)
    assert np.linalg.norm(rows - begin - np.outer(along, way), axis=1).max() < 1e-4


@ARMS
@examples(quick=6, full=20)
@given(data=st.data())
def test_poses_of_every_form_it_can_do_are_reached(name: str, data: st.DataObject):
    planner = planner_of(name)
    show(planner, PlanningScene())
    start = planner.arm.named_states["home"]
    goal = data.draw(pose_goals(planner, start))
    request = asked(planner, start, goal, allowed_time=5.0)
    response = planner.plan(request, None)
    if response.trajectory.points:
        require_sound(planner, request, response)
        require_pose(planner, goal, request, np.array(response.trajectory.points[-1].positions))
    else:
        assert require_refused(response).check in ("self-collision", "allowed time")


@ARMS
@examples(quick=4, full=10)
@given(data=st.data())
def test_no_plan_touches_anything_or_breaks_a_limit(name: str, data: st.DataObject):
    planner = planner_of(name)
    scene, request = data.draw(cases(planner))
    show(planner, scene)
    response = planner.plan(request, None)
    if response.trajectory.points:
        require_sound(planner, request, response)
        require_reached(planner, request, response)
    else:
        require_refused(response)


@ARMS
def test_it_is_jogged_by_its_joints_and_by_its_tool(name: str):
    planner = planner_of(name)
    arm, kinematics = planner.arm, planner.kinematics
    commands = [JogCommand(name=(joint.name,), velocity=(0.5 * joint.velocity,)) for joint in arm.joints]
    commands += [JogCommand(linear=way) for way in ((0.0, 0.05, 0.0), (0.0, 0.0, 0.05), (-0.03, 0.0, 0.0))]
    for command in commands:
        rows = jogged(planner, command)
        assert np.abs(np.diff(rows, axis=0)).max(axis=0) == pytest.approx(
            np.zeros(len(arm.joints)), abs=PERIOD * max(joint.velocity for joint in arm.joints)
        )
        moved = kinematics.tool(rows[-1]).position - kinematics.tool(rows[0]).position
        if command.linear:
            assert moved @ command.linear > 0.98 * np.linalg.norm(moved) * np.linalg.norm(command.linear)
            assert np.linalg.norm(moved) > 0.004
        else:
            others = [column for column, joint in enumerate(arm.joints) if joint.name != command.name[0]]
            assert not np.diff(rows, axis=0)[:, others].any()
            assert (rows[-1] - rows[0]).max() > 0.01


def jogged(planner: Planner, command: JogCommand) -> np.ndarray:
    """Where an arm that follows at once is led in half a second."""
    jog = Jog(planner.arm, planner.kinematics, World(planner.arm, planner.kinematics))
    positions = planner.arm.named_states["ready"]
    rows = [positions]
    for tick in range(25):
        now = tick * PERIOD
        jog.on_command(command, now)
        present = JointState(name=planner.arm.joint_names, position=positions)
        output = jog.step(now, tick, present, 0.0, goal_is_active=False)
        assert output.targets is not None, output
        assert jog.commanded is not None
        positions = tuple(jog.commanded[0].tolist())
        rows.append(positions)
        assert all(joint.is_within(value) for joint, value in zip(planner.arm.joints, positions, strict=True))
    return np.array(rows)
