"""The holder of control, as `gemelo state`, the Rerun view and the page show it."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from gemelo.schemas.control import ControlState
from gemelo.schemas.device import DeviceMode, DeviceState
from gemelo.services.panel.model.availability import OF_THE_HOLDER, other_holder, reasons
from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.words.words import Words
from gemelo.services.visualizer.content.panel import PanelInputs, panel
from gemelo.tools.cli.watch.state import control_text, snapshot, text_of
from gemelo.tools.virtual_arm.virtual_arm import rm1

HELD = ControlState(held=True, name="ana `x`", node="cli-1", host="desk", members=("cli-1",))
IDLE = DeviceState(mode=DeviceMode.IDLE, armed=True, referenced=(True, True, True), name=rm1().joint_names)


def page(node: str) -> SimpleNamespace:
    return SimpleNamespace(node=SimpleNamespace(address=node), description=rm1())


def readings(control: ControlState | None) -> Readings:
    return Readings(
        joints={}, age=0.0, step_errors={}, commanded={}, state=IDLE, status=None, sensors={}, fault="", gripper=None,
        ledger=None, stopping=None, control=control,
    )  # fmt: skip


def test_gemelo_state_names_the_holder_and_is_silent_where_there_is_none() -> None:
    shown = text_of(snapshot(rm1(), None, None, None, None, None, control=HELD))
    assert "\ncontrol ana `x`, node cli-1 on desk: nobody else moves the arm\n" in shown
    assert control_text(ControlState()) == control_text(None) == ""


def test_the_rerun_view_names_the_holder_and_no_name_is_taken_for_markdown() -> None:
    assert "control: `ana 'x'` (node `cli-1` on `desk`)" in panel(PanelInputs(control=HELD), 0)
    assert "control" not in panel(PanelInputs(control=ControlState()), 0)


@pytest.mark.parametrize("language", ["en", "es"])
def test_on_the_page_the_holders_actions_are_greyed_with_its_name_and_stop_and_hold_are_not(language: str) -> None:
    words, found = Words(language), reasons(page("panel"), readings(HELD))
    assert {name for name, reason in found.items() if reason == ("other_in_control", "ana `x`")} == set(OF_THE_HOLDER)
    assert "ana `x`" in words.reason(found["move"])
    assert not {"hold", "disarm", "inject"} & set(OF_THE_HOLDER)


def test_the_holders_own_page_greys_nothing() -> None:
    for control in (None, ControlState(), HELD):
        found = reasons(page("cli-1"), readings(control))
        assert not [name for name, reason in found.items() if reason is not None and reason[0] == "other_in_control"]
        assert other_holder(page("cli-1"), readings(control)) is None
