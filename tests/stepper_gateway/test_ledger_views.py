"""Views of the ledger and of the stopping distance, from the real gateway's messages."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from gemelo.services.panel.model.readings import Readings
from gemelo.services.panel.view.tabs.state import certainty, confidences
from gemelo.services.panel.words.words import Words
from gemelo.services.visualizer.content.panel import PanelInputs, panel
from gemelo.tools.cli.watch.state import JointLine, ledger_text, snapshot, stopping_text, text_of
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move
from tests.stepper_gateway.test_step_ledger import homed_by_word


@pytest.fixture(scope="module")
def moving() -> VirtualArm:
    """In the midst of a move, after a homing."""
    rig = homed_by_word(VirtualArm().ready())
    assert rig.goal(move((0.0, 0.0, 0.0), (1.0, -1.0, 0.1))).accepted
    rig.run(1.2)
    return rig


def newest(rig: VirtualArm | SketchArm, key: str):
    return rig.published[key][-1]


def readings(rig: VirtualArm | SketchArm) -> Readings:
    return Readings(
        joints={}, age=0.0, step_errors={}, commanded={}, state=None, status=None, sensors={}, fault="", gripper=None,
        ledger=newest(rig, "step_ledger"), stopping=newest(rig, "stopping_distance"),
    )  # fmt: skip


def test_gemelo_state_shows_per_joint_how_sure_and_what_that_is_at_the_tool(moving: VirtualArm) -> None:
    seen = snapshot(
        moving.arm, newest(moving, "joint_states"), newest(moving, "step_errors"), newest(moving, "device/state"),
        newest(moving, "device/status"), None, newest(moving, "step_ledger"), newest(moving, "stopping_distance"),
    )  # fmt: skip
    line: JointLine = seen.joints[0]
    assert line.confidence is not None
    assert line.confidence > 0.9
    assert (line.verified_by, line.verified_at > 0) == ("homing", True)
    text = text_of(seen)
    assert "ledger tool error at most" in text
    assert "sure that no step is lost" in text
    assert "mm in" in text
    assert "if all is lost now" in text


def test_what_is_not_known_is_said_in_words() -> None:
    fresh = VirtualArm().ready()
    fresh.run(0.3)
    assert "not known" in ledger_text(newest(fresh, "step_ledger"))
    sketch = SketchArm().referenced()
    sketch.run(0.3)
    assert "does not say what it has executed" in ledger_text(newest(sketch, "step_ledger"))
    assert "not known how far" in stopping_text(newest(sketch, "stopping_distance"))
    assert certainty(readings(sketch)) == {}
    assert (ledger_text(None), stopping_text(None)) == ("", "")


def test_a_share_is_rounded_down(moving: VirtualArm) -> None:
    nearly = replace(newest(moving, "step_ledger"), arm_confidence=0.94999, confidence=(0.94999,) * 3)
    assert "94.9 % sure" in ledger_text(nearly)
    assert confidences(nearly)["brazo_joint"] == "94.9 %"


def test_the_page_has_its_rows_in_both_languages(moving: VirtualArm) -> None:
    rows = certainty(readings(moving))
    assert set(rows) == {"tool_error", "stopping"}
    for language, word in (("en", "at most"), ("es", "a lo más")):
        words = Words(language)
        assert all(word in words(f"{key}_is", **values) for key, values in rows.items())


def test_the_viewers_panel_says_both(moving: VirtualArm) -> None:
    state = newest(moving, "device/state")
    inputs = PanelInputs(
        robot="rm1", state=state, ledger=newest(moving, "step_ledger"), stopping=newest(moving, "stopping_distance")
    )
    shown = panel(inputs, state.stamp)
    assert "sure** that no step is lost: brazo_joint" in shown
    assert "if all is lost now" in shown
