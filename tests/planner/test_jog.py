"""Jogging: the dead-man, the direction of the tool, when it begins and ends, and what is said about it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand
from gemelo.schemas.reasons import Reason, because, remedy
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.jog.jog import DEAD_MAN, PERIOD, SILENCE, Jog
from tests.planner.jogging import Jogged, arm_of, kinematics_of, world_of
from tests.profiles import examples

TURN = JogCommand(name=("brazo_joint",), velocity=(0.5,))


def test_silence_of_a_tenth_of_a_second_brakes_the_arm_to_rest():
    jogged = Jogged("rm1", crowded=False)
    jogged.hold(TURN, 1.0)
    assert jogged.velocities[-1][0] == pytest.approx(0.5)
    jogged.hold(None, DEAD_MAN - PERIOD)
    assert jogged.velocities[-1][0] == pytest.approx(0.5)
    jogged.hold(None, 3 * PERIOD)
    assert jogged.velocities[-1][0] < 0.5
    jogged.let_go(2.0)
    assert jogged.tracker.knot.is_at_rest
    assert jogged.tracker.knot.position == pytest.approx(jogged.commanded[-1].tolist(), abs=1e-6)
    assert not jogged.statuses[-1].active


def test_the_arm_never_goes_back_where_it_stops():
    jogged = Jogged("parol6", crowded=False)
    jogged.hold(JogCommand(name=("joint_2",), velocity=(0.4,)), 0.8)
    jogged.let_go()
    track = [knot.position[1] for knot in jogged.knots]
    assert min(np.diff(track)) > -1e-6


@pytest.mark.parametrize("frame", ["base", "tool"])
@pytest.mark.parametrize("name", ["rm1", "parol6"])
@examples(quick=5, full=10)
@given(direction=st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1))
def test_the_tool_goes_in_the_commanded_direction_however_much_it_is_slowed(
    name: str, frame: str, direction: tuple[float, float, float]
) -> None:
    jogged = Jogged(name, crowded=False)
    displacement = np.array(direction) / np.linalg.norm(direction)
    in_frame = jogged.arm.tool_frame if frame == "tool" else ""
    pose = jogged.kinematics.tool(jogged.tracker.knot.position)
    wanted = pose.rotation @ displacement if frame == "tool" else displacement
    jogged.hold(JogCommand(linear=tuple(displacement * 0.5), frame=in_frame), 0.4)
    for positions, velocity in zip(jogged.commanded[:8], jogged.velocities[:8], strict=True):
        motion = jogged.kinematics.jacobian(positions)[:3] @ velocity
        if np.linalg.norm(motion) > 1e-6:
            assert motion @ wanted / np.linalg.norm(motion) > 0.98
    moved = jogged.kinematics.tool(jogged.commanded[-1])
    if name == "parol6":  # six joints: the tool keeps its orientation
        assert np.allclose(moved.rotation, pose.rotation, atol=0.02)


def test_absurd_speeds_are_the_limits_and_it_is_said():
    jogged = Jogged("rm1", crowded=False)
    jogged.hold(JogCommand(name=("brazo_joint", "antebrazo_joint"), velocity=(1e12, 5e11)), 1.4)
    limit = jogged.arm.joint("brazo_joint").velocity
    assert jogged.velocities[-1][0] <= limit
    assert jogged.velocities[-1][1] == pytest.approx(0.5 * jogged.velocities[-1][0])
    assert "speed limit of brazo_joint" in jogged.limits()
    assert jogged.statuses[0].scale == pytest.approx(limit / 1e12)


def test_an_unknown_joint_is_named_once_and_nothing_moves():
    jogged = Jogged("rm1")
    jogged.hold(JogCommand(name=("braso_joint",), velocity=(0.5,)), 0.5)
    assert jogged.said == ['rm1 has no joint "braso_joint"; did you mean "brazo_joint"?']
    assert "braso_joint" in jogged.statuses[-1].limited_by
    assert not np.any(jogged.velocities)


@pytest.mark.parametrize(
    ("command", "why"),
    [
        (
            JogCommand(name=("brazo_joint",), velocity=(0.1, 0.2)),
            because("jog.command.count", joints=1, velocities=2),
        ),
        (
            JogCommand(name=("brazo_joint", "brazo_joint"), velocity=(0.1, 0.2)),
            because("jog.command.twice", joint="brazo_joint"),
        ),
        (JogCommand(linear=(0.1, 0.2)), because("jog.command.values", part="linear", count=2)),
        (
            JogCommand(linear=(0.1, 0.0, 0.0), frame="moon"),
            because("jog.command.frame", remedy("use_one_of", names=("base_link", "efector_link")), frame="moon"),
        ),
        (
            JogCommand(name=("brazo_joint",), velocity=(0.1,), linear=(0.1, 0.0, 0.0)),
            because("jog.command.both", remedy("one_of_both")),
        ),
    ],
)
def test_a_command_that_cannot_be_followed_is_a_stop_with_its_reason(command: JogCommand, why: Reason):
    jogged = Jogged("rm1")
    jogged.hold(TURN, 0.5)
    jogged.hold(command, 1.0)
    assert jogged.statuses[-1].limits[0].why == why
    assert jogged.statuses[-1].limited_by == str(why)
    assert not np.any(jogged.velocities[-1])


def test_rm1_has_no_angular_part_and_says_so():
    jogged = Jogged("rm1", crowded=False)
    jogged.hold(JogCommand(linear=(0.0, 0.05, 0.0), angular=(1.0, 0.0, 0.0)), 0.5)
    assert "only the linear part" in jogged.limits()
    assert (
        jogged.kinematics.tool(jogged.commanded[-1]).position[1]
        > jogged.kinematics.tool(jogged.commanded[0]).position[1]
    )


def test_it_slows_towards_a_singularity_and_not_away_from_it():
    jogged = Jogged("rm1", crowded=False)
    out = jogged.kinematics.tool(jogged.tracker.knot.position).position
    away = np.array([out[0], out[1], 0.0]) / np.linalg.norm(out[:2])
    jogged.hold(JogCommand(linear=tuple(0.08 * away)), 6.0)  # until the arm is stretched out
    assert "singularity" in jogged.limits()
    slow = jogged.statuses[-1]
    assert slow.scale < 0.2
    jogged.hold(JogCommand(linear=tuple(-0.08 * away)), 1.5)
    assert jogged.statuses[-1].manipulability > slow.manipulability


def test_a_goal_refuses_jogging_and_ends_it_and_it_begins_again_only_after_a_silence():
    jogged = Jogged("rm1", crowded=False)
    jogged.goal_is_active = True
    jogged.hold(TURN, 0.3)
    assert jogged.statuses[-1].why == because("jog.goal_active", remedy("cancel_first"))
    assert jogged.statuses[-1].limited_by == str(jogged.statuses[-1].why)
    assert not jogged.commanded
    jogged.goal_is_active = False
    jogged.hold(TURN, 0.3)
    assert jogged.commanded
    count = len(jogged.commanded)
    jogged.goal_is_active = True
    jogged.tick(TURN)
    assert jogged.said == ["a goal has taken over"]
    jogged.goal_is_active = False
    jogged.hold(TURN, 0.5)
    assert len(jogged.commanded) == count
    why = jogged.statuses[-1].why
    assert why is not None
    assert why.code == "jog.interrupted"
    assert why.remedies == (remedy("let_go_for", time=SILENCE),)
    jogged.hold(None, SILENCE + 1.0)
    jogged.hold(TURN, 0.3)
    assert len(jogged.commanded) > count


def test_it_begins_where_the_arm_was_measured():
    jogged = Jogged("rm1", start="left", crowded=False)
    jogged.tick(TURN)
    assert np.allclose(jogged.commanded[0], jogged.arm.named_states["left"], atol=1e-3)


def test_an_arm_that_does_not_follow_ends_the_jog_by_name():
    arm = arm_of("rm1")
    jog = Jog(arm, kinematics_of("rm1"), world_of("rm1", crowded=False))
    state = JointState(name=arm.joint_names, position=arm.named_states["ready"], velocity=(0.0, 0.0, 0.0))
    said = ""
    for index in range(100):
        jog.on_command(TURN, index * PERIOD)
        said = said or jog.step(index * PERIOD, 0, state, 0.0, goal_is_active=False).said
    assert "brazo_joint does not follow" in said
    assert jog.commanded is None


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_an_arm_may_still_stand_until_its_first_targets_have_come_through(name: str):
    arm = arm_of(name)
    jog = Jog(arm, kinematics_of(name), world_of(name, crowded=False))
    rest = (0.0,) * len(arm.joints)
    state = JointState(name=arm.joint_names, position=arm.named_states["ready"], velocity=rest)
    fast = JogCommand(name=arm.joint_names, velocity=tuple(0.5 * joint.velocity for joint in arm.joints))
    for index in range(round(0.4 / PERIOD)):
        jog.on_command(fast, index * PERIOD)
        output = jog.step(index * PERIOD, 0, state, 0.0, goal_is_active=False)
        assert output.targets is not None, output.said


def test_without_a_fresh_state_it_is_refused():
    arm = arm_of("rm1")
    jog = Jog(arm, kinematics_of("rm1"), world_of("rm1", crowded=False))
    jog.on_command(TURN, 0.0)
    output = jog.step(0.0, 0, None, float("inf"), goal_is_active=False)
    assert output.targets is None
    assert output.status is not None
    assert "joint" in output.status.limited_by


def test_what_appears_in_the_way_stops_the_arm_before_it():
    jogged = Jogged("rm1", start="home", crowded=False)
    command = JogCommand(name=("brazo_joint",), velocity=(0.3,))
    jogged.hold(command, 0.4)
    jogged.world = world_of("rm1", crowded=True)
    jogged.jog.set_world(jogged.world)
    jogged.hold(command, 4.0)
    assert CLEARANCE <= jogged.world.distance(jogged.commanded[-1]) < 0.01
    assert not np.any(np.abs(jogged.velocities[-1]) > 0.01)
    assert "post" in jogged.statuses[-1].limited_by


@pytest.mark.parametrize("name", ["rm1", "parol6"])
def test_the_arm_itself_keeps_to_the_line_of_the_tool(name: str):
    jogged = Jogged(name, crowded=False)
    begin = jogged.kinematics.tool(jogged.tracker.knot.position).position
    jogged.hold(JogCommand(linear=(0.0, 0.08, 0.0)), 0.8)
    jogged.let_go()
    displacement = np.array([jogged.kinematics.tool(knot.position).position for knot in jogged.knots]) - begin
    assert displacement[-1][1] > 0.04
    assert np.max(np.linalg.norm(displacement[:, [0, 2]], axis=1)) < 0.0015


def test_the_status_comes_ten_times_a_second():
    jogged = Jogged("rm1", crowded=False)
    jogged.hold(TURN, 2.0)
    assert 19 <= len(jogged.statuses) <= 21
    assert jogged.statuses[5].manipulability > 0.0
    assert jogged.statuses[5].scale == 1.0
