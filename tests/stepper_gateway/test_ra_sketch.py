"""Dialect "ra": a sketch with AccelStepper's move() behind the gateway, in virtual time."""

from __future__ import annotations

import json
import math
import random
from dataclasses import replace

import msgspec
import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, OutputCommand, StopKind
from gemelo.schemas.message import Vector
from gemelo.schemas.motion import JointTrajectory
from gemelo.tools.virtual_arm.gateway_driver import CancelInput
from gemelo.tools.virtual_arm.sketch_arm import SketchArm, ra_arm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

HOME = (0.0, 0.0, 0.0)
QUARTER = math.pi / 2.0


def ra_move(start: Vector, end: Vector) -> JointTrajectory:
    """As fast as the sketch can follow."""
    return move(start, end, arm=ra_arm())


def settled(arm: SketchArm) -> bool:
    return not arm.sketch.is_moving and not any(motor.remaining for motor in arm.sketch.motors)


def test_ninety_degrees_arrive_at_the_shaft_to_the_step() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, QUARTER, 0.0))).accepted
    status, result = arm.finish()
    assert status is GoalStatusCode.SUCCEEDED
    assert settled(arm), "success was said before the sketch had its time"
    assert arm.sketch.shafts == (round(18662.4 / 4), 100, 0)
    assert arm.sketch.discarded == 0
    assert arm.sketch.moves > 3
    assert not result.verified
    assert "not verified" in result.error_string
    assert result.executed_steps == ()


@pytest.mark.parametrize("truncates", [True, False])
def test_a_stream_of_targets_arrives_to_the_step_where_the_old_publisher_lost_99_per_cent(truncates: bool) -> None:
    arm = SketchArm(truncates=truncates).referenced()
    for index in range(60):
        share = min(1.0, index / 40)
        arm.target(brazo_joint=share * 0.6, antebrazo_joint=-share * 0.4, efector_joint=share * 0.02)
        arm.run(0.1)
    assert arm.run(20.0, lambda: arm.state.mode == DeviceMode.IDLE)
    assert settled(arm)
    wanted = [joint.steps.to_steps(p) for joint, p in zip(arm.arm.joints, (0.6, -0.4, 0.02), strict=True)]
    assert arm.sketch.shafts == tuple(math.floor(steps + 0.5) for steps in wanted)
    assert arm.sketch.discarded == 0


def test_random_moves_over_a_network_that_delays_sum_up_at_the_shaft() -> None:
    arm = SketchArm(delay=0.002, jitter=0.1, seed=5).referenced()
    rng = random.Random(5)
    start = HOME
    for index in range(3):
        end = (rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5), rng.uniform(0.0, 0.05))
        assert arm.goal(ra_move(start, end), f"g{index}").accepted
        assert arm.finish(f"g{index}")[0] is GoalStatusCode.SUCCEEDED
        start = end
    assert settled(arm)
    assert arm.sketch.shafts == arm.state.steps == arm.device.sent
    assert arm.sketch.discarded == 0


def test_nothing_of_it_is_called_executed() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (0.1, 0.0, 0.0))).accepted
    arm.finish()
    assert all(state.commanded for state in arm.published["joint_states"])
    assert not arm.published["step_errors"], "nobody knows a step error"
    assert arm.published["device/status"][-1].open_loop
    assert any("sent, not verified" in line for line in arm.log)


def test_our_own_device_executes_and_says_so() -> None:
    arm = VirtualArm().ready()
    assert arm.goal(move(HOME, (0.1, 0.0, 0.0))).accepted
    result = arm.finish()[1]
    assert result.verified
    assert len(result.executed_steps) == 3
    assert not arm.published["joint_states"][-1].commanded
    assert not arm.published["device/status"][-1].open_loop


def test_a_sketch_begins_unreferenced_and_refuses_goals_until_a_person_says_where_it_stands() -> None:
    arm = SketchArm()
    arm.run(2.0)
    verdict = arm.goal(ra_move(HOME, (0.1, 0.0, 0.0)))
    assert not verdict.accepted
    assert "gemelo reference" in verdict.reason
    arm.command(DeviceCommandKind.REFERENCE, brazo_joint=0.5, antebrazo_joint=0.0, efector_joint=0.0)
    arm.run(1.0)
    assert arm.answers[1].accepted
    assert arm.sketch.moves == 0, "to declare a position is no move"
    assert arm.goal(ra_move((0.5, 0.0, 0.0), HOME)).accepted
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    assert arm.sketch.shafts[0] == -arm.arm.joints[0].steps.to_q8(0.5) // 256 or settled(arm)
    assert arm.state.steps[0] == 0


def test_a_loop_that_blocks_for_a_moment_loses_nothing() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, 0.0, 0.0))).accepted
    for _ in range(4):
        arm.run(1.3)
        arm.sketch.block(0.2)
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    assert settled(arm)
    assert arm.sketch.shafts[0] == 4666
    assert arm.sketch.discarded == 0


def test_a_reconnection_in_a_move_ends_it_and_the_position_is_not_known_any_more() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, 0.0, 0.0))).accepted
    arm.run(3.0)
    arm.sketch.block(2.0)
    status, result = arm.finish()
    assert status is GoalStatusCode.ABORTED
    assert not result.verified
    sent = len(arm.messages_sent)
    assert arm.run(4.0, lambda: arm.published["device/status"][-1].online)
    arm.run(1.0)
    assert "position_lost" in arm.events()
    assert [m for m in arm.messages_sent[sent:] if b"q1" in m] == [], "nothing resumes by itself"
    assert "gemelo reference" in arm.goal(ra_move(HOME, (0.1, 0.0, 0.0)), "next").reason


@pytest.mark.parametrize("telemetry_time", [0.02, 0.1, 0.5])
def test_a_sketch_that_restarts_in_a_message_is_noticed_however_soon_it_speaks_again(telemetry_time: float) -> None:
    """It was not within ten words: 593 steps were lost, and the move succeeded."""
    arm = ra_arm()
    arm = replace(arm, device=msgspec.structs.replace(arm.device, telemetry_time=telemetry_time))
    world = SketchArm(arm).referenced()
    assert world.goal(move(HOME, (QUARTER, 0.0, 0.0), arm=arm)).accepted
    assert world.run(20.0, lambda: abs(world.sketch.motors[0].remaining) > 500)
    at = world.now
    world.sketch.restart(min(max(0.3, 5.0 * telemetry_time), 1.1))
    status, result = world.finish()
    assert world.sketch.discarded > 0
    assert status is GoalStatusCode.ABORTED
    assert world.now - at < 1.0 + 0.1, "a second of silence is enough, whatever the telemetry is"
    assert "the sketch was silent for" in result.error_string
    assert "gemelo reference" in result.error_string
    assert "position_lost" in world.events()
    assert "rebooted" not in world.events()
    world.run(1.0)
    ledger = world.published["step_ledger"][-1]
    assert ledger.confidence == (0.0, 0.0, 0.0)
    assert "gemelo reference" in world.goal(move(HOME, (0.1, 0.0, 0.0), arm=arm), "next").reason


@pytest.mark.parametrize("after", [0.0, 4.0], ids=["the first", "a later one"])
def test_a_message_that_was_lost_with_its_connection_ends_the_move(after: float) -> None:
    """The broker sends back what it has passed on: what does not come back is not at the sketch."""
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, 0.0, 0.0))).accepted
    arm.run(after)
    arm.drops = 1
    status, result = arm.finish()
    assert status is GoalStatusCode.ABORTED
    assert "lost with a connection" in result.error_string
    assert "position_lost" in arm.events()


def test_a_process_that_was_stopped_does_not_take_the_sketch_for_silent() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, 0.0, 0.0))).accepted
    assert arm.run(20.0, lambda: abs(arm.sketch.motors[0].remaining) > 500)
    arm.now += 0.6  # nothing was read meanwhile, and the sketch went on
    arm.finish()
    assert arm.run(10.0, lambda: arm.state.mode == DeviceMode.IDLE)
    assert "position_lost" not in arm.events()
    assert arm.sketch.discarded == 0
    assert arm.sketch.shafts == arm.device.sent


def test_nothing_is_sent_to_a_sketch_that_is_silent_just_now() -> None:
    arm = SketchArm().referenced()
    arm.is_cut = True
    arm.run(0.5)
    assert arm.goal(ra_move(HOME, (0.1, 0.0, 0.0))).accepted
    arm.run(0.3)
    assert not [message for message in arm.messages_sent if b"q1" in message]


OLD_DRIVER = b'{"q1":2.5,"q2":0,"q3":0.0,"avanzar":0}'


def test_another_program_on_ra_juntas_ends_the_move_and_nothing_moves_until_it_is_gone() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, 0.0, 0.0))).accepted
    arm.run(3.0)
    arm.send_as_another(OLD_DRIVER)
    status, _ = arm.finish()
    assert status is GoalStatusCode.ABORTED
    sent = len(arm.messages_sent)
    for number in range(3):
        arm.command(DeviceCommandKind.REFERENCE, number)
        arm.run(1.0)
        arm.send_as_another(OLD_DRIVER)
        arm.run(0.5)
        assert "gemelo reference" in arm.goal(ra_move(HOME, (0.1, 0.0, 0.0)), f"g{number}").reason
    assert [each for each in arm.messages_sent[sent:] if b"q1" in each] == []
    lost = [each.detail for each in arm.published["device/events"] if each.event == "position_lost"]
    assert len(lost) == 4
    assert "another program sends ra/juntas too" in lost[0]
    assert '(1 so far: {"q1":2.5' in lost[0]
    arm.command(DeviceCommandKind.REFERENCE, 99)
    arm.run(1.0)
    assert arm.goal(ra_move(HOME, (0.1, 0.0, 0.0)), "after").accepted
    assert arm.finish("after")[0] is GoalStatusCode.SUCCEEDED


@pytest.mark.parametrize("message", [b"", b"hola", b'{"avanzar":1}', b'{"q1":2.5,"q2":1}', b"[1,2,3]"])
def test_what_no_sketch_moves_by_is_nobodys_move(message: bytes) -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (0.3, 0.0, 0.0))).accepted
    arm.run(1.0)
    arm.send_as_another(message)
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    assert settled(arm)
    assert "position_lost" not in arm.events()


def test_what_the_broker_sends_back_twice_is_still_our_own() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (0.3, 0.0, 0.0))).accepted
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    for message in arm.messages_sent:
        arm.device.hear("ra/juntas", message, False, arm.moment.monotonic)
        arm.device.hear("ra/juntas", OLD_DRIVER, True, arm.moment.monotonic)  # retained: it was before our time
    arm.run(1.0)
    assert "position_lost" not in arm.events()
    assert arm.goal(ra_move((0.3, 0.0, 0.0), HOME), "back").accepted


def test_a_sketch_that_is_silent_at_rest_keeps_its_position() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (0.1, 0.0, 0.0))).accepted
    arm.finish()
    arm.sketch.block(3.0)
    arm.run(2.5)
    assert not arm.published["device/status"][-1].online
    assert arm.run(3.0, lambda: not arm.reason_not_ready), arm.reason_not_ready
    assert arm.goal(ra_move((0.1, 0.0, 0.0), HOME), "back").accepted
    assert arm.finish("back")[0] is GoalStatusCode.SUCCEEDED
    assert arm.sketch.shafts == (0, 0, 0)


def test_a_cancel_ends_when_the_sketch_has_had_its_last_message() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (QUARTER, 0.0, 0.0))).accepted
    arm.run(3.0)
    at = arm.now
    assert arm.handle(CancelInput("g")).why is None
    assert arm.finish()[0] is GoalStatusCode.CANCELED
    assert arm.now - at < 4.0
    assert settled(arm)
    assert 0 < arm.sketch.shafts[0] < 4666
    assert arm.sketch.shafts == arm.state.steps
    assert arm.goal(ra_move((arm.sketch.shafts[0] / 18662.4 * 2.0 * math.pi, 0.0, 0.0), HOME), "back").accepted
    arm.finish("back")
    assert arm.sketch.shafts == (0, 0, 0)


def test_a_target_beyond_a_limit_is_refused_with_the_joint_and_the_limit() -> None:
    arm = SketchArm().referenced()
    reason = arm.goal(ra_move(HOME, (3.5, 0.0, 0.0))).reason
    assert "brazo_joint" in reason
    assert "2.95" in reason


def test_disarm_is_refused_because_the_dialect_has_no_word_for_it() -> None:
    answer = SketchArm().referenced().answer(StopKind.DISARM)
    assert not answer.accepted
    assert "dialect" in answer.reason


def test_the_output_is_switched_without_disturbing_a_move() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(ra_move(HOME, (0.4, 0.0, 0.0))).accepted
    arm.run(1.5)
    arm.ask(OutputCommand(output="avanzar", on=True), 7)
    arm.run(0.1)
    assert arm.sketch.led
    assert {"avanzar": 1} in [json.loads(message) for message in arm.messages_sent]
    assert arm.finish()[0] is GoalStatusCode.SUCCEEDED
    assert arm.sketch.shafts[0] == math.floor(0.4 / (2.0 * math.pi) * 18662.4 + 0.5)
    assert arm.sketch.discarded == 0


@pytest.mark.parametrize(
    ("payload", "expected"),
    [(b'{"ultra": 17}', {"ultra": 17.0}), (b'{"bateria": 7.4}', {"bateria": 7.4}),
     (b'{"Estado": 3, "ultra": 18}', {"ultra": 18.0})],
)  # fmt: skip
def test_the_sensors_of_all_three_forms_are_heard(payload: bytes, expected: dict[str, float]) -> None:
    arm = SketchArm().referenced()
    arm.published["sensors"].clear()
    arm.sketch.sensors = payload
    arm.run(0.5)
    readings = arm.published["sensors"][-1]
    assert dict(zip(readings.name, readings.value, strict=True)) == expected


def test_a_state_of_the_sketch_is_told_once() -> None:
    arm = SketchArm().referenced()
    arm.sketch.state = b'{"estado": 4}'
    arm.run(1.0)
    told = [event.detail for event in arm.published["device/events"] if event.event == "estado"]
    assert told == ["1", "4"]


def test_a_retained_state_is_no_sign_of_life() -> None:
    arm = SketchArm()
    arm.sketch.is_on = False
    for _ in range(20):
        arm.device.hear("ra/estados", b'{"estado": 1}', True, arm.moment.monotonic)
        arm.run(0.1)
    assert not arm.published["device/status"][-1].online
