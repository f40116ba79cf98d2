"""Jogging on the bus: a loop of its own rate, only while there is something to jog."""

from __future__ import annotations

from collections.abc import Callable

from schemas.joints import JointState
from schemas.planning import JogCommand
from schemas.topics import DEVICE_STATUS, FOLLOW_JOINT_TRAJECTORY, JOG, JOG_STATUS, JOINT_TARGETS
from services.arm.kinematics.kinematics import Kinematics
from services.arm.model.description import Arm
from services.planner.collision.world import World
from services.planner.jog.jog import PERIOD, Jog
from services.runtime.actions.keys import status_topic
from services.runtime.node import Node
from services.runtime.topics import Latest


class JogService:
    """Steps a `Jog` in the node's thread of logic; `newest` gives the world of the scene as it is.

    The jog is made with the first command, so that an arm that is never jogged pays nothing.
    """

    def __init__(self, node: Node, arm: Arm, states: Latest[JointState], newest: Callable[[], World]) -> None:
        self._node, self._arm, self._states, self._newest = node, arm, states, newest
        self._targets, self._status = node.publisher(JOINT_TARGETS), node.publisher(JOG_STATUS)
        self._goals = node.latest(status_topic(FOLLOW_JOINT_TRAJECTORY))
        self._device = node.latest(DEVICE_STATUS)
        self._world: World | None = None
        self._jog: Jog | None = None
        self._is_ticking = False
        node.subscribe(JOG, self._on_command)

    def _on_command(self, command: JogCommand) -> None:
        self._in_newest_world().on_command(command, self._node.monotonic())
        if not self._is_ticking:
            self._is_ticking = True
            self._node.every(PERIOD, self._tick)

    def _tick(self) -> None:
        node, states, jog = self._node, self._states, self._in_newest_world()
        device = self._device.message
        output = jog.step(
            node.monotonic(),
            node.now(),
            states.message,
            states.age(),
            self._goal_is_active,
            "" if device is None else device.reason,
        )
        if output.targets is not None:
            self._targets.put(output.targets)
        if output.status is not None:
            self._status.put(output.status)
        if output.said:
            node.log.warning(f"jog: {output.said}")
        if not jog.is_busy:
            self._is_ticking = False
            node.forget(self._tick)

    @property
    def _goal_is_active(self) -> bool:
        goals = self._goals.message
        return goals is not None and any(not goal.status.is_terminal for goal in goals.goals)

    def _in_newest_world(self) -> Jog:
        newest = self._newest()
        if self._jog is None:
            self._jog, self._world = Jog(self._arm, Kinematics(self._arm), newest), newest
        elif newest is not self._world:
            self._jog.set_world(newest)
            self._world = newest
        return self._jog
