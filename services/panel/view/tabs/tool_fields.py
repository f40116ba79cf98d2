"""The goal as numbers: where the tool is to be, and how it is to be turned where the arm can turn it at all."""

from __future__ import annotations

import time
from collections.abc import Callable, Coroutine
from math import degrees, radians
from typing import Any

import viser

import gemelo
from gemelo.libraries.arm.frames.transforms import Point, Quaternion, from_rpy, to_rpy
from gemelo.services.panel.model.goal import GoalState
from gemelo.services.panel.model.tool_turns import ALL_RINGS
from gemelo.services.panel.view.kit import OWN_CHANGE, Kit, set_if_new

PLACE_STEP, TURN_STEP = 0.1, 0.1  # [mm], [deg] of the fields
Event = viser.GuiEvent[viser.GuiVector3Handle]


class ToolFields:
    """Position in mm and, for an arm that turns its tool about all axes, roll, pitch and yaw in degrees."""

    def __init__(self, kit: Kit) -> None:
        self._operator, self._client = kit.operator, kit.client.client_id
        self._version, self._touched = -1, 0.0
        goal = self._operator.goal
        self._place = kit.gui.add_vector3(kit.words("tool_mm"), _shown_place(goal.goal), step=PLACE_STEP)
        self._place.on_update(self._leading(is_turned=False))
        self._turn: viser.GuiVector3Handle | None = None
        if goal.turns.rings == ALL_RINGS:
            self._turn = kit.gui.add_vector3(kit.words("tool_deg"), _shown_turn(goal.goal), step=TURN_STEP)
            self._turn.on_update(self._leading(is_turned=True))

    def show(self, goal: GoalState) -> None:
        """The pose of the goal, or the one that was asked for and cannot be."""
        if goal.version == self._version or time.monotonic() - self._touched < OWN_CHANGE:
            return
        self._version = goal.version
        set_if_new(self._place, "value", _shown_place(goal))
        if self._turn is not None:
            set_if_new(self._turn, "value", _shown_turn(goal))

    def _leading(self, is_turned: bool) -> Callable[[Event], Coroutine[Any, Any, None]]:
        async def lead(event: Event) -> None:  # in viser's loop: before a press that follows it
            self._lead(event, is_turned)

        return lead

    def _lead(self, event: Event, is_turned: bool) -> None:
        if event.client_id is None:
            return
        self._touched = time.monotonic()
        goal = self._operator.goal
        pose = gemelo.Pose(self._position(goal.goal), self._orientation(goal.goal))
        goal.set_pose(pose, self._client, is_turned=is_turned)

    def _position(self, goal: GoalState) -> Point:
        """[m] of the fields; exactly the goal's where they show it, since they round."""
        fields = zip(self._place.value, _shown_place(goal), _pose(goal).position, strict=True)
        x, y, z = (exact if typed == shown else typed / 1000.0 for typed, shown, exact in fields)
        return x, y, z

    def _orientation(self, goal: GoalState) -> Quaternion:
        """That of the fields; exactly the goal's where they show it, since they round."""
        if self._turn is None or tuple(self._turn.value) == _shown_turn(goal):
            return _pose(goal).orientation
        roll, pitch, yaw = (radians(value) for value in self._turn.value)
        return from_rpy(roll, pitch, yaw)


def _pose(goal: GoalState) -> gemelo.Pose:
    return goal.wanted or goal.pose


def _shown_place(goal: GoalState) -> Point:
    """[mm] as the fields show it."""
    x, y, z = (round(1000.0 * value, 1) for value in _pose(goal).position)
    return x, y, z


def _shown_turn(goal: GoalState) -> Point:
    """[deg] as the fields show it."""
    roll, pitch, yaw = (round(degrees(value), 1) for value in to_rpy(_pose(goal).orientation))
    return roll, pitch, yaw
