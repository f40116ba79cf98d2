"""Goals that name some joints of the arm: the others stay where they are."""

from __future__ import annotations

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTolerance, JointTrajectory, TrajectoryPoint
from gemelo.schemas.reasons import because
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits
from gemelo.services.stepper_gateway.motion.paths import profile
from gemelo.tools.bench.scenes import parol6
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.harness import assert_within_limits, move

ARMS = {"rm1": rm1(), "parol6": parol6()}


def some(arm: ArmDescription, start: Vector, columns: tuple[int, ...], rises: Vector) -> JointTrajectory:
    """A jerk-limited move of the joints in `columns` by `rises` [rad] or [m], in that order of names."""
    end = tuple(p + dict(zip(columns, rises, strict=True)).get(i, 0.0) for i, p in enumerate(start))
    path = profile(Knot.at_rest(start), Knot.at_rest(end), Limits.of(arm.joints))
    assert path is not None
    count = round(path.duration / 0.05)
    knots = [path.at(path.duration * index / count) for index in range(count + 1)]
    points = [
        TrajectoryPoint(
            positions=tuple(knot.position[column] for column in columns),
            velocities=tuple(knot.velocity[column] if index < count else 0.0 for column in columns),
            accelerations=tuple(knot.acceleration[column] if index < count else 0.0 for column in columns),
            time_from_start=path.duration * index / count,
        )
        for index, knot in enumerate(knots)
    ]
    return JointTrajectory(joint_names=tuple(arm.joint_names[column] for column in columns), points=tuple(points))


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("columns", [(1,), (2, 0)])
def test_the_joints_that_a_goal_does_not_name_stay(name: str, columns: tuple[int, ...]) -> None:
    arm = ARMS[name]
    rig = VirtualArm(arm=arm, start=arm.named_states["ready"]).ready()
    begin, stood = rig.position, rig.device.steps
    rises = (0.1, 0.02)[: len(columns)] if name == "parol6" else (0.03, 0.1)[: len(columns)]
    assert rig.goal(some(arm, begin, columns, rises), "some").accepted
    assert rig.finish("some")[0] is GoalStatusCode.SUCCEEDED
    for column, joint in enumerate(arm.joints):
        if column in columns:
            there = begin[column] + rises[columns.index(column)]
            assert rig.position[column] == pytest.approx(there, abs=joint.steps.resolution)
        else:
            assert rig.device.steps[column] == stood[column]
    assert_within_limits(rig)


def test_a_goal_of_some_joints_follows_the_present_one_where_that_ends() -> None:
    rig = VirtualArm(start=(0.0, 0.0, 0.1)).ready()
    end = (0.5, 0.3, 0.12)
    assert rig.goal(move(rig.position, end), "first").accepted
    rig.run(0.3)
    second = FollowJointTrajectoryGoal(trajectory=some(rig.arm, end, (0,), (-0.2,)), after="first")
    assert rig.goal(second, "second").accepted
    assert rig.finish("first")[0] is GoalStatusCode.SUCCEEDED
    assert rig.finish("second")[0] is GoalStatusCode.SUCCEEDED
    assert rig.position == pytest.approx((0.3, 0.3, 0.12), abs=0.01)
    assert_within_limits(rig)


def test_its_tolerances_may_name_any_joint() -> None:
    rig = VirtualArm(start=(0.0, 0.0, 0.1)).ready()
    tolerances = (
        JointTolerance(name="brazo_joint", position=0.05),
        JointTolerance(name="efector_joint", position=-1.0),
    )
    goal = FollowJointTrajectoryGoal(trajectory=some(rig.arm, rig.position, (0,), (0.2,)), path_tolerance=tolerances)
    assert rig.goal(goal, "g").accepted
    assert rig.finish("g")[0] is GoalStatusCode.SUCCEEDED


def test_a_goal_of_no_joint_and_one_of_strangers_are_refused_by_name() -> None:
    rig = VirtualArm().ready()
    points = (TrajectoryPoint(positions=(), time_from_start=1.0),)
    names = rig.arm.joint_names
    nobody = rig.goal(JointTrajectory(points=points))
    assert nobody.why == because("goal.joints.missing", joints=names, known=names)
    stranger = rig.goal(JointTrajectory(joint_names=("codo",), points=points))
    assert stranger.why is not None
    assert stranger.why.code == "goal.joints.unknown"
