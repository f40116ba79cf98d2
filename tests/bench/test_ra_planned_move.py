"""A planned move played by a sketch on dialect "ra": planner, gateway and sketch in virtual time."""

from __future__ import annotations

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JointGoal, PlanRequest
from gemelo.services.planner.core import Planner
from gemelo.tools.virtual_arm.sketch_arm import SketchArm, ra_arm


def test_a_planned_move_and_back_arrive_at_the_shaft_to_the_step() -> None:
    arm = ra_arm()
    planner, world = Planner(arm), SketchArm(arm, jitter=0.05).referenced()
    names = ("left", "home")
    for name in names:
        start = JointState(name=arm.joint_names, position=world.published["joint_states"][-1].position)
        goal = JointGoal(name=arm.joint_names, position=arm.named_states[name])
        plan = planner.plan(PlanRequest(goal=goal, start=start), None)
        assert plan.refusal is None, plan.refusal
        assert world.goal(plan.trajectory, name).accepted
        assert world.finish(name)[0] is GoalStatusCode.SUCCEEDED
        wanted = [joint.steps.to_steps(p) for joint, p in zip(arm.joints, arm.named_states[name], strict=True)]
        assert all(abs(shaft - steps) <= 0.5 for shaft, steps in zip(world.sketch.shafts, wanted, strict=True))
        assert world.sketch.shafts == world.device.sent
    assert world.sketch.discarded == 0
