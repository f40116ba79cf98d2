"""A jogged arm keeps its limits and its distance whatever is commanded, and can always stop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.planning import JogCommand
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.jog.jog import PERIOD
from tests.planner.jogging import Jogged, arm_of
from tests.profiles import examples

TIGHT = 1e-9


def commands(name: str) -> st.SearchStrategy[JogCommand | None]:
    """Joints, twists in either frame, nonsense speeds, and silence."""
    arm = arm_of(name)
    share = st.floats(-3.0, 3.0)
    joints = st.tuples(*[share] * len(arm.joints)).map(
        lambda shares: JogCommand(
            name=arm.joint_names,
            velocity=tuple(s * joint.velocity for s, joint in zip(shares, arm.joints, strict=True)),
        )
    )
    speeds = st.tuples(*[st.floats(-0.4, 0.4)] * 3)
    twists = st.builds(
        JogCommand, linear=speeds, angular=st.just(()) | speeds, frame=st.sampled_from(("", arm.tool_frame))
    )
    return joints | twists | st.none() | st.just(JogCommand(linear=(1e300, 0.0, 0.0)))


def programs(name: str) -> st.SearchStrategy[list[tuple[JogCommand | None, int]]]:
    return st.lists(st.tuples(commands(name), st.integers(1, 30)), min_size=2, max_size=5)


def require_safe(jogged: Jogged) -> None:
    """Of all that was commanded, and of all that the tracker made of it."""
    joints = jogged.arm.joints
    lower, upper = (np.array([getattr(joint, name) for joint in joints]) for name in ("lower", "upper"))
    speed, acceleration = (
        np.array([getattr(joint, name) for joint in joints]) for name in ("velocity", "acceleration")
    )
    knots = np.array([knot.position for knot in jogged.knots])
    for positions in (np.array(jogged.commanded or knots), knots):
        assert np.all(positions >= lower - TIGHT)
        assert np.all(positions <= upper + TIGHT)
    velocities = np.array([np.zeros(len(joints)), *jogged.velocities])
    assert np.all(np.abs(velocities) <= speed * (1.0 + TIGHT))
    assert np.all(np.abs(np.diff(velocities, axis=0)) <= acceleration * PERIOD * (1.0 + TIGHT))
    for positions in [*jogged.commanded, *knots]:
        assert jogged.world.distance(positions) >= CLEARANCE


def run(name: str, program: list[tuple[JogCommand | None, int]]) -> None:
    jogged = Jogged(name)
    for command, count in program:
        jogged.hold(command, count * PERIOD)
        for knot in jogged.abandoned()[::4]:
            assert jogged.world.distance(knot.position) >= CLEARANCE
    jogged.let_go()
    require_safe(jogged)
    assert not jogged.said or "jog command" in jogged.said[0], jogged.said
    assert jogged.tracker.knot.is_at_rest


@examples(quick=6, full=20)
@given(programs("rm1"))
def test_rm1_keeps_limits_and_distance_and_can_always_stop(program: list[tuple[JogCommand | None, int]]) -> None:
    run("rm1", program)


@examples(quick=4, full=12)
@given(programs("parol6"))
def test_parol6_keeps_limits_and_distance_and_can_always_stop(program: list[tuple[JogCommand | None, int]]) -> None:
    run("parol6", program)


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_held_against_a_joint_limit_it_comes_to_rest_just_before_and_says_so(name: str) -> None:
    jogged = Jogged(name, crowded=False)
    joint = jogged.arm.joints[0]
    jogged.hold(JogCommand(name=(joint.name,), velocity=(joint.velocity,)), 5.0)
    assert 0.0 <= joint.upper - jogged.commanded[-1][0] < 0.005
    assert f"joint limit of {joint.name}" in jogged.limits()
    assert jogged.statuses[-1].active
    jogged.hold(JogCommand(name=(joint.name,), velocity=(-joint.velocity,)), 0.5)
    assert jogged.commanded[-1][0] < joint.upper - 0.1


@pytest.mark.parametrize(
    ("name", "joint", "sign", "obstacle"), [("rm1", "brazo_joint", 1.0, "post"), ("parol6", "joint_1", 1.0, "post")]
)
def test_driven_at_an_obstacle_it_stops_at_the_clearance_and_may_come_away(
    name: str, joint: str, sign: float, obstacle: str
) -> None:
    jogged = Jogged(name, start="ready" if name == "parol6" else "home")
    speed = sign * 0.3 * jogged.arm.joint(joint).velocity
    jogged.hold(JogCommand(name=(joint,), velocity=(speed,)), 6.0)
    held = jogged.world.distance(jogged.commanded[-1])
    assert CLEARANCE <= held < CLEARANCE + 0.004
    assert obstacle in jogged.limits()
    jogged.hold(JogCommand(name=(joint,), velocity=(-speed,)), 1.0)
    assert jogged.world.distance(jogged.commanded[-1]) > held + 0.02
