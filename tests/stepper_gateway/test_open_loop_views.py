"""Views of a board that does not say what it has executed: each says that it is sent, not verified."""

from __future__ import annotations

from typing import Any

import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device_link import state_round_trip_text
from gemelo.schemas.motion import FollowJointTrajectoryResult
from gemelo.services.panel.words.words import Words
from gemelo.services.visualizer.content.panel import PanelInputs, panel
from gemelo.tools.cli.device import device_status
from gemelo.tools.cli.motion.move_report import MoveReport, summary
from gemelo.tools.cli.watch.state import snapshot, text_of
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.text_arm import TextArm
from tests.stepper_gateway.harness import move
from tests.stepper_gateway.test_ra_sketch import HOME


@pytest.fixture(scope="module")
def moved() -> SketchArm:
    """After a short move on dialect "ra"."""
    arm = SketchArm().referenced()
    assert arm.goal(move(HOME, (0.1, 0.0, 0.0), arm=arm.arm)).accepted
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    return arm


def newest(arm: SketchArm, key: str) -> Any:
    return arm.published[key][-1]


def test_gemelo_state_shows_what_was_sent_and_no_executed_step(moved: SketchArm) -> None:
    seen = snapshot(
        moved.arm, newest(moved, "joint_states"), None, newest(moved, "device/state"),
        newest(moved, "device/status"), None,
    )  # fmt: skip
    text = text_of(seen)
    assert "SENT, NOT VERIFIED" in text
    assert seen.open_loop
    assert [line.executed_steps for line in seen.joints] == [None] * 3
    assert seen.joints[0].commanded_steps == moved.sketch.shafts[0]


def test_gemelo_device_status_says_it_beside_the_device(moved: SketchArm) -> None:
    who = device_status.who_it_is(newest(moved, "device/status"), 0)
    assert (who.code, [cause.code for cause in who.causes]) == ("status.online.open_loop", ["status.open_loop"])
    assert "sketch" in str(who.values["firmware"])


def test_no_view_shows_a_round_trip_that_the_boards_wire_has_not_made(moved: SketchArm) -> None:
    """0.4 ms were shown: what the gateway's own stand-in takes."""
    line, state = TextArm(), newest(moved, "device/state")
    line.run(1.0)
    for seen in (state, newest(line, "device/state")):
        assert state_round_trip_text(seen) == "round trip not measured"
    text = text_of(
        snapshot(moved.arm, newest(moved, "joint_states"), None, state, newest(moved, "device/status"), None)
    )
    assert "round trip" not in text
    line.referenced().run(1.0)
    assert state_round_trip_text(newest(line, "device/state")) in ("round trip 9.0 ms", "round trip 10.0 ms")


def test_no_answer_to_a_chunk_claims_a_round_trip(moved: SketchArm) -> None:
    assert {ack.round_trip for ack in moved.published["command_acks"]} == {0.0}


def test_the_viewers_panel_says_it(moved: SketchArm) -> None:
    state = newest(moved, "device/state")
    shown = panel(PanelInputs(robot="rm1", status=newest(moved, "device/status"), state=state), state.stamp)
    assert "SENT, NOT VERIFIED" in shown


def test_a_moves_report_claims_no_final_error(moved: SketchArm) -> None:
    result: FollowJointTrajectoryResult = moved.finished["g"][1]
    report = MoveReport(
        robot="rm1", status="SUCCEEDED", planned_s=0.0, duration_s=1.0, reason=result.error_string, verified=False
    )
    said = summary(report, moved.arm)
    assert "sent, not verified" in said
    assert "final error" not in said


def test_the_page_says_it_in_both_languages() -> None:
    assert "not verified" in Words("en")("sent_not_verified")
    assert "sin verificar" in Words("es")("sent_not_verified")
