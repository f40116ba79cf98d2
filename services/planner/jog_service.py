"""Jogging on the bus: a loop of its own rate, only while there is something to jog."""

from __future__ import annotations

from collections.abc import Callable

from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.libraries.runtime.actions.keys import status_topic
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.topics import Latest
from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand, JogStatus
from gemelo.schemas.reasons import Reason, plain
from gemelo.schemas.topics import (
    CONTROL,
    DEVICE_STATUS,
    FOLLOW_JOINT_TRAJECTORY,
    JOG,
    JOG_INPUTS,
    JOG_STATUS,
    JOINT_TARGETS,
)
from gemelo.services.planner.collision.world import World
from gemelo.services.planner.jog.jog import NEVER, PERIOD, SILENCE, STATUS_PERIOD, Jog, signed
from gemelo.services.planner.jog.jog_command import objection
from gemelo.services.planner.jog.jog_log import JogLog, digest_of
from gemelo.services.planner.scene.standing import version_of


class JogService:
    """Steps a `Jog` in the node's thread of logic; `newest` gives the world of the scene as it is.

    The jog is made with the first command, so that an arm that is never jogged pays nothing.
    """

    def __init__(
        self,
        node: Node,
        arm: ArmDescription,
        states: Latest[JointState],
        newest: Callable[[], World],
        is_recorded: Callable[[], bool],
    ) -> None:
        """`is_recorded` says if what is jogged from is published."""
        self._node, self._arm, self._states, self._newest = node, arm, states, newest
        self._targets, self._status = node.publisher(JOINT_TARGETS), node.publisher(JOG_STATUS)
        self._goals = node.latest(status_topic(FOLLOW_JOINT_TRAJECTORY))
        self._device, self._control = node.latest(DEVICE_STATUS), node.latest(CONTROL)
        self._log = JogLog(node.publisher(JOG_INPUTS).put, is_recorded)
        self._active = NEVER  # [s] monotonic, of the newest command and the newest step
        self._client = ""  # the node that jogs
        self._refused = -1.0e9  # [s] monotonic, when another was told last that it may not
        self._world: World | None = None
        self._jog: Jog | None = None
        self._is_ticking = False
        node.subscribe_signed(JOG, self._on_command)

    def _on_command(self, command: JogCommand, writer: str) -> None:
        """The gateway decides whose targets move the arm; here others are kept from disturbing the holder's jog."""
        if (reason := objection(self._control.message, writer)) is not None:
            return self._refuse(reason, writer)
        now = self._node.monotonic()
        begins = not self._is_ticking and now - self._active > SILENCE
        self._client, self._active = writer, now
        self._log.taken(now, command, writer, begins, self._node.now())
        self._in_newest_world().on_command(command, now)
        if not self._is_ticking:
            self._is_ticking = True
            self._node.every(PERIOD, self._tick)

    def _tick(self) -> None:
        node, jog = self._node, self._in_newest_world()
        now, stamp, present, age = node.monotonic(), node.now(), self._states.message, self._states.age()
        goal_is_active, not_ready = self._goal_is_active, self._not_ready
        output = jog.step(now, stamp, present, age, goal_is_active, not_ready)
        targets, status = signed(output, self._client, self._told_to)
        if targets is not None:
            self._targets.put(targets)
        if status is not None:
            self._status.put(status)
        if output.said:
            node.log.warning(f"jog: {output.said}")
        self._active = now
        self._log.ticked(now, stamp, present, age, goal_is_active, not_ready, version_of(self._newest().scene),
                         self._told_to, digest_of(targets, status))  # fmt: skip
        if not jog.is_busy:
            self._is_ticking = False
            self._log.finish()
            node.forget(self._tick)

    @property
    def _told_to(self) -> str:
        """Whom a status is about: the node that jogs, where others may not; else all."""
        control = self._control.message
        return self._client if control is not None and control.held else ""

    def _refuse(self, reason: Reason, writer: str) -> None:
        now = self._node.monotonic()
        if now - self._refused >= STATUS_PERIOD:
            self._refused = now
            stamp = self._node.now()
            self._status.put(
                JogStatus(stamp=stamp, scale=0.0, limited_by=str(reason), client=writer, check="control", why=reason)
            )

    @property
    def _not_ready(self) -> Reason | None:
        status = self._device.message
        return None if status is None or not status.reason else status.why or plain(status.reason)

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
