"""The gateway's core and the firmware's core together, in virtual time."""

from pathlib import Path

import pytest

from schemas.actions import GoalStatusCode
from schemas.joints import JointState, StepErrors
from schemas.motion import FollowJointTrajectoryGoal
from schemas.planning import JointGoal, PlanRequest
from services.arm.description import load_arm
from services.bench.virtual_arm import VirtualArm
from services.bench.virtual_time import Tally, swinging
from services.planner.core import Planner
from services.stepper_gateway.outputs import GoalFinished

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


def go(world: VirtualArm, watch: Watch, goal_id: str, target: tuple[float, ...]) -> GoalFinished:
    """Plans from where the arm is, follows, and returns the moment the goal has ended."""
    start = JointState(name=ARM.joint_names, position=watch.joints.position)
    plan = PLANNER.plan(PlanRequest(goal=JointGoal(name=ARM.joint_names, position=target), start=start), None)
    assert plan.refusal is None, plan.refusal
    verdict, outputs = world.gateway.on_goal(
        goal_id, FollowJointTrajectoryGoal(trajectory=plan.trajectory), world.moment
    )
    assert verdict.accepted, verdict.reason
    world.carry_out(outputs)
    for _ in range(1000):
        world.run(0.02)
        ended = [each for each in world.outcomes if isinstance(each, GoalFinished) and each.goal_id == goal_id]
        if ended:
            return ended[0]
    pytest.fail("the goal has not ended within 20 s")


@pytest.mark.parametrize("phase", range(0, 20_000, 2_500))
def test_goals_that_follow_one_another_at_once_all_succeed(phase):
    """Whenever the new stream's first chunk meets the device's report of the old one."""
    watch = Watch()
    world = VirtualArm(ARM, watch.on_message, phase=phase)
    world.run(1.0)
    for number, name in enumerate(("ready", "left", "right", "lifted", "folded", "home")):
        ended = go(world, watch, f"goal-{number}", ARM.named_states[name])
        assert ended.status is GoalStatusCode.SUCCEEDED, ended.result.error_string
        assert watch.largest <= 0.5 + 1 / 256


def test_no_chunk_and_no_step_is_lost_in_two_minutes_of_motion():
    tally = Tally()
    world = VirtualArm(ARM, tally.on_message)
    world.run(1.0)
    goal = FollowJointTrajectoryGoal(trajectory=swinging(ARM, 120.0))
    verdict, outputs = world.gateway.on_goal("swing", goal, world.moment)
    assert verdict.accepted, verdict.reason
    world.carry_out(outputs)
    world.run(122.0)
    assert len(tally.sent) > 2900
    assert tally.sent == tally.acknowledged
    assert tuple((q8 + 128) >> 8 for q8 in tally.last) == world.device.steps == (0, 0, 0)
    assert world.device.max_slot_error <= 128
