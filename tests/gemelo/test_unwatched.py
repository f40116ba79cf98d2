"""No motion runs unwatched: what becomes of a simulated arm when a script is interrupted, ends or is gone.

`tests/stack/test_unwatched.py` kills real ones.
"""

from __future__ import annotations

import signal
from collections.abc import Callable

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from tests.simulated import is_moving, rests

FAR = 1.2  # [rad] of the first joint
BRAKED = 3.0  # [s] from a script's end to the arm's rest
ENDS: dict[str, Callable[[gemelo.Arm], None]] = {"closes": gemelo.Arm.close, "is gone": lambda arm: arm.node.close()}


@pytest.fixture
def goal(arm: SimulatedArm) -> float:
    """Wherever the first joint is not."""
    goal = -FAR if arm.joints["brazo_joint"] > 0.0 else FAR
    arm.move(joints={"brazo_joint": -goal, "antebrazo_joint": 0.0, "efector_joint": 0.1})
    return goal


@pytest.mark.parametrize("end", ENDS)
def test_a_script_that_ends_leaves_an_arm_that_decelerates(arm: SimulatedArm, goal: float, end: str) -> None:
    script = arm.sim.connect("script")
    motion = script.start(joints={"brazo_joint": goal}, speed=0.3)
    assert arm.wait_for(lambda: motion.progress > 0.2, 20.0)
    ended = arm.sim.now
    ENDS[end](script)
    assert rests(arm, BRAKED)
    assert arm.sim.now - ended < 0.8 * motion.plan.duration
    assert abs(arm.joints["brazo_joint"] - goal) > 0.1
    assert arm.device.mode is gemelo.DeviceMode.IDLE
    assert max(abs(error) for error in arm.step_errors.values()) <= 0.5 + 1e-9
    assert arm.move(joints={"brazo_joint": goal}).status is gemelo.GoalStatusCode.SUCCEEDED


@pytest.mark.parametrize("end", ENDS)
def test_a_detached_motion_goes_on(arm: SimulatedArm, goal: float, end: str) -> None:
    script = arm.sim.connect("script")
    motion = script.start(joints={"brazo_joint": goal}, speed=0.3, detached=True)
    assert arm.wait_for(lambda: motion.progress > 0.2, 20.0)
    ENDS[end](script)
    assert rests(arm, motion.plan.duration + 3.0)
    assert arm.joints["brazo_joint"] == pytest.approx(goal, abs=1e-3)


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize("way", ["jog", "stream"])
def test_a_script_that_ends_while_it_leads_by_hand_stops_the_arm(
    arm: SimulatedArm, goal: float, way: str, end: str
) -> None:
    script = arm.sim.connect("script")
    at, began, speed = script.joints["brazo_joint"], arm.sim.now, goal / 10.0
    while arm.sim.now - began < 1.0:
        if way == "jog":
            script.jog(joints={"brazo_joint": speed})
        else:
            script.stream({"brazo_joint": at + speed * (arm.sim.now - began)})
        arm.sim.sleep(0.02)
    assert is_moving(arm)
    ENDS[end](script)
    assert rests(arm, BRAKED)
    assert 0.0 < abs(arm.joints["brazo_joint"] + goal) < FAR


def test_ctrl_c_says_that_it_cancels_decelerates_and_then_raises(arm: SimulatedArm, goal: float) -> None:
    over: list[bool] = []
    pressed: list[float] = []

    def press_once(motion: gemelo.Motion) -> None:
        if not pressed and motion.progress > 0.2:
            pressed.append(motion.progress)
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(gemelo.Interrupted, match=r"^stopped by Ctrl-C: <Motion rm1: joints=.* canceled in") as stopped:
        arm.move(
            joints={"brazo_joint": goal}, speed=0.3, on_progress=press_once,
            on_cancel=lambda motion: over.append(motion.is_over),
        )  # fmt: skip
    assert pressed
    assert over == [False]
    assert stopped.value.status is gemelo.GoalStatusCode.CANCELED
    assert not is_moving(arm)
    assert abs(arm.joints["brazo_joint"] - goal) > 0.1
