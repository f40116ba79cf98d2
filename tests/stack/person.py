"""A person at the command: moves the arm, watches every joint state, and frees a device that holds."""

from __future__ import annotations

import time
from itertools import pairwise

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import load_deployment, project_root
from gemelo.libraries.runtime.errors import GoalRefused, NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.schemas.device import DeviceCommandRequest, DeviceMode, DeviceStopRequest, ReferenceCommand, StopKind
from gemelo.schemas.joints import JointState
from gemelo.schemas.motion import FollowJointTrajectoryGoal
from gemelo.schemas.planning import JointGoal, PlanCode, PlanRequest
from gemelo.schemas.topics import (
    DEVICE_COMMAND,
    DEVICE_SHAFT,
    DEVICE_STATE,
    DEVICE_STOP,
    FOLLOW_JOINT_TRAJECTORY,
    JOINT_STATES,
    PLAN,
)

HERE_OR_THERE = (0.45, -0.35)  # of the way from a joint's middle to its limits: two poses to go between
SETTLE = 10.0  # [s] for a stack to accept a goal again


class Operator:
    """A node of the test's own on the stack's bus."""

    def __init__(self, stack, name="operator"):
        self.stack = stack
        deployment = load_deployment(None, stack.environment)
        self.arm = load_arm(project_root() / deployment.robot)
        self.node = Node(name, deployment, robot=self.arm.name, stop=ShutdownRequest())
        self.seen: list[JointState] = []
        self.node.subscribe(JOINT_STATES, self._see)
        self.follow = self.node.action(FOLLOW_JOINT_TRAJECTORY)
        self.device = self.node.latest(DEVICE_STATE)
        self.shaft = self.node.latest(DEVICE_SHAFT)

    def close(self):
        self.node.close()

    def _see(self, state):
        self.seen.append(state)

    def wait_for(self, condition, timeout):
        """Handles the inbox until `condition()`; whether it came true."""
        deadline = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > deadline:
                return False
            self.node.wait(0.02)
        return True

    def pose(self, share):
        """A joint position inside the limits: `share` of the way from the middle to a limit."""
        middles = [(joint.lower + joint.upper) / 2 for joint in self.arm.joints]
        spans = [(joint.upper - joint.lower) / 2 for joint in self.arm.joints]
        return tuple(middle + share * span for middle, span in zip(middles, spans, strict=True))

    def plan(self, speed=1.0):
        """A trajectory to whichever of two poses is farther away."""
        self.seen.clear()
        assert self.wait_for(lambda: self.seen, 60.0), "no joint states"
        here = self.seen[-1].position
        poses = [self.pose(share) for share in HERE_OR_THERE]
        there = max(poses, key=lambda pose: max(abs(a - b) for a, b in zip(pose, here, strict=True)))
        request = PlanRequest(
            goal=JointGoal(name=self.arm.joint_names, position=there),
            velocity_scaling=speed,
            acceleration_scaling=speed,
        )
        plan = self.node.call(PLAN, request, timeout=5.0)
        assert plan.code is PlanCode.SUCCESS, plan.refusal
        return plan

    def send(self, plan, attached=False):
        """The handle of a goal, which ends with this node if `attached`; joint states are kept from here on."""
        self.seen.clear()
        goal = FollowJointTrajectoryGoal(
            trajectory=plan.trajectory, scene_version=plan.scene_version, scene_epoch=plan.scene_epoch
        )
        return self.follow.send(goal, attached=attached)

    def move(self, speed=1.0):
        """Plans and moves; the outcome."""
        plan = self.plan(speed)
        return self.send(plan).wait(plan.duration + 10.0)

    def is_moving(self):
        """Whether the last joint state says that some joint moves."""
        return bool(self.seen) and any(abs(velocity) > 1e-3 for velocity in self.seen[-1].velocity)

    def move_again(self):
        """Moves as soon as the stack lets it, doing what its refusals ask for; the outcome and what was done."""
        deadline = time.monotonic() + SETTLE
        done = []
        while True:
            try:
                done += self.free()
                return self.move(), done
            except (AssertionError, GoalRefused, NoAnswer, RequestRefused):
                if time.monotonic() > deadline:
                    raise
                self.node.wait(0.1)

    def free(self):
        self.wait_for(lambda: self.device.message is not None and not self.device.is_stale, 1.0)
        match self.device.message.mode:
            case DeviceMode.UNREFERENCED:
                wanted = self._where_it_stands()
                answer = self.node.call(DEVICE_COMMAND, DeviceCommandRequest(command=wanted), timeout=3.0)
                return [wanted] if answer.accepted else []
            case DeviceMode.HOLD:
                answer = self.node.call(DEVICE_STOP, DeviceStopRequest(), timeout=3.0)
                return [StopKind.STOP] if answer.accepted else []
            case _:
                return []

    def _where_it_stands(self):
        """A person looks at the arm before declaring: a virtual one says where its shafts are."""
        self.wait_for(lambda: self.shaft.message is not None and not self.shaft.is_stale, 2.0)
        seen = self.shaft.message
        positions = dict(zip(seen.name, seen.position, strict=True))
        clamped = tuple(joint.clamp(positions[joint.name]) for joint in self.arm.joints)
        return ReferenceCommand(name=self.arm.joint_names, position=clamped)


def jumps(arm, states):
    """Every place where a joint went farther between two states than its speed limit allows."""
    found = []
    for before, after in pairwise(states):
        dt = (after.stamp - before.stamp) * 1e-9
        for joint, old, new in zip(arm.joints, before.position, after.position, strict=True):
            # Two steps of rounding, and 2 ms by which the mapping of the device's clock may be off.
            allowed = joint.velocity * (max(dt, 0.0) + 0.002) + 2 / joint.steps.per_unit
            if abs(new - old) > allowed:
                found.append(f"{joint.name} went {new - old:.6f} in {dt * 1e3:.1f} ms, allowed {allowed:.6f}")
    return found
