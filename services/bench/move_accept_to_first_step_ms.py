"""From the acceptance of a goal to the first step pulse of the virtual ESP32 in real time.

The device's `started` event bears the time of the first step, mapped to this machine's clock by the gateway's clock
synchronisation. Nothing is taken off: the trajectories start with nearly the full acceleration from a whole step, so
that their own first step is due as soon as the arm's limits allow. The planner's moves start gently, within the jerk
limit; they stand beside it with the time at which their own first step is due.
"""

from __future__ import annotations

import math

from schemas.actions import GoalStatusCode
from schemas.device import DeviceEvent
from schemas.message import Vector
from schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from schemas.planning import JointGoal, PlanRequest
from schemas.topics import DEVICE_EVENTS, FOLLOW_JOINT_TRAJECTORY, JOINT_STATES, PLAN
from services.arm.description import Arm
from services.arm.interpolation import TrajectorySampler
from services.bench.figure import Figure, Goal, NotMeasured, of_samples, quantile, rounded
from services.bench.stacks import Running, Stacks

UNIT = "ms"
GOAL = Goal(median=25.0, p99=50.0)
ROUNDS = 40
SHARE = 0.95  # of the first joint's acceleration limit
RAMP = 0.2  # [s] of speeding up, and of slowing down
SWING = 0.05  # [rad] or [m] to either side of zero, for planned moves
GRID = 0.0002  # [s] to which the trajectory's own first step is found


def measure(stacks: Stacks) -> Figure:
    running = stacks.any_broker()
    started: list[DeviceEvent] = []

    def on_event(event: DeviceEvent) -> None:
        if event.event == "started":
            started.append(event)

    running.node.subscribe(DEVICE_EVENTS, on_event)
    states = running.node.latest(JOINT_STATES)

    def took(trajectory: JointTrajectory) -> float:
        started.clear()
        accepted = follow(running, trajectory)
        if not started:
            raise NotMeasured("the device reported no first step")
        return (started[0].stamp - accepted) * 1e-6

    sharp, sharp_due, gentle, gentle_due = [], [], [], []
    for number in range(ROUNDS):
        running.node.wait(0.1)
        if states.message is None:
            raise NotMeasured("no joint states")
        trajectory = sharp_start(running.arm, states.message.position, (-1.0) ** number)
        sharp.append(took(trajectory))
        sharp_due.append(first_step_due(running.arm, trajectory) * 1e3)
    for number in range(ROUNDS // 2):
        trajectory = planned(running, SWING * (-1.0) ** number)
        gentle.append(took(trajectory))
        gentle_due.append(first_step_due(running.arm, trajectory) * 1e3)
    reference = {
        "planned (jerk-limited) move median": rounded(quantile(gentle, 0.5)),
        "its own first step due": rounded(quantile(gentle_due, 0.5)),
        "PAROL6's Python API median": 50.0,
    }
    note = (
        f"{ROUNDS} moves of one joint at {SHARE:.0%} of its acceleration from the start; their own first step is due "
        f"{rounded(quantile(sharp_due, 0.5)):g} ms after it, which is part of the figure; PAROL6: published"
    )
    return of_samples(sharp, UNIT, GOAL, reference=reference, note=note)


def sharp_start(arm: Arm, here: Vector, direction: float, ramp: float = RAMP) -> JointTrajectory:
    """The first joint speeds up and slows down evenly, a parabola of `ramp` [s] each."""
    joint = arm.joints[0]
    acceleration = SHARE * joint.acceleration * direction
    points = []
    for time, way, speed in ((0.0, 0.0, 0.0), (ramp, 0.5, 1.0), (2 * ramp, 1.0, 0.0)):
        position = (here[0] + way * acceleration * ramp**2, *here[1:])
        velocity = (speed * acceleration * ramp, *(0.0 for _ in here[1:]))
        points.append(TrajectoryPoint(positions=position, velocities=velocity, time_from_start=time))
    return JointTrajectory(joint_names=arm.joint_names, points=tuple(points))


def planned(running: Running, position: float) -> JointTrajectory:
    """The planner's way to `position` of the first joint."""
    goal = JointGoal(name=(running.arm.joints[0].name,), position=(position,))
    plan = running.node.call(PLAN, PlanRequest(goal=goal), timeout=3.0)
    if plan.refusal is not None:
        raise NotMeasured(f"the planner refused: {plan.refusal.message}")
    return plan.trajectory


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
