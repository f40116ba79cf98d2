"""The form that makes one step of a program: its kind, and what that kind needs."""

from __future__ import annotations

from collections.abc import Callable

import viser
from msgspec.structs import replace

import gemelo
from gemelo.programs import (
    AnyStep,
    Arc,
    Attach,
    Call,
    Detach,
    Go,
    Grip,
    Line,
    Output,
    Pick,
    Repeat,
    Speed,
    Wait,
    WaitFor,
)  # fmt: skip
from gemelo.services.panel.model.teaching import target_names
from gemelo.services.panel.view.kit import Kit, set_if_new

KINDS = (
    "go",
    "line",
    "arc",
    "output",
    "grip",
    "pick",
    "wait",
    "wait_for",
    "speed",
    "attach",
    "detach",
    "repeat",
    "call",
)
SHOWN = {  # which fields each kind shows
    "go": ("target", "blend"), "line": ("target", "blend", "number"), "arc": ("target", "through", "number"),
    "output": ("name", "on"), "grip": ("number",), "pick": ("name", "target"), "wait": ("number",),
    "wait_for": ("name", "on", "number"), "speed": ("number",),
    "attach": ("name",), "detach": ("name",), "repeat": ("number",), "call": ("name",),
}  # fmt: skip
USUAL = {  # what the number is at first, by kind: mm/s (0: as fast as the joints can), mm, s, per cent, times
    "line": 0.0, "arc": 0.0, "grip": 20.0, "wait": 1.0, "wait_for": 0.0, "speed": 50.0, "repeat": 2.0,
}  # fmt: skip
LABELS = {  # of the fields "number" and "name", by kind
    "line": "number_tool_speed", "arc": "number_tool_speed", "grip": "number_opening",
    "wait": "number_seconds", "wait_for": "number_sensor",
    "speed": "number_percent", "repeat": "number_times", "output": "name_output", "attach": "name_object",
    "detach": "name_object", "call": "name_program", "pick": "name_thing",
}  # fmt: skip


class NewStep:
    """`make` is the step that the form says; raises `gemelo.BadArgument` where something is missing."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._operator = kit, kit.operator
        words, gui = kit.words, kit.gui
        self.titles = {words(f"step_{kind}"): kind for kind in KINDS}
        self.kind = gui.add_dropdown(words("step_kind"), tuple(self.titles))
        self.kind.on_update(lambda event: self.refresh())
        self.target = gui.add_dropdown(words("target"), (words("none"),))
        self.through = gui.add_dropdown(words("through"), (words("none"),))
        self.name = gui.add_dropdown(words("name"), (words("none"),))
        self.on = gui.add_checkbox(words("on"), True)
        self.number = gui.add_number(words("number"), 1.0, step=0.1)
        self.blend = gui.add_number(words("blend_mm"), 0.0, min=0.0, step=1.0)
        self._seen: object = None
        self._kind_shown = ""
        self.refresh()

    def refresh(self) -> None:
        """Shows the fields of the kind, with the names that there are now."""
        kind, words = self._chosen_kind, self._kit.words
        targets = self._targets(kind)
        seen = (kind, targets, self._names(kind))
        if seen == self._seen:
            return
        self._seen = seen
        if kind != self._kind_shown:
            self._kind_shown = kind
            set_if_new(self.number, "value", USUAL.get(kind, 0.0))
        fields: dict[str, object] = {
            "target": self.target,
            "through": self.through,
            "name": self.name,
            "on": self.on,
        }
        fields |= {"number": self.number, "blend": self.blend}
        for name, handle in fields.items():
            set_if_new(handle, "visible", name in SHOWN[kind])
        for dropdown in (self.target, self.through):
            _offer(dropdown, targets or (words("none"),))
        _offer(self.name, self._names(kind) or (words("none"),))
        set_if_new(self.number, "label", words(LABELS[kind] if LABELS.get(kind, "").startswith("number") else "number"))
        set_if_new(
            self.name, "label", words(LABELS[kind] if LABELS.get(kind, "").startswith("name") else "name_sensor")
        )
        set_if_new(self.target, "label", words("name_place" if kind == "pick" else "target"))
        set_if_new(self.on, "label", words("above_limit" if kind == "wait_for" else "on"))

    def make(self) -> AnyStep:
        """The step."""
        number, name = float(self.number.value), str(self.name.value)
        makers: dict[str, Callable[[], AnyStep]] = {
            "go": lambda: self._with_goal(Go()),
            "line": lambda: self._with_goal(Line(tool_speed=max(0.0, number / 1000.0))),
            "arc": lambda: self._with_goal(Arc(through=self._through_point(), tool_speed=max(0.0, number / 1000.0))),
            "output": lambda: Output(name=self._known(name), on=self.on.value),
            "grip": lambda: Grip(to=number / 1000.0),
            "pick": lambda: Pick(thing=self._known(name), place=self._known(str(self.target.value))),
            "wait": lambda: Wait(time=number),
            "wait_for": lambda: WaitFor(sensor=self._known(name), **{"above" if self.on.value else "below": number}),
            "speed": lambda: Speed(share=number / 100.0),
            "attach": lambda: Attach(object=self._known(name), touch=self._holders()),
            "detach": lambda: Detach(object=self._known(name)),
            "repeat": lambda: Repeat(count=round(number), steps=()),
            "call": lambda: Call(program=self._known(name)),
        }
        return makers[self._chosen_kind]()

    @property
    def _chosen_kind(self) -> str:
        return self.titles[str(self.kind.value)]

    def _targets(self, kind: str) -> tuple[str, ...]:
        if kind == "pick":
            return self._operator.picks.places
        return target_names(self._operator.teaching.points, self._operator.arm.states)

    def _names(self, kind: str) -> tuple[str, ...]:
        arm, teaching = self._operator.arm.description, self._operator.teaching
        match kind:
            case "output":
                return tuple(output.name for output in arm.outputs)
            case "wait_for":
                return tuple(sensor.name for sensor in arm.sensors)
            case "attach" | "detach":
                return tuple(item.name for item in self._operator.bus.scene.objects)
            case "pick":
                return self._operator.picks.things
            case "call":
                return tuple(name for name in teaching.programs if name != teaching.program.name)
        return ()

    def _with_goal(self, step: Go | Line | Arc) -> AnyStep:
        chosen = self._known(str(self.target.value))
        goal = {"point" if chosen in self._operator.teaching.points else "state": chosen}
        return replace(step, **goal, blend=max(0.0, float(self.blend.value)) / 1000.0)

    def _through_point(self) -> tuple[float, float, float]:
        """[m] where the tool is at the point that the arc leads through."""
        chosen, teaching = self._known(str(self.through.value)), self._operator.teaching
        joints = teaching.points[chosen].joints if chosen in teaching.points else self._operator.arm.states[chosen]
        return self._operator.arm.fk(joints).position

    def _holders(self) -> tuple[str, ...]:
        """The links beside the tool, which a carried object may touch."""
        arm = self._operator.arm
        return tuple(joint.parent for joint in arm.description.model.joints if joint.child == arm.tool_frame)

    def _known(self, name: str) -> str:
        if name == self._kit.words("none"):
            raise gemelo.BadArgument(self._kit.words("choose_name"))
        return name


def _offer(dropdown: viser.GuiDropdownHandle[str], options: tuple[str, ...]) -> None:
    if tuple(dropdown.options) != options:
        chosen = dropdown.value
        dropdown.options = options
        set_if_new(dropdown, "value", chosen if chosen in options else options[0])
