"""Jogging on the bus: a loop of its own rate, only while there is something to jog."""

from __future__ import annotations

from collections.abc import Callable

from schemas.joints import JointState
from schemas.planning import JogCommand, JogStatus
from schemas.topics import FOLLOW_JOINT_TRAJECTORY, JOG, JOG_STATUS, JOINT_TARGETS
from services.arm.description import Arm
from services.arm.kinematics import Kinematics
from services.planner.jog.jog import PERIOD, Jog
from services.planner.scene.scene_shapes import SceneError
from services.planner.scene.world import World
from services.runtime.action_keys import status_topic
from services.runtime.deployment import project_root
from services.runtime.node import Node
from services.runtime.topics import Latest


class JogService:
    """Steps a `Jog` in the node's thread of logic; `newest` gives the world of the scene as it is.

    Kinematics and world are its own, since a plan may be using the planner's in another thread; they are made with the
    first command, so that an arm that is never jogged pays nothing.
    """

    def __init__(self, node: Node, arm: Arm, states: Latest[JointState], newest: Callable[[], World]) -> None:
        self._node, self._arm, self._states, self._newest = node, arm, states, newest
        self._targets, self._status = node.publisher(JOINT_TARGETS), node.publisher(JOG_STATUS)
        self._goals = node.latest(status_topic(FOLLOW_JOINT_TRAJECTORY))
        self._kinematics: Kinematics | None = None
        self._seen: World | None = None  # the planner's world that ours is made after
        self._jog: Jog | None = None
        self._damage = ""  # why there is no jog
        self._is_ticking = False
        node.subscribe(JOG, self._on_command)

    def _on_command(self, command: JogCommand) -> None:
        jog = self._made()
        if jog is None:
            self._status.put(JogStatus(stamp=self._node.now(), scale=0.0, limited_by=self._damage))
            return
        jog.on_command(command, self._node.monotonic())
        if not self._is_ticking:
            self._is_ticking = True
            self._node.every(PERIOD, self._tick)

    def _tick(self) -> None:
        node, jog = self._node, self._made()
        if jog is None:
            return self._rest()
        output = jog.step(node.monotonic(), node.now(), self._states.message, self._states.age(), self._goal_is_active)
        if output.targets is not None:
            self._targets.put(output.targets)
        if output.status is not None:
            self._status.put(output.status)
        if output.said:
            node.log.warning(f"jog: {output.said}")
        if not jog.is_busy:
            self._rest()

    def _rest(self) -> None:
        self._is_ticking = False
        self._node.forget(self._tick)

    @property
    def _goal_is_active(self) -> bool:
        goals = self._goals.message
        return goals is not None and any(not goal.status.is_terminal for goal in goals.goals)

    def _made(self) -> Jog | None:
        """The jog, in the newest world; None while the scene cannot be made, where the arm stops at its last target."""
        newest = self._newest()
        if newest is not self._seen:
            self._seen, self._jog = newest, self._in_world_of(newest)
        return self._jog

    def _in_world_of(self, newest: World) -> Jog | None:
        self._kinematics = self._kinematics or Kinematics(self._arm)
        try:
            world = World(self._arm, self._kinematics, newest.scene, (project_root(), self._arm.folder))
        except (SceneError, OSError, ValueError) as error:
            self._damage = f"the scene cannot be made: {error}"
            self._node.log.error(f"jog: {self._damage}")
            return None
        if self._jog is None:
            return Jog(self._arm, self._kinematics, world)
        self._jog.set_world(world)
        return self._jog
