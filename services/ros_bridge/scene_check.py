"""A trajectory of ROS against our planning scene, before it is sent: MoveIt knows its own scene, and not ours.

The planner is asked for the validity of configurations along the straight lines of the joints between the points.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import pairwise

from msgspec.structs import replace

from gemelo.libraries.runtime.errors import NoAnswer, RequestRefused
from gemelo.libraries.runtime.node import Node
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory
from gemelo.schemas.planning import PlanCode, ValidityRequest
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.schemas.topics import SCENE, STATE_VALIDITY

STEP = 0.05  # [rad] or [m] of the joint that moves most between two configurations; chosen: 25 mm at 0.5 m
MOST = 400  # configurations of one trajectory; chosen: the burst that the planner takes of a client has 550
TO_ANSWER = 2.0  # [s] for one configuration

Then = Callable[[FollowJointTrajectoryGoal | Reason], None]


class SceneCheck:
    """Checks goals one after another, without waiting for an answer."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._scene = node.latest(SCENE)

    def check(self, goal: FollowJointTrajectoryGoal, then: Then) -> None:
        """`then(goal)`, with the scene that it is free of, or `then(reason)`: what touches, or that nobody answers."""
        scene = self._scene.message
        known = replace(goal, scene_version=scene.version, scene_epoch=scene.epoch) if scene is not None else goal
        self._next(known, along(goal.trajectory), then)

    def _next(self, goal: FollowJointTrajectoryGoal, left: Iterator[Vector], then: Then) -> None:
        position = next(left, None)
        if position is None:
            then(goal)
            return

        def answer() -> None:
            try:
                response = pending.response()
            except (RequestRefused, NoAnswer) as error:
                then(because("ros.goal.unchecked", error.reason))
                return
            if response.code is PlanCode.SUCCESS:
                self._next(goal, left, then)
            else:
                found = response.refusal
                then((found.why or plain(found.message)) if found is not None else because("ros.goal.invalid"))

        question = ValidityRequest(name=goal.trajectory.joint_names, position=position)
        pending = self._node.ask_at_once(STATE_VALIDITY, question, TO_ANSWER, lambda: self._node.post(answer))


def along(trajectory: JointTrajectory) -> Iterator[Vector]:
    """Configurations [rad] or [m] along the trajectory, at most `STEP` apart and at most `MOST`."""
    points = [each.positions for each in trajectory.points if each.positions]
    if len({len(each) for each in points}) > 1 or not points:
        return  # the gateway refuses it, with a reason
    far = sum(max(abs(b - a) for a, b in zip(one, other, strict=True)) for one, other in pairwise(points))
    step = max(STEP, far / max(1, MOST - len(points)))
    yield points[0]
    for one, other in pairwise(points):
        parts = math.ceil(max(abs(b - a) for a, b in zip(one, other, strict=True)) / step)
        for part in range(1, parts + 1):
            yield tuple(a + (b - a) * part / parts for a, b in zip(one, other, strict=True))
