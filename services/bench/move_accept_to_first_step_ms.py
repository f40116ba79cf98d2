"""From the acceptance of a goal to the first step pulse of the virtual ESP32 in real time.

The device's `started` event bears the time of the first step, mapped to this machine's clock by the gateway's clock
synchronisation. A trajectory that starts gently has its own first step some time after its start; that time is
computed from the trajectory and taken off, because no controller could be earlier.
"""

from __future__ import annotations

import math

from schemas.actions import GoalStatusCode
from schemas.device import DeviceEvent
from schemas.motion import FollowJointTrajectoryGoal, JointTrajectory
from schemas.planning import JointGoal, PlanRequest
from schemas.topics import DEVICE_EVENTS, FOLLOW_JOINT_TRAJECTORY, PLAN
from services.arm.description import Arm
from services.arm.interpolation import TrajectorySampler
from services.bench.figure import Figure, Goal, NotMeasured, of_samples, quantile, rounded
from services.bench.stacks import Running, Stacks

UNIT = "ms"
GOAL = Goal(median=25.0, p99=50.0)
ROUNDS = 40
SWING = 0.05  # [rad] or [m] to either side of zero
GRID = 0.0002  # [s] to which the trajectory's own first step is found


def measure(stacks: Stacks) -> Figure:
    running = stacks.any_broker()
    started: list[DeviceEvent] = []

    def on_event(event: DeviceEvent) -> None:
        if event.event == "started":
            started.append(event)

    running.node.subscribe(DEVICE_EVENTS, on_event)
    raw, due = [], []
    for number in range(ROUNDS):
        joint = running.arm.joints[0].name
        request = PlanRequest(goal=JointGoal(name=(joint,), position=(SWING * (-1.0) ** number,)))
        plan = running.node.call(PLAN, request, timeout=3.0)
        if plan.refusal is not None:
            raise NotMeasured(f"the planner refused: {plan.refusal.message}")
        started.clear()
        accepted = follow(running, plan.trajectory)
        if not started:
            raise NotMeasured("the device reported no first step")
        raw.append((started[0].stamp - accepted) * 1e-6)
        due.append(first_step_due(running.arm, plan.trajectory) * 1e3)
    samples = [took - physics for took, physics in zip(raw, due, strict=True)]
    note = (
        f"{ROUNDS} moves of one joint; the trajectory's own first step is due {rounded(quantile(due, 0.5)):g} ms after "
        f"its start and is taken off; with it: median {rounded(quantile(raw, 0.5)):g}, "
        f"p99 {rounded(quantile(raw, 0.99)):g} ms"
    )
    return of_samples(samples, UNIT, GOAL, note=note)


def follow(running: Running, trajectory: JointTrajectory) -> int:
    """Executes it; the time of acceptance [ns] UNIX."""
    client = running.node.action(FOLLOW_JOINT_TRAJECTORY)
    handle = client.send(FollowJointTrajectoryGoal(trajectory=trajectory))
    outcome = handle.wait(30.0)
    if outcome.status is not GoalStatusCode.SUCCEEDED:
        raise NotMeasured(f"a move ended as {outcome.status.name}: {outcome.result and outcome.result.error_string}")
    running.node.wait(0.1)
    return handle.accepted


def first_step_due(arm: Arm, trajectory: JointTrajectory) -> float:
    """[s] after the start at which the first joint's path is half a step or more from a whole one it stood on."""
    sampler = TrajectorySampler(trajectory)
    scales = [arm.joint(name).steps for name in trajectory.joint_names]

    def counts(time: float) -> tuple[int, ...]:
        positions = sampler.at(time)[0]
        return tuple(math.floor(s.to_steps(p) + 0.5) for s, p in zip(scales, positions, strict=True))

    standing = counts(0.0)
    for index in range(int(sampler.duration / GRID) + 1):
        if counts(index * GRID) != standing:
            return index * GRID
    raise NotMeasured("the trajectory has no step")
