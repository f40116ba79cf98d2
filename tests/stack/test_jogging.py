"""`gemelo jog` with its keys, on the whole stack: the arm moves while keys come, and stops whatever ends them."""

from __future__ import annotations

import subprocess
import time
from itertools import pairwise

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import NamedGoal, PlanCode, PlanRequest
from gemelo.schemas.topics import PLAN, STEP_ERRORS
from gemelo.tools.cli.common.errors import ExitCode
from tests.stack.gemelo import COMMAND, gemelo
from tests.stack.person import jumps
from tests.stack.typist import Typist

pytestmark = pytest.mark.alone

UP, DOWN = "\x1b[A", "\x1b[B"
SPEED = 0.2  # of the limits, with which the keys begin
STOPPED = 2.5  # [s] after the last key: its repetition, the dead-man, what is under way to the device, and braking
TOOL_MOVED = 0.02  # [rad] of the joint that goes farthest while the tool is led for a second
NOISE = 1.25  # of the acceleration limit: the device's clock is mapped to a few per cent between two states


@pytest.fixture
def errors(operator):
    """The worst step error of every report."""
    worst: list[float] = []
    operator.node.subscribe(STEP_ERRORS, lambda message: worst.append(max(map(abs, message.error))))
    return worst


def stand_at(operator, name):
    """The arm at a named state, and what is seen of it from then on."""
    assert operator.wait_for(lambda: operator.seen and not operator.is_moving(), 60.0)
    plan = operator.node.call(PLAN, PlanRequest(goal=NamedGoal(name=name), allowed_time=5.0), timeout=15.0)
    assert plan.code is PlanCode.SUCCESS, plan.refusal
    assert operator.send(plan).wait(plan.duration + 10.0).status is GoalStatusCode.SUCCEEDED
    operator.seen.clear()
    assert operator.wait_for(lambda: operator.seen and not operator.is_moving(), 60.0)


def rest(operator, last):
    """Until the arm stands; how long [s] after the key of the moment `last`."""
    assert operator.wait_for(lambda: not operator.is_moving(), STOPPED + 5.0)
    return time.monotonic() - last


def went(operator):
    """[rad] or [m] of the first joint."""
    return operator.seen[-1].position[0] - operator.seen[0].position[0]


def require_smooth(operator, errors):
    """Executed within the limits of velocity and acceleration, and no step was lost."""
    assert not jumps(operator.arm, operator.seen)
    for column, joint in enumerate(operator.arm.joints):
        rates = [(s.stamp * 1e-9, s.velocity[column]) for s in operator.seen]
        bends = [abs(v - u) / (b - a) for (a, u), (b, v) in pairwise(rates) if b - a > 0.01]
        assert max(bends) <= NOISE * joint.acceleration, joint.name
    assert errors
    assert max(errors) <= 0.5 + 1e-9


def test_the_arm_moves_while_a_key_is_held_and_stops_when_it_is_let_go(stack, operator, errors):
    stand_at(operator, "ready")  # bent: at "home" it is stretched, and the tool is held by the singularity
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        last = typist.hold(UP, 1.5)
        assert operator.is_moving()
        assert rest(operator, last) < STOPPED
        moved = went(operator)
        joint = operator.arm.joints[0]
        assert 0.3 * SPEED * joint.velocity < moved < 2.5 * SPEED * joint.velocity
        assert "100 % of the asked speed" in typist.shown
        before = operator.seen[-1].position
        typist.hold_while("a", lambda: not operator.is_moving())
        last = typist.hold("a", 1.0)
        assert rest(operator, last) < STOPPED
        assert max(abs(b - a) for a, b in zip(before, operator.seen[-1].position, strict=True)) > TOOL_MOVED
        typist.type("x")
        assert typist.ended() == ExitCode.OK
    require_smooth(operator, errors)


@pytest.mark.parametrize("key", ["x", "\x1b", "\x03", "\x04"], ids=["x", "Esc", "Ctrl-C", "Ctrl-D"])
def test_a_key_that_leaves_stops_the_arm_and_gives_the_terminal_back(stack, operator, errors, key):
    stand_at(operator, "home")
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        assert not typist.terminal_is_as_before
        typist.hold(UP, 0.8)
        typist.type(key)
        left = time.monotonic()
        assert typist.ended() == ExitCode.OK
        assert typist.terminal_is_as_before
        assert "tool x" in typist.shown.splitlines()[-1]
        assert rest(operator, left) < STOPPED
    assert went(operator) > 0.0
    require_smooth(operator, errors)


def test_a_killed_jog_stops_the_arm(stack, operator, errors):
    stand_at(operator, "home")
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        last = typist.hold(UP, 0.8)
        typist.command.kill()
        assert rest(operator, last) < STOPPED
    require_smooth(operator, errors)


def test_keys_during_a_planned_motion_are_refused_and_do_not_disturb_it(stack, operator, errors):
    stand_at(operator, "home")
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        plan = operator.plan(0.4)
        handle = operator.send(plan)
        assert operator.wait_for(operator.is_moving, 60.0)
        typist.hold(UP, 0.6)
        assert typist.until("refused: a goal is being carried out; cancel it first", 60.0), typist.shown
        outcome = handle.wait(plan.duration + 10.0)
        typist.type("x")
        assert typist.ended() == ExitCode.OK
    assert outcome.status is GoalStatusCode.SUCCEEDED, outcome.result.error_string
    assert outcome.result.executed_steps == outcome.result.commanded_steps
    require_smooth(operator, errors)


def test_a_move_asked_for_while_keys_are_held_is_refused_and_the_arm_goes_on_with_the_keys(stack, operator, errors):
    stand_at(operator, "home")
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        typist.hold(UP, 0.5)
        mover = subprocess.Popen([*COMMAND, "move", "--named", "left"], cwd=stack.root, env=stack.environment,
                                 stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)  # fmt: skip
        last = typist.hold_while(UP, lambda: mover.poll() is None)
        assert operator.is_moving()
        assert mover.returncode == ExitCode.FAILED
        assert 'refused (moving start): "brazo_joint" moves at' in mover.communicate()[0]
        assert rest(operator, last) < STOPPED
        typist.type("x")
        assert typist.ended() == ExitCode.OK
    require_smooth(operator, errors)


def test_a_goal_that_begins_where_the_keys_have_led_takes_over_without_a_jump(stack, operator, errors):
    stand_at(operator, "home")
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        typist.type("-" * 8)  # so slow that the arm is still there when the goal arrives
        typist.hold(UP, 1.0)
        assert operator.is_moving()
        here = JointState(name=operator.arm.joint_names, position=operator.seen[-1].position)
        plan = operator.node.call(PLAN, PlanRequest(goal=NamedGoal(name="left"), start=here), timeout=10.0)
        assert plan.code is PlanCode.SUCCESS, plan.refusal
        typist.type(UP)
        handle = operator.follow.send(FollowJointTrajectoryGoal(trajectory=plan.trajectory))
        typist.hold(UP, 1.0)
        assert typist.until("a goal is being carried out", 60.0), typist.shown
        outcome = handle.wait(plan.duration + 10.0)
        assert outcome.status is GoalStatusCode.SUCCEEDED, outcome.result.error_string
        typist.type("x")
        assert typist.ended() == ExitCode.OK
    require_smooth(operator, errors)


def test_keys_stop_before_an_obstacle_and_lead_out_of_one_that_is_put_onto_the_arm(stack, operator, errors):
    stand_at(operator, "home")
    post = ("--box", "50mm", "50mm", "400mm")
    try:
        gemelo(stack, "scene", "add", "post", *post, "--at", "360mm", "180mm", "200mm")
        with Typist(stack, "jog", pause=operator.node.wait) as typist:
            typist.hold(UP, 0.5)
            typist.hold_while(UP, operator.is_moving)
            typist.hold(UP, 1.0)  # the last millimetre takes its time
            assert "collision of antebrazo_link and post" in typist.shown
            assert "mm apart, 4 mm stay free)" in typist.shown
            typist.forget()
            assert typist.until("at rest", STOPPED)
            gemelo(stack, "scene", "move", "post", "--at", "350mm", "160mm", "200mm")
            operator.node.wait(0.2)
            before = operator.seen[-1].position[0]
            typist.forget()
            typist.hold(UP, 0.6)
            assert "contact of " in typist.shown
            assert "mm inside one another: they may only come away, slowly)" in typist.shown
            assert operator.seen[-1].position[0] == pytest.approx(before, abs=1e-3)
            last = typist.hold(DOWN, 3.0)
            assert rest(operator, last) < STOPPED
            assert operator.seen[-1].position[0] < before - 0.1
            typist.type("x")
            assert typist.ended() == ExitCode.OK
    finally:
        gemelo(stack, "scene", "clear")
    require_smooth(operator, errors)


def test_a_fault_while_jogging_is_said_with_its_joint_and_its_remedy(stack, operator):
    stand_at(operator, "home")
    with Typist(stack, "jog", pause=operator.node.wait) as typist:
        typist.hold(UP, 0.5)
        gemelo(stack, "device", "press", "switch", "limit_q2", "on")
        typist.hold(UP, 2.0)
        shown = typist.shown
        typist.type("x")
        assert typist.ended() == ExitCode.OK
    assert 'has a fault: LIMIT_SWITCH at joint "antebrazo_joint": its limit switch was pressed' in shown
    assert "`gemelo reset`, `gemelo home`" in shown
    gemelo(stack, "device", "press", "switch", "limit_q2", "auto")
    refused = gemelo(stack, "jog", "--joint", "brazo_joint=5deg/s", "--for", "1", code=ExitCode.FAILED)
    assert 'LIMIT_SWITCH at joint "antebrazo_joint"' in refused
    gemelo(stack, "reset")
