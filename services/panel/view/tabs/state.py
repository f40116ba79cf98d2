"""The tab that shows numbers: joints and steps, the tool's pose, sensors, the link, this browser, the log."""

from __future__ import annotations

from math import degrees

import numpy as np
from viser.transforms import SO3

from gemelo.schemas.ledger import StepLedger
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.model.units import in_degrees, text_of
from gemelo.services.panel.view.browser import Browser
from gemelo.services.panel.view.kit import Kit, esc, note, set_if_new, table

LOG_LINES = 8


class StateTab:
    """Nothing here can be pressed."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._operator = kit, kit.operator
        self.joints, self.tool, self.log = kit.line(), kit.line(), kit.line()

    def refresh(self, readings: Readings, browser: Browser | None, lag: float, tool: tuple[float, ...]) -> None:
        """`lag` [s] of this browser; `tool`: x, y, z [m] and quaternion of the measured tool."""
        words = self._kit.words
        header = ("", *(esc(words(key)) for key in ("measured", "steps_off", "sure")))
        sure = confidences(readings.ledger)
        rows = [
            (
                esc(joint.name),
                esc(text_of(joint, readings.joints[joint.name])),
                f"{readings.step_errors.get(joint.name, 0.0):+.2f}",
                sure.get(joint.name, "-"),
            )
            for joint in self._operator.arm.description.joints
            if joint.name in readings.joints
        ]
        set_if_new(self.joints, "content", table(rows, header) + self._steps(readings))
        set_if_new(self.tool, "content", table(self._numbers(readings, browser, lag, tool)))
        lines = [f"{esc(line.node)}: {esc(in_degrees(line.text))}" for line in self._operator.bus.log[-LOG_LINES:]]
        set_if_new(self.log, "content", note("<br>".join(lines)))

    def _steps(self, readings: Readings) -> str:
        """Executed steps beside those of the path, to the half step, and of a virtual device what its shafts made."""
        state = readings.state
        if state is None:
            return ""
        words, arm = self._kit.words, self._operator.arm.description
        executed = dict(zip(state.name, state.steps, strict=False))
        rows = []
        for joint in arm.joints:
            if joint.name in readings.commanded and joint.name in executed:
                wanted = joint.steps.to_steps(readings.commanded[joint.name])
                true = [str(readings.shaft.get(joint.name, "-"))] if readings.shaft else []
                rows.append((esc(joint.name), f"{wanted:.1f}", str(executed[joint.name]), *true))
        columns = ("steps", "commanded", "executed", *(["shaft"] if readings.shaft else []))
        return table(rows, tuple(esc(words(column)) for column in columns))

    def _numbers(
        self, readings: Readings, browser: Browser | None, lag: float, tool: tuple[float, ...]
    ) -> list[tuple[str, ...]]:
        words = self._kit.words
        x, y, z = (1000.0 * value for value in tool[:3])
        a, b, c, w = tool[3:]
        roll, pitch, yaw = (degrees(angle) for angle in SO3(np.array((w, a, b, c))).as_rpy_radians())
        rows: list[tuple[str, ...]] = [
            (esc(words("tool")), f"{x:.1f}, {y:.1f}, {z:.1f} mm"),
            (esc(words("turned")), f"{roll:.1f}°, {pitch:.1f}°, {yaw:.1f}°"),
        ]
        rows += [(esc(words(key)), esc(words(f"{key}_is", **values))) for key, values in certainty(readings).items()]
        units = {sensor.name: sensor.unit for sensor in self._operator.arm.description.sensors}
        rows += [(esc(name), f"{value:.4g} {esc(units.get(name, ''))}") for name, value in readings.sensors.items()]
        if browser is not None:
            rows.append((esc(words("browser")), f"{browser.rate:.0f} fps, {1000 * lag:.0f} ms"))
        if unwritten := self._operator.arm.node.unwritten.sentence:  # of the page's own process
            rows.append((esc(words("disk")), esc(words("disk_refuses", what=unwritten))))
        return rows


def confidences(ledger: StepLedger | None) -> dict[str, str]:
    """How sure it is of each joint that it has lost no step, in per cent, rounded down."""
    if ledger is None:
        return {}
    return {name: f"{int(1000.0 * c) / 10.0:g} %" for name, c in zip(ledger.name, ledger.confidence, strict=False)}


def certainty(readings: Readings) -> dict[str, dict[str, str]]:
    """The values of the rows about the tool's error and its stopping distance; without those that are not known."""
    rows: dict[str, dict[str, str]] = {}
    ledger, stopping = readings.ledger, readings.stopping
    if ledger is not None and any(ledger.confidence):
        bound, known = f"{1e3 * ledger.tool_bound:.1f} mm", f"{1e3 * ledger.tool_error:.1f} mm"
        rows["tool_error"] = {"known": known, "bound": bound, "level": f"{ledger.level:.0%}"}
    if stopping is not None and stopping.is_known:
        rows["stopping"] = {"way": f"{1e3 * stopping.distance:.0f} mm", "time": f"{stopping.duration:.2f} s"}
    return rows
