"""The visualizer without Rerun: messages in, updates out, ten times a second. Pure.

Positions are in rad and m on the bus and in degrees and millimetres here, because here is the screen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from gemelo.schemas.control import ControlState
from gemelo.schemas.device import DeviceState, DeviceStatus, SensorReadings, ShaftPositions
from gemelo.schemas.joints import JointState, StepErrors
from gemelo.schemas.ledger import StepLedger, StoppingDistance
from gemelo.schemas.planning import PlannedPath
from gemelo.schemas.reasons import because, say
from gemelo.schemas.reasons.catalogue import ENGLISH
from gemelo.services.visualizer.content import entities
from gemelo.services.visualizer.content.arm_poses import arm_poses
from gemelo.services.visualizer.content.cameras import CameraView
from gemelo.services.visualizer.content.event_log import EventLog, clamp_stamp
from gemelo.services.visualizer.content.panel import PanelInputs, is_lost, panel, shaft_errors
from gemelo.services.visualizer.content.preview import MOVING, PlanPreview
from gemelo.services.visualizer.content.scene import MeshLoader, SceneView, load_no_mesh
from gemelo.services.visualizer.content.thinning import ThinnedSeries
from gemelo.services.visualizer.content.updates import LineStrip, Scalars, StateUpdate, TextPanel, Times, Tint, Update
from gemelo.services.visualizer.model.rotations import Array
from gemelo.services.visualizer.model.visual_model import VisualJoint, VisualModel

PANEL_PERIOD = 500_000_000  # [ns]
AGAIN = 5_000_000_000  # [ns] after which the mode is sent again: a viewer that comes late has only the newest data
AHEAD = 60_000_000_000  # [ns] chosen: a stamp further in the future is false, and the view would follow it there
FARTHEST = 1e9  # [rad], [m] or [steps]: no joint gets there; beyond it the view's arithmetic overflows
BAND = 0.5  # [steps] rounding to whole steps alone gives as much


class Visualizer:
    """The newest state of one arm, and the samples that have not been shown yet."""

    def __init__(
        self, model: VisualModel, robot: str, tool: str, load: MeshLoader = load_no_mesh, language: str = ENGLISH
    ) -> None:
        """`load` reads the mesh files of the scene; `language` is that of the texts."""
        self.model, self.language = model, language
        self.scene = SceneView(model, load)
        self.cameras = CameraView(model)
        self._preview = PlanPreview(model, self.scene.attached)
        self._tool = tool
        self._names = [joint.name for joint in model.moving]
        width = len(self._names)
        self._executed, self._commanded, self._errors = ThinnedSeries(width), ThinnedSeries(width), ThinnedSeries(width)
        self._shaft = ThinnedSeries(width)
        self.event_log = EventLog(language)
        self._path: PlannedPath | None = None
        self._path_is_new = False
        self._trail_end: Array | None = None  # where the trail ends
        self._shown = ("", "")  # mode, panel
        self._mode_at = 0  # [ns] UNIX, when the mode was sent last
        self._panel_at = 0
        self._latest = 0  # [ns] what is stamped later was never measured
        prismatic = frozenset(joint.name for joint in model.moving if joint.is_prismatic)
        self._panel_inputs = PanelInputs(robot=robot, prismatic=prismatic, language=language)

    def on_joint_state(self, message: JointState) -> None:
        """The measured joint state."""
        self._panel_inputs = replace(self._panel_inputs, joints=message)
        self._preview.on_joint_state(message)
        if any(abs(speed) > MOVING for speed in message.velocity):
            self.scene.on_motion()
        self._executed.add(message.stamp, self._row(message.name, message.position, self._executed))

    def on_joint_command(self, message: JointState) -> None:
        """The commanded joint state at the same instant."""
        self._commanded.add(message.stamp, self._row(message.name, message.position, self._commanded))

    def on_step_errors(self, message: StepErrors) -> None:
        """Commanded minus executed steps."""
        self._panel_inputs = replace(self._panel_inputs, errors=message)
        self._errors.add(message.stamp, self._row(message.name, message.error, self._errors))

    def on_device_state(self, message: DeviceState) -> None:
        """Mode, queue, counters."""
        self._panel_inputs = replace(self._panel_inputs, state=message)

    def on_device_status(self, message: DeviceStatus) -> None:
        """The device's connection status."""
        self._panel_inputs = replace(self._panel_inputs, status=message)

    def on_sensors(self, message: SensorReadings) -> None:
        """The readings of the board's sensors."""
        self._panel_inputs = replace(self._panel_inputs, sensors=message)

    def on_shaft(self, message: ShaftPositions) -> None:
        """The true shaft positions of a virtual device; a joint that starts or ends losing steps is logged."""
        before, after = shaft_errors(self._panel_inputs.shaft), shaft_errors(message)
        self._panel_inputs = replace(self._panel_inputs, shaft=message)
        # A loaded motor lags by a step and catches up; only what stays behind is worth the plot's scale.
        lost = [float(error) if is_lost(error) else 0.0 for error in after.values()]
        self._shaft.add(message.stamp, self._row(message.name, lost, self._shaft))
        for name, error in after.items():
            if is_lost(error) is not is_lost(before.get(name, 0)):
                text = say(because("view.shaft", joint=name, steps=error), self.language)
                self.event_log.add(message.stamp, text, "ERROR" if is_lost(error) else "INFO")

    def on_step_ledger(self, message: StepLedger) -> None:
        """How sure it is that no step is lost."""
        self._panel_inputs = replace(self._panel_inputs, ledger=message)

    def on_stopping_distance(self, message: StoppingDistance) -> None:
        """How far the tool goes if all is lost now."""
        self._panel_inputs = replace(self._panel_inputs, stopping=message)

    def on_control(self, message: ControlState) -> None:
        """Who alone may move the arm."""
        self._panel_inputs = replace(self._panel_inputs, control=message)

    def on_planned_path(self, message: PlannedPath) -> None:
        """The planned path of the tool."""
        self._path, self._path_is_new = message, True
        self._preview.on_planned_path(message)

    def step(self, now: int) -> list[Update]:
        """Everything new; `now` in ns UNIX."""
        self._latest = now + AHEAD
        return [*self._measured(), *self._ghost(), *self._step_errors(), *self._shafts(), *self._planned(),
                *self._preview.take(now), *self.scene.take(now), *self.cameras.take(now), *self._device(now),
                *self.event_log.take(now, self._latest)]  # fmt: skip

    def restart(self) -> None:
        """Sends the latched content again to a new viewer."""
        self._path_is_new = self._path is not None
        self.event_log.say_again()
        self.scene.restart()
        self.cameras.restart()
        self._preview.restart()
        self._shown, self._trail_end, self._panel_at = ("", ""), None, 0

    def _row(self, names: Sequence[str], values: Sequence[float], before: ThinnedSeries) -> list[float]:
        row = list(before.newest or (0.0,) * len(self._names))
        for name, value in zip(names, values, strict=False):
            if name in self._names:
                row[self._names.index(name)] = min(max(value, -FARTHEST), FARTHEST)
        return row

    def _measured(self) -> list[Update]:
        times, rows = self._executed.take(self._latest)
        if not len(times):
            return []
        plots = self._plots(times, rows, entities.executed)
        return [*arm_poses(self.model, entities.MEASURED, times, rows), *plots, *self._trail(times, rows)]

    def _ghost(self) -> list[Update]:
        times, rows = self._commanded.take(self._latest)
        if not len(times):
            return []
        plots = self._plots(times, rows, entities.commanded)
        return [*arm_poses(self.model, entities.COMMANDED, times, rows), *plots]

    def _plots(self, times: Times, rows: Array, entity: Callable[[str], str]) -> list[Update]:
        return [
            Scalars(entity(joint.name), times, rows[:, [column]] * on_screen(joint))
            for column, joint in enumerate(self.model.moving)
        ]

    def _trail(self, times: Times, rows: Array) -> list[Update]:
        points = self.model.link_positions(self._tool, rows, self._names)
        line = points if self._trail_end is None else np.vstack([self._trail_end, points])
        self._trail_end = points[-1:]
        moved = len(line) > 1 and float(np.ptp(line, axis=0).max()) > 1e-6
        return [LineStrip(entities.TRAIL, int(times[-1]), line)] if moved else []

    def _step_errors(self) -> list[Update]:
        times, rows = self._errors.take(self._latest)
        if not len(times):
            return []
        edges = np.tile([BAND, -BAND], (len(times), 1))
        return [
            Scalars(entities.error(name), times, np.column_stack([rows[:, column], edges]))
            for column, name in enumerate(self._names)
        ]

    def _shafts(self) -> list[Update]:
        times, rows = self._shaft.take(self._latest)
        if not len(times):
            return []
        return [Scalars(entities.shaft(name), times, rows[:, [column]]) for column, name in enumerate(self._names)]

    def _planned(self) -> list[Update]:
        if self._path is None or not self._path_is_new:
            return []
        self._path_is_new = False
        points = np.array(self._path.points, dtype=float).reshape(-1, 3)
        return [LineStrip(entities.PATH, clamp_stamp(self._path.stamp), points)]

    def _device(self, now: int) -> list[Update]:
        if now - self._panel_at < PANEL_PERIOD:
            return []
        self._panel_at = now
        mode, text = self._mode(), panel(self._panel_inputs, now)
        shown, self._shown = self._shown, (mode, text)
        updates: list[Update] = []
        if mode != shown[0]:
            updates.append(Tint(entities.MEASURED, now, mode))
        if mode != shown[0] or now - self._mode_at >= AGAIN:
            self._mode_at = now
            updates.append(StateUpdate(entities.MODE, now, mode))
        updates += [TextPanel(entities.PANEL, now, text)] if text != shown[1] else []
        return updates

    def _mode(self) -> str:
        if self._panel_inputs.status is not None and not self._panel_inputs.status.online:
            return "OFFLINE"
        return "WAITING" if self._panel_inputs.state is None else self._panel_inputs.state.mode.name


def on_screen(joint: VisualJoint) -> float:
    """The factor to screen units: [mm/m] for a prismatic joint, [deg/rad] for the others."""
    return 1e3 if joint.is_prismatic else math.degrees(1.0)


def unit(joint: VisualJoint) -> str:
    """The screen's unit."""
    return "mm" if joint.is_prismatic else "°"
