"""The planned motion played by a translucent arm, until the real one moves or it has been seen often enough."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import PlannedPath
from gemelo.services.visualizer.content import entities, palette
from gemelo.services.visualizer.content.arm_poses import arm_pose_at
from gemelo.services.visualizer.content.event_log import clamp_stamp
from gemelo.services.visualizer.content.updates import ClearEntity, TranslucentArm, Update
from gemelo.services.visualizer.model.rotations import Array
from gemelo.services.visualizer.model.visual_model import VisualModel

TIMES = 3  # that a motion is played
REST = 0.7  # [s] at its end
MOVING = 1e-3  # [rad/s] or [m/s]

DrawAttached = Callable[[str, palette.Rgba, int], list[Update]]  # under which arm, in which colour, when [ns]


def draw_nothing(root: str, color: palette.Rgba, now: int) -> list[Update]:
    """For a view that has no scene."""
    return []


class PlanPreview:
    """Of the newest plan; without joint positions in it there is none. `attached` draws what is in the arm's hand."""

    def __init__(self, model: VisualModel, attached: DrawAttached = draw_nothing) -> None:
        self._model, self._attached = model, attached
        self._rows: Array = np.empty((0, 0))
        self._times: Array = np.empty(0)
        self._began: int | None = None  # [ns] None: it has not been drawn
        self._is_over = True

    def on_planned_path(self, message: PlannedPath) -> None:
        """Another motion to play."""
        names = [joint.name for joint in self._model.moving]
        is_whole = len(message.times) == len(message.positions) > 1 and set(names) <= set(message.name)
        if not is_whole or any(len(row) != len(message.name) for row in message.positions):
            return
        columns = [message.name.index(name) for name in names]
        self._rows, self._times = np.array(message.positions, dtype=float)[:, columns], np.array(message.times)
        self._began, self._is_over = None, False

    def on_joint_state(self, message: JointState) -> None:
        """The real arm goes: now that is to be looked at."""
        if self._began is not None and any(abs(speed) > MOVING for speed in message.velocity):
            self._is_over = True

    def restart(self) -> None:
        """The viewer is a new one."""
        self._began = None

    def take(self, now: int) -> list[Update]:
        """The configuration of this moment; `now` in ns UNIX."""
        now = clamp_stamp(now)
        if self._is_over:
            gone: list[Update] = [ClearEntity(entities.PLANNED, now)] if self._began is not None else []
            self._began = None
            return gone
        drawn: list[Update] = []
        if self._began is None:
            self._began = now
            drawn = [
                ClearEntity(entities.PLANNED, now - 1),
                TranslucentArm(entities.PLANNED, now, frozenset(), palette.PLANNED),
                *self._attached(entities.PLANNED, palette.PLANNED, now),
            ]
        played, phase = divmod((now - self._began) / 1e9, float(self._times[-1]) + REST)
        self._is_over = played >= TIMES
        configuration = np.array([np.interp(phase, self._times, column) for column in self._rows.T])
        return [*drawn, *arm_pose_at(self._model, entities.PLANNED, now, configuration)]
