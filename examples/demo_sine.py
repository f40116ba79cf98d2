"""Moves all joints along a sine about where they stand: targets at 10 Hz, which the gateway follows in its limits."""

from math import pi, sin

from schemas.joints import JointTargets
from schemas.topics import JOINT_STATES, JOINT_TARGETS
from services.runtime.node import Node

AMPLITUDE, PERIOD = 0.02, 5.0  # [rad] or [m], [s]

with Node("demo_sine") as node:
    joints, targets = node.latest(JOINT_STATES), node.publisher(JOINT_TARGETS)
    while joints.message is None:
        node.wait(0.1)
    names, centre, begin = joints.message.name, joints.message.position, node.now()

    def step(now: int) -> None:
        offset = AMPLITUDE * sin(2.0 * pi * (now - begin) * 1e-9 / PERIOD)
        targets.put(JointTargets(stamp=now, name=names, position=tuple(each + offset for each in centre)))

    node.spin(step, rate=10.0)
