"""The tab that runs the device: drivers, homing, reference, faults, outputs, and a virtual device's mishaps."""

from __future__ import annotations

from functools import partial

import viser

from gemelo.schemas.device_link import is_old
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.model.units import text_of
from gemelo.services.panel.view.gripper_box import GripperBox
from gemelo.services.panel.view.kit import Kit, Mirror, Steady, box, esc, set_if_new, table


class DeviceTab:
    """Each button is greyed with its reason while it cannot be pressed."""

    def __init__(self, kit: Kit) -> None:
        self._kit, self._operator = kit, kit.operator
        words, arm = kit.words, kit.operator.arm
        self.facts = kit.line()
        self._round_trip = Steady(share=0.5, least=0.002)  # [s]
        kit.button(words("arm"), arm.device.arm, color="green", needs="arm")
        kit.button(words("disarm"), arm.device.disarm, color="orange", needs="disarm")
        kit.button(words("home"), self._operator.home, color="blue", needs="home")
        kit.button(words("reference"), self._ask_reference, color="blue", needs="reference")
        kit.button(words("reset"), arm.device.reset, color="orange", needs="reset")
        self.homing = kit.line()
        kit.reasons(
            arm=words("arm"), disarm=words("disarm"), home=words("home"), reference=words("reference"),
            reset=words("reset"),
        )  # fmt: skip
        self.outputs = {output.name: Mirror(self._output(output.name)) for output in arm.description.outputs}
        gripper = arm.description.gripper
        self.gripper = GripperBox(kit, gripper) if gripper is not None else None
        with kit.gui.add_folder(words("virtual"), expand_by_default=False):
            for key, value in (("estop_press", 1.0), ("estop_release", 0.0)):
                kit.button(words(key), partial(arm.device.inject, "estop", value=value), needs="inject")
            for joint in arm.joint_names:
                self._slip_button(joint)
            kit.reasons(inject=words("virtual"))

    def refresh(self, readings: Readings) -> None:
        """Mode, switches, outputs, homing."""
        words, state, status = self._kit.words, readings.state, readings.status
        rows: list[tuple[str, ...]] = []
        if status is not None:
            kind = words("virtual_device") if status.virtual else words("real_device")
            rows.append((esc(words("device")), f"{esc(status.device)} ({esc(kind)}), {esc(status.firmware)}"))
        if state is not None:
            rows.append((esc(words("mode")), esc(words(f"mode_{state.mode.name.lower()}"))))
            rows.append((esc(words("inputs")), esc(", ".join(state.inputs) or "-")))
            trip, age = f"{1000 * self._round_trip.of(state.round_trip):.0f} ms", state.round_trip_age + readings.age
            trip = words("measured_ago", trip=trip, age=f"{age:.0f}") if is_old(age) else trip
            trip = trip if state.is_round_trip_of_wire else words("not_measured")
            rows.append((esc(words("link")), esc(trip)))
            for name, handle in self.outputs.items():
                handle.show(name in state.outputs)
        set_if_new(self.facts, "content", table(rows) if rows else "")
        if self.gripper is not None:
            self.gripper.refresh(readings)
        phases = ", ".join(f"{joint}: {words.value('phase', phase)}" for joint, phase in self._operator.homing.items())
        set_if_new(self.homing, "content", box(esc(words("homing", phases=phases)), "#1c7ed6") if phases else "")

    def _output(self, name: str) -> viser.GuiCheckboxHandle:
        handle = self._kit.gui.add_checkbox(f"{self._kit.words('output')} {name}", False)

        @handle.on_update
        def _(event: viser.GuiEvent[viser.GuiCheckboxHandle]) -> None:
            if event.client_id is not None:
                self._operator.guarded(lambda: self._operator.arm.output(name, event.target.value))

        return handle

    def _slip_button(self, joint: str) -> None:
        slip = partial(self._operator.arm.device.inject, "slip", joint, 10.0)
        self._kit.button(self._kit.words("slip", joint=joint), slip, needs="inject")

    def _ask_reference(self) -> None:
        """A declaration that is wrong drives the arm into something: it is said back before it counts."""
        words, arm = self._kit.words, self._operator.arm
        joints = zip(arm.description.joints, arm.description.reference_position, strict=True)
        where = table([(esc(joint.name), esc(text_of(joint, at))) for joint, at in joints])
        with self._kit.gui.add_modal(words("reference")) as modal:
            self._kit.line(f"{esc(words('reference_question'))}{where}")

            def declare() -> None:
                modal.close()
                self._operator.guarded(arm.reference)

            self._kit.button(words("reference_yes"), declare, color="orange")
            self._kit.button(words("cancel"), modal.close, color="gray")
