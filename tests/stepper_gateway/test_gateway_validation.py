"""Goals that are refused: each with the joint, the value, the limit and what would do."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from gemelo.schemas.message import Vector
from gemelo.schemas.motion import (
    FollowErrorCode,
    FollowJointTrajectoryGoal,
    JointTolerance,
    JointTrajectory,
    TrajectoryPoint,
)
from gemelo.services.stepper_gateway.goals.goal_validator import GoalValidator, MotionStart
from gemelo.services.stepper_gateway.goals.rejections import GoalRejected
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.virtual_arm import UNIX, VirtualArm, rm1
from tests.profiles import examples
from tests.stepper_gateway.harness import assert_within_limits, move
from tests.table import table

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)
NAMES = rm1().joint_names
GOAL = FollowErrorCode.INVALID_GOAL
JOINTS = FollowErrorCode.INVALID_JOINTS


def point(positions: Vector, t: float, velocities: Vector = ()) -> TrajectoryPoint:
    return TrajectoryPoint(positions=positions, velocities=velocities, time_from_start=t)


def trajectory(*points: TrajectoryPoint, names: tuple[str, ...] = NAMES, stamp: int = 0) -> JointTrajectory:
    return JointTrajectory(joint_names=names, points=points, stamp=stamp)


def refusal(goal: FollowJointTrajectoryGoal | JointTrajectory, presence: MotionStart | None = None) -> GoalRejected:
    if isinstance(goal, JointTrajectory):
        goal = FollowJointTrajectoryGoal(trajectory=goal)
    validator, parameters = GoalValidator(rm1().joints, 50_000), GatewayParameters()
    try:
        checked = validator.check(goal, UNIX, parameters)
        validator.path(checked, presence or MotionStart.at_rest(HOME), UNIX, parameters)
    except GoalRejected as rejected:
        return rejected
    pytest.fail("it was accepted")


Z = HOME
REFUSED: list[tuple[str, JointTrajectory, FollowErrorCode, tuple[str, ...]]] = [
    ("no points", trajectory(), GOAL, ("no points",)),
    ("an unknown joint", trajectory(point(Z, 1.0), names=("brazo", *NAMES[1:])), JOINTS, ('"brazo"', "brazo_joint")),
    ("a missing joint", trajectory(point(Z[:2], 1.0), names=NAMES[:2]), JOINTS, ("efector_joint",)),
    ("no joints", trajectory(point((), 1.0), names=()), JOINTS, ("brazo_joint",)),
    (
        "a joint twice",
        trajectory(point((0.0,) * 4, 1.0), names=(*NAMES, NAMES[0])),
        JOINTS,
        ("brazo_joint", "2 times"),
    ),
    ("time standing still", trajectory(point(Z, 1.0), point(Z, 1.0)), GOAL, ("does not increase", "point 1")),
    ("time going back", trajectory(point(Z, 2.0), point(Z, 1.0)), GOAL, ("2 s", "1 s")),
    ("a negative time", trajectory(point(Z, -1.0)), GOAL, ("negative",)),
    ("too few positions", trajectory(point((0.0, 0.0), 1.0)), GOAL, ("2 positions", "3 are needed")),
    ("too many velocities", trajectory(point(Z, 1.0, (0.0,) * 4)), GOAL, ("4 velocities",)),
    ("velocities at some points only", trajectory(point(Z, 0.0), point(Z, 1.0, Z)), GOAL, ("point 1", "velocities")),
    (
        "a final velocity",
        trajectory(point(Z, 0.0, Z), point((0.1, 0.0, 0.0), 1.0, (0.1, 0.0, 0.0))),
        GOAL,
        ("brazo_joint", "0.1 rad/s", "at rest"),
    ),
    (
        "an end in the past",
        trajectory(point(Z, 1.0), stamp=UNIX - 3_000_000_000),
        FollowErrorCode.OLD_HEADER_TIMESTAMP,
        ("2.000 s ago",),
    ),
    ("a far future", trajectory(point(Z, 1.0), stamp=UNIX + 10**12), GOAL, ("1000.0 s ahead",)),
    ("an hour and more", trajectory(point(Z, 4000.0)), GOAL, ("4000 s",)),
    (
        "a point beyond a limit",
        trajectory(point(Z, 0.0, Z), point((3.0, 0.0, 0.0), 9.0, Z)),
        GOAL,
        ("brazo_joint", "3.0000 rad", "upper limit 2.95", "point 1"),
    ),
    (
        "a point below a limit",
        trajectory(point((0.0, 0.0, -0.01), 9.0)),
        GOAL,
        ("efector_joint", "-0.0100 m", "lower limit 0.0000 m"),
    ),
    (
        "a bulge beyond a limit between points",
        trajectory(point(Z, 0.0, Z), point((0.0, 0.0, 0.002), 1.0, (0.0, 0.0, 0.02)), point(Z, 2.0, Z)),
        GOAL,
        ("efector_joint", "between points", "lower limit"),
    ),
    (
        "too hard",
        trajectory(point(Z, 0.0, Z), point((0.3, 0.0, 0.0), 0.5, Z)),
        GOAL,
        ("brazo_joint", "rad/s^2", "acceleration limit 1.57", "times as long"),
    ),
    (
        "a start elsewhere",
        move((0.1, 0.0, 0.0), READY),
        GOAL,
        ("brazo_joint", "starts at 0.1000 rad", "0.0000 rad", "plan from the present state"),
    ),
    (
        "a start elsewhere on the rail",
        move((0.0, 0.0, 0.01), READY),
        GOAL,
        ("efector_joint", "0.0100 m", "0.0020 m"),
    ),
    ("a single point too soon", trajectory(point((1.0, 0.0, 0.0), 0.5)), GOAL, ("0.500 s", "the limits need")),
    (
        "corners too sharp",
        trajectory(point(Z, 0.0), point((1.0, 0.0, 0.0), 1.0), point(Z, 2.0)),
        GOAL,
        ("brazo_joint", "acceleration", "velocities"),
    ),
]


@table(("goal", "code", "said"), [pytest.param(*r[1:], id=r[0]) for r in REFUSED])
def test_a_bad_goal_is_refused_with_what_is_wrong(
    goal: JointTrajectory, code: FollowErrorCode, said: tuple[str, ...]
) -> None:
    rejected = refusal(goal)
    assert rejected.code == code
    for part in said:
        assert part in str(rejected), rejected


def test_too_fast_is_refused_with_the_velocity_limit() -> None:
    far, near = (-2.9, 0.0, 0.0), (2.9, 0.0, 0.0)
    rejected = refusal(trajectory(point(far, 0.0, Z), point(near, 5.0, Z)), MotionStart.at_rest(far))
    for part in ("brazo_joint", "rad/s", "velocity limit 1.57", "times as long"):
        assert part in str(rejected)


def test_accelerations_without_velocities_are_refused() -> None:
    only = TrajectoryPoint(positions=Z, accelerations=Z, time_from_start=1.0)
    assert "velocities" in str(refusal(trajectory(only)))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"path_tolerance": (JointTolerance(name="brazo_jiont"),)}, 'did you mean "brazo_joint"'),
        ({"goal_tolerance": (JointTolerance(name="brazo_joint", position=-2.0),)}, "-1 for no bound"),
        ({"path_tolerance": (JointTolerance(name="brazo_joint", velocity=-7.0),)}, "velocity -7 is negative"),
        ({"goal_tolerance": (JointTolerance(name="brazo_joint", velocity=-1e-9),)}, "-1 for no bound"),
        ({"goal_tolerance": (JointTolerance(name="brazo_joint", acceleration=-7.0),)}, "acceleration -7 is negative"),
        ({"path_tolerance": (JointTolerance(name="brazo_joint", acceleration=1e-9),)}, "measures steps and velocities"),
        ({"goal_time_tolerance": -3.0}, "goal_time_tolerance"),
    ],
)
def test_a_bad_tolerance_is_refused(fields: dict[str, Any], said: str) -> None:
    goal = FollowJointTrajectoryGoal(trajectory=move(HOME, READY), **fields)
    assert said in str(refusal(goal))


def test_more_steps_a_second_than_the_tick_allows_are_refused() -> None:
    validator, parameters = GoalValidator(rm1().joints, 4_000), GatewayParameters()
    checked = validator.check(FollowJointTrajectoryGoal(trajectory=move(HOME, (2.5, 0.0, 0.0))), UNIX, parameters)
    with pytest.raises(GoalRejected, match=r"brazo_joint.*steps/s.*2000 steps/s"):
        validator.path(checked, MotionStart.at_rest(HOME), UNIX, parameters)


def test_the_order_of_the_names_is_kept() -> None:
    rig = VirtualArm().ready()
    plan = move(HOME, READY)
    turned = JointTrajectory(
        joint_names=plan.joint_names[::-1],
        points=tuple(
            replace(p, positions=p.positions[::-1], velocities=p.velocities[::-1], accelerations=p.accelerations[::-1])
            for p in plan.points
        ),
    )
    assert rig.goal(turned).accepted
    rig.finish()
    assert rig.position == pytest.approx(READY, abs=0.01)


def test_a_start_within_the_range_swept_while_moving_is_accepted() -> None:
    start = Knot((0.5, 0.0, 0.1), (0.3, 0.0, 0.0), (0.0, 0.0, 0.0))
    presence = MotionStart(start, (0.2, 0.0, 0.1), (0.5, 0.0, 0.1))
    validator, parameters = GoalValidator(rm1().joints, 50_000), GatewayParameters()
    goal = FollowJointTrajectoryGoal(trajectory=move((0.3, 0.0, 0.1), (1.0, 0.5, 0.1)))
    path = validator.path(validator.check(goal, UNIX, parameters), presence, UNIX, parameters)
    assert path.at(0.0).position == pytest.approx(start.position)
    assert path.at(0.0).velocity == pytest.approx(start.velocity)
    assert path.at(path.duration).position == pytest.approx((1.0, 0.5, 0.1))


numbers = st.one_of(st.floats(-4.0, 4.0), st.sampled_from([0.0, 2.95, -2.95, 0.2, 1e300, -1e300, 5e-324]))
vectors = st.one_of(st.tuples(*[numbers] * 3), st.lists(numbers, max_size=5).map(tuple))
points = st.builds(
    TrajectoryPoint,
    positions=vectors,
    velocities=st.one_of(st.just(()), vectors),
    accelerations=st.one_of(st.just(()), vectors),
    time_from_start=st.floats(-1.0, 20.0),
)
names = st.one_of(
    st.just(NAMES), st.permutations(NAMES).map(tuple), st.lists(st.text(max_size=5), max_size=4).map(tuple)
)
goals = st.builds(
    FollowJointTrajectoryGoal,
    trajectory=st.builds(
        JointTrajectory, joint_names=names, points=st.lists(points, max_size=4).map(tuple), stamp=st.integers(0, 2**62)
    ),
    goal_time_tolerance=st.floats(-2.0, 5.0),
)


@examples(quick=30, full=150)
@given(goals)
def test_any_goal_is_refused_or_its_path_keeps_the_limits(goal: FollowJointTrajectoryGoal) -> None:
    validator, parameters = GoalValidator(rm1().joints, 50_000), GatewayParameters()
    try:
        path = validator.path(validator.check(goal, UNIX, parameters), MotionStart.at_rest(HOME), UNIX, parameters)
    except GoalRejected:
        return
    for i in range(101):
        knot = path.at(path.duration * i / 100)
        for joint, p, v, a in zip(rm1().joints, *knot, strict=True):
            assert joint.lower - 1e-6 <= p <= joint.upper + 1e-6
            assert abs(v) <= joint.velocity * 1.01
            assert abs(a) <= joint.acceleration * 1.06


places = st.tuples(st.floats(-2.9, 2.9), st.floats(-2.9, 2.9), st.floats(0.0, 0.2))


@examples(quick=5, full=15)
@given(st.lists(st.tuples(places, st.floats(0.02, 2.0)), min_size=1, max_size=4))
def test_an_accepted_goal_never_leaves_the_limits_whenever_it_comes(program: list[tuple[Vector, float]]) -> None:
    rig = VirtualArm().ready()
    for index, (place, pause) in enumerate(program):
        here = rig.published["joint_states"][-1].position
        verdict = rig.goal(move(here, place), f"g{index}")
        assert verdict.accepted, verdict.reason
        rig.run(pause)
    rig.finish(f"g{len(program) - 1}")
    assert_within_limits(rig)
    for row in rig.path[::20]:
        for joint, steps in zip(rig.arm.joints, row, strict=True):
            assert joint.lower - 0.001 <= joint.steps.to_position(steps) <= joint.upper + 0.001
