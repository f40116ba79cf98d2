"""No motion runs unwatched: what becomes of the arm when a script is interrupted, ends, dies or forks, on the stack."""

from __future__ import annotations

import re
import signal
import time

import pytest

import gemelo
from gemelo.schemas.planning import JointGoal
from gemelo.tools.stack.stack import Stack
from tests.planner.walled import WALLED, past_the_wall
from tests.stack.scripts import ended, said, script

FAR = 1.2  # [rad] of the first joint
BRAKED = 3.0  # [s] from a script's end to the arm's rest
STANDS = 0.5  # [s] for which an arm that rests does not move
MOVES = """
    import os, time, gemelo
    arm = gemelo.connect()
    motion = arm.start(joints={{"brazo_joint": {goal}}}, speed=0.3{more})
    while motion.progress < 0.2:
        time.sleep(0.01)
    print(f"{{motion.plan.duration:.3f}}", flush=True)
    {then}
"""


@pytest.fixture
def goal(arm: gemelo.Arm) -> float:
    """Wherever the first joint is not."""
    goal = -FAR if arm.joints["brazo_joint"] > 0.0 else FAR
    arm.move(joints={"brazo_joint": -goal, "antebrazo_joint": 0.0, "efector_joint": 0.1})
    return goal


def is_moving(arm: gemelo.Arm) -> bool:
    return any(abs(speed) > 1e-3 for speed in arm.velocities.values())


def rests(arm: gemelo.Arm, timeout: float) -> bool:
    """True if it stands for half a second on end, from `timeout` [s] on at the latest."""
    end, stood = time.monotonic() + timeout, time.monotonic()
    while time.monotonic() - stood < STANDS:
        if is_moving(arm):
            stood = time.monotonic()
        if stood > end:
            return False
        time.sleep(0.02)
    return True


def test_a_script_that_is_killed_leaves_an_arm_that_decelerates(twin: Stack, arm: gemelo.Arm, goal: float) -> None:
    with script(twin, MOVES.format(goal=goal, more="", then="motion.wait()")) as process:
        duration = float(said(process))
        assert is_moving(arm)
        process.kill()
        process.wait()
        killed = time.monotonic()
    assert rests(arm, BRAKED)
    assert time.monotonic() - killed - STANDS < 0.8 * duration
    assert abs(arm.joints["brazo_joint"] - goal) > 0.1
    assert arm.device.mode is gemelo.DeviceMode.IDLE
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9
    assert "is gone, so it is cancelled" in twin.logs("stepper_gateway")
    assert arm.move(joints={"brazo_joint": goal}).status is gemelo.GoalStatusCode.SUCCEEDED


def test_a_detached_motion_goes_on_when_its_script_is_killed(twin: Stack, arm: gemelo.Arm, goal: float) -> None:
    with script(twin, MOVES.format(goal=goal, more=", detached=True", then="motion.wait()")) as process:
        duration = float(said(process))
        process.kill()
        process.wait()
    assert rests(arm, duration + 3.0)
    assert arm.joints["brazo_joint"] == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize("end", ["arm.close()", "pass", "raise SystemExit(3)", "os._exit(0)"])
def test_a_script_that_ends_leaves_an_arm_that_rests(twin: Stack, arm: gemelo.Arm, goal: float, end: str) -> None:
    with script(twin, MOVES.format(goal=goal, more="", then=end)) as process:
        said(process)
        code, _, errors = ended(process)
    assert (code, errors) == (3 if "3" in end else 0, "")
    assert rests(arm, BRAKED)
    assert abs(arm.joints["brazo_joint"] - goal) > 0.1


def test_ctrl_c_decelerates_and_then_raises(twin: Stack, arm: gemelo.Arm, goal: float) -> None:
    then = """
    told = []
    try:
        motion.wait(on_progress=lambda motion: told or told.append(print("waits", flush=True)))
    except gemelo.Interrupted as interrupted:
        assert interrupted.result == motion.result
        print(interrupted.stopped_at == motion.stopped_at, max(map(abs, arm.velocities.values())) < 1e-3, flush=True)
        raise
    """
    with script(twin, MOVES.format(goal=goal, more="", then=then)) as process:
        said(process)
        assert said(process) == "waits"  # Ctrl-C before the wait is the script's own
        process.send_signal(signal.SIGINT)
        assert said(process) == "True True"
        code, _, errors = ended(process)
    assert code == 1
    assert errors.splitlines()[-1].startswith("gemelo.api.errors.Interrupted: stopped by Ctrl-C: <Motion rm1: joints=")
    assert "canceled in" in errors
    assert not is_moving(arm)
    assert abs(arm.joints["brazo_joint"] - goal) > 0.1


def test_ctrl_c_says_that_it_cancels_before_the_arm_rests(twin: Stack, arm: gemelo.Arm, goal: float) -> None:
    text = f"""
    import gemelo
    with gemelo.connect() as arm:
        told = []
        try:
            arm.move(
                joints={{"brazo_joint": {goal}}},
                speed=0.3,
                on_progress=lambda motion: told or told.append(print("moves", flush=True)),
                on_cancel=lambda motion: print("over" if motion.is_over else "cancels", flush=True),
            )
        except gemelo.Interrupted as interrupted:
            print(interrupted.status.name, flush=True)
    """
    with script(twin, text) as process:
        assert said(process) == "moves"
        process.send_signal(signal.SIGINT)
        assert said(process) == "cancels"
        assert said(process) == "CANCELED"
        assert ended(process)[::2] == (0, "")
    assert abs(arm.joints["brazo_joint"] - goal) > 0.1


def test_ctrl_c_while_the_planner_searches_ends_the_plan_and_nothing_moves(twin: Stack, arm: gemelo.Arm) -> None:
    goal = past_the_wall()
    assert goal.start is not None
    assert isinstance(goal.goal, JointGoal)
    text = f"""
    import gemelo
    with gemelo.connect() as arm:
        to = dict(zip({goal.goal.name}, {goal.goal.position}))
        arm.move(joints=to, planner="RRTConnect", allowed_time=60.0, on_planning=lambda at: print(at.phase, flush=True))
    """
    arm.move(joints=dict(zip(goal.start.name, goal.start.position, strict=True)))
    arm.scene.replace(WALLED)
    where = arm.joints
    with script(twin, text) as process:
        while said(process) != "search":
            pass
        process.send_signal(signal.SIGINT)
        code, _, errors = ended(process)
    assert code == 1
    said_last = r"gemelo\.api\.errors\.Interrupted: the plan was cancelled after .* s, while searching: nothing moves"
    assert re.fullmatch(said_last, errors.splitlines()[-1])
    assert arm.joints == where


@pytest.mark.parametrize(
    "say", ['arm.jog(joints={"brazo_joint": speed})', 'arm.stream({"brazo_joint": at + speed * (time.time() - began)})']
)
def test_a_script_that_is_killed_while_it_leads_by_hand_stops_the_arm(
    twin: Stack, arm: gemelo.Arm, goal: float, say: str
) -> None:
    text = f"""
    import time, gemelo
    arm = gemelo.connect()
    at, began, speed = arm.joints["brazo_joint"], time.time(), {goal / 10.0}
    while True:
        {say}
        if time.time() - began > 1.0:
            print("goes", flush=True)
        time.sleep(0.02)
    """
    with script(twin, text) as process:
        said(process)
        assert is_moving(arm)
        process.kill()
        process.wait()
    assert rests(arm, BRAKED)
    assert 0.0 < abs(arm.joints["brazo_joint"] + goal) < FAR
