"""The tab that moves the arm by hand: joint by joint, or the tool along the axes of the base or its own."""

from __future__ import annotations

from collections.abc import Callable
from math import radians

import gemelo
from gemelo.libraries.arm.frames.transforms import from_rpy, multiply
from gemelo.libraries.arm.model.description import Joint
from gemelo.schemas.reasons import plain
from gemelo.services.panel.model.jogging import JogWish
from gemelo.services.panel.model.operator import Operator
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.model.units import jog_speed
from gemelo.services.panel.view.kit import Kit, box, esc, note, set_if_new, without_event
from gemelo.services.panel.words.words import Words

HOLD_RATE = 20.0  # [Hz] of a held button
LINEAR, ANGULAR = 0.1, 1.0  # [m/s], [rad/s] of the tool at 100 %
STEPS = (0.1, 1.0, 10.0, 30.0)  # [mm] and [deg] of one press
KEYS = {
    ("x", 1): "▲",
    ("x", -1): "▼",
    ("y", 1): "◀",
    ("y", -1): "▶",
    ("z", 1): "PgUp",
    ("z", -1): "PgDn",
}  # of the keyboard


class JogTab:
    """Continuous while a button or key is held, or in steps."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._operator = kit, kit.operator
        words, gui = kit.words, kit.gui
        self._modes = (words("continuous"), *(f"{step:g} mm / {step:g}°" for step in STEPS))
        self.mode = gui.add_dropdown(words("jog_mode"), self._modes)
        self.speed = gui.add_slider(words("jog_speed"), 1, 100, 1, 25)
        self.frame = gui.add_dropdown(words("along_axes"), (words("base_axes"), words("tool_axes")))
        self.status = kit.line()
        with gui.add_folder(words("tool")):
            kit.line(note(esc(words("keys_note"))))
            turns = self._operator.goal.turns
            for axis, *can in zip(("x", "y", "z"), turns.along_base, turns.arrows, strict=True):
                for sign in (1, -1) if any(can) else ():
                    self._tool_button(axis, sign, "")
            for axis, can_turn in zip(("x", "y", "z"), turns.rings, strict=True):
                for sign in (1, -1) if can_turn else ():
                    self._tool_button(axis, sign, "r")
        with gui.add_folder(words("joints")):
            for joint in self._operator.arm.description.joints:
                for sign in (-1, 1):
                    self._joint_button(joint, sign)
        kit.reasons(jog=words("jog"))

    def refresh(self, readings: Readings) -> None:
        """What slows the jog."""
        set_if_new(self.status, "content", jog_text(self._operator, self._kit.words))

    @property
    def step(self) -> float:
        """[mm] or [deg] of one press; 0 while continuous."""
        place = self._modes.index(self.mode.value)
        return STEPS[place - 1] if place else 0.0

    def _joint_button(self, joint: Joint, sign: int) -> None:
        def hold() -> None:
            speed = sign * jog_speed(joint, self.speed.value / 100.0)
            self._operator.jogging.hold(JogWish(joints={joint.name: speed}))

        def step() -> None:
            size = radians(self.step) if joint.unit == "rad" else self.step / 1000.0
            at = self._operator.arm.joints[joint.name] + sign * size
            self._operator.step(gemelo.Target(joints={joint.name: joint.clamp(at)}))

        self._add(f"{joint.name} {'+' if sign > 0 else '-'}", hold, step)

    def _tool_button(self, axis: str, sign: int, turn: str) -> None:
        place = "xyz".index(axis)

        def vector(size: float) -> tuple[float, ...]:
            return tuple(sign * size if index == place else 0.0 for index in range(3))

        def hold() -> None:
            share = self.speed.value / 100.0
            still = (0.0, 0.0, 0.0)
            twist = (*still, *vector(share * ANGULAR)) if turn else (*vector(share * LINEAR), *still)
            self._operator.jogging.hold(JogWish(twist=twist, frame=self.frame_name))

        def step() -> None:
            if turn:
                self._turn(vector(radians(self.step)))
            else:
                offset = vector(self.step / 1000.0)
                self._operator.step(gemelo.Target(offset=offset, line=True, frame=self.frame_name))

        key = f"  {KEYS[axis, sign]}" if not turn else ""
        self._add(f"{turn}{axis} {'+' if sign > 0 else '-'}{key}", hold, step)

    def _turn(self, angles: tuple[float, ...]) -> None:
        """The tool turned by roll, pitch or yaw [rad] about the chosen axes, where it is."""
        pose, (roll, pitch, yaw) = self._operator.arm.pose(), angles
        turned = from_rpy(roll, pitch, yaw)
        in_tool = bool(self.frame_name)
        orientation = multiply(pose.orientation, turned) if in_tool else multiply(turned, pose.orientation)
        self._operator.step(gemelo.Target(pose=gemelo.Pose(pose.position, orientation)))

    @property
    def frame_name(self) -> str:
        """Along whose axes the tool goes: its own frame, or empty for the base."""
        is_tool = self.frame.value == self._kit.words("tool_axes")
        return self._operator.arm.tool_frame if is_tool else ""

    def _add(self, label: str, hold: Callable[[], object], step: Callable[[], object]) -> None:
        """A press is a step, or a hold, as the mode says."""

        def keep() -> None:
            if not self.step:
                hold()

        def press() -> None:
            if self.step:
                self._operator.guarded(step)
            else:
                self._operator.jogging.release()

        button = self._kit.held(label, keep, rate=HOLD_RATE, needs="jog")
        button.on_click(without_event(press))


def jog_text(operator: Operator, words: Words) -> str:
    """How much of its speed a jog has, and what slows it; empty while nobody jogs."""
    status = operator.bus.jog_status
    if status is None or not status.active:
        return ""
    told = "<br>".join(esc(words.why(limit.why or plain(limit.message))) for limit in status.limits)
    share = esc(words("jogging", share=round(100 * status.scale)))
    return box(f"<b>{share}</b><br>{told}" if told else share, "#1c7ed6")
