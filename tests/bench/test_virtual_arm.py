"""The gateway's core and the firmware's core together, in virtual time."""

from pathlib import Path

import pytest

from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import JointGoal, PlanRequest
from gemelo.services.planner.core import Planner
from gemelo.tools.bench.virtual_time import Tally, swinging
from gemelo.tools.virtual_arm.virtual_arm import PERIOD, VirtualArm, tcp_wire

ARM = load_arm(Path(__file__).parents[2] / "urdf/rm1")
PLANNER = Planner(ARM)


class Watch:
    """The largest step error, and where the arm is."""

    def __init__(self) -> None:
        self.largest = 0.0
        self.joints = JointState()

    def on_message(self, message: object) -> None:
        if isinstance(message, StepErrors):
            self.largest = max(self.largest, *map(abs, message.error))
        elif isinstance(message, JointState):
            self.joints = message


def go(world: VirtualArm, watch: Watch, goal_id: str, target: tuple[float, ...]) -> tuple[GoalStatusCode, str]:
    """Plans from where the arm is and follows; returns status and reason at the moment at which the goal has ended."""
    start = JointState(name=ARM.joint_names, position=watch.joints.position)
    plan = PLANNER.plan(PlanRequest(goal=JointGoal(name=ARM.joint_names, position=target), start=start), None)
    assert plan.refusal is None, plan.refusal
    verdict = world.goal(plan.trajectory, goal_id)
    assert verdict.accepted, verdict.reason
    status, result = world.finish(goal_id, 20.0)
    return status, result.error_string


@pytest.mark.parametrize("phase", range(0, 20_000, 2_500))
def test_goals_that_follow_one_another_at_once_all_succeed(phase):
    """Whenever the new stream's first chunk meets the device's report of the old one."""
    watch = Watch()
    world = VirtualArm(tcp_wire(), arm=ARM, on_message=watch.on_message, step_us=PERIOD, phase_us=phase)
    world.run(1.0)
    for number, name in enumerate(("ready", "left", "right", "lifted", "folded", "home")):
        status, reason = go(world, watch, f"goal-{number}", ARM.named_states[name])
        assert status is GoalStatusCode.SUCCEEDED, reason
        assert watch.largest <= 0.5 + 1 / 256


def test_no_chunk_and_no_step_is_lost_in_two_minutes_of_motion():
    tally = Tally()
    world = VirtualArm(tcp_wire(), arm=ARM, on_message=tally.on_message, step_us=PERIOD)
    world.run(1.0)
    goal = FollowJointTrajectoryGoal(trajectory=swinging(ARM, 120.0))
    verdict = world.goal(goal)
    assert verdict.accepted, verdict.reason
    world.run(122.0)
    assert len(tally.sent) > 2900
    assert tally.sent == tally.acknowledged
    assert tuple((q8 + 128) >> 8 for q8 in tally.last) == world.device.steps == (0, 0, 0)
    assert world.device.max_slot_error <= 128
