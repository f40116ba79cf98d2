"""Streamed targets on a device that replaces: little lag, exact accounts on bad wires, nothing resumes by itself."""

from __future__ import annotations

import msgspec
import pytest

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode, StopKind
from gemelo.schemas.joints import JointTargets
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import COMMANDS, DEVICE_EVENTS, JOINT_STATES, STEP_ERRORS
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.inputs import Given, packed, unpacked
from gemelo.services.stepper_gateway.links.frames import Code
from gemelo.tools.bench.leaders import Sender, feasible_sine, lead, person, sine
from gemelo.tools.bench.scenes import parol6
from gemelo.tools.bench.stream_lag import first_motion_ms, lag_of, middle
from gemelo.tools.virtual_arm.gateway_driver import GatewayParameters, TargetsInput, asked
from gemelo.tools.virtual_arm.older_arm import OlderArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire, rm1
from tests.stepper_gateway.harness import assert_within_limits, move
from tests.stepper_gateway.live import followed, persons, replacements, violations

ARMS = {"rm1": rm1(), "parol6": parol6()}
GENTLE = sine(0.3, 0.15)
ANY_WIRE = [
    VirtualWire(delay=0.002, jitter=0.006, is_ordered=True),
    VirtualWire(delay=0.002, jitter=0.05, is_ordered=True),
    VirtualWire(delay=0.001, loss=0.05),
    VirtualWire(delay=0.002, jitter=0.04, loss=0.1, duplicates=0.1),
    VirtualWire(delay=0.02),
]


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("rate", [30.0, 50.0])
def test_a_person_is_followed_with_45_ms_of_lag(name: str, rate: float) -> None:
    arm = ARMS[name]
    lag = lag_of(VirtualArm, arm, person(arm.joints[0], 3, 10.0), Sender(rate))
    assert lag.median < 45.0
    assert lag.p99 < 80.0
    assert lag.swing == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("name", ARMS)
def test_coarse_late_and_lost_targets_are_followed_nearly_as_well(name: str) -> None:
    arm = ARMS[name]
    rough = Sender(30.0, jitter=0.02, loss=0.05, grain=0.0015)
    lag = lag_of(VirtualArm, arm, person(arm.joints[0], 3, 10.0), rough)
    assert lag.median < 60.0
    assert lag.swing == pytest.approx(1.0, abs=0.1)


def test_a_device_that_cannot_replace_is_led_as_ever() -> None:
    arm = ARMS["rm1"]
    assert lag_of(OlderArm, arm, feasible_sine(arm.joints[0], 0.4), Sender()).median > 150.0
    rig = OlderArm().ready()
    lead(rig, {0: GENTLE}, 1.0, Sender())
    assert rig.messages(COMMANDS)
    assert replacements(rig) == 0


@pytest.mark.parametrize("name", ARMS)
def test_a_step_is_begun_at_once(name: str) -> None:
    assert first_motion_ms(VirtualArm, ARMS[name]) < 60.0


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("wire", range(len(ANY_WIRE)))
def test_on_any_wire_the_limits_are_kept_and_every_step_is_accounted_for(name: str, wire: int) -> None:
    rig = followed(ARMS[name], wire, 5.0, msgspec_copy(ANY_WIRE[wire]), Sender(30.0, jitter=0.01, grain=0.001))
    assert not violations(rig, rig.path)
    assert rig.device.max_slot_error <= 128
    errors = [abs(error) for message in rig.messages(STEP_ERRORS) for error in message.error]
    assert max(errors) <= 0.5 + 1 / 256
    assert replacements(rig) > 100
    rig.run(2.0)
    assert rig.device.mode is DeviceMode.IDLE
    assert rig.core.controller.rest_position() == pytest.approx(rig.position, abs=0.01)


def msgspec_copy(wire: VirtualWire) -> VirtualWire:
    return VirtualWire(**vars(wire))


def test_the_arm_rests_exactly_at_its_target_and_goes_on_from_there() -> None:
    rig = VirtualArm().ready()
    for place in (0.3, -0.2):
        for _ in range(90):
            rig.target(brazo_joint=place)
            rig.run(1 / 30)
        assert rig.device.mode is DeviceMode.RUN
        assert rig.device.steps[0] == (rm1().joints[0].steps.to_q8(place) + 128) >> 8
    assert "underrun" not in rig.events()


def test_a_stream_that_falls_silent_rests_and_ends_and_does_not_go_on_to_its_target() -> None:
    rig = VirtualArm().ready()
    for _ in range(4):
        rig.target(brazo_joint=2.5)
        rig.run(1 / 30)
    there = rig.position[0]
    assert rig.run(0.7, lambda: rig.device.mode is DeviceMode.IDLE)
    assert there < rig.position[0] < there + 0.2
    rested = rig.device.steps
    rig.run(1.0)
    assert rig.device.steps == rested
    assert "stopped" not in rig.events()
    assert_within_limits(rig)


@pytest.mark.parametrize("period", [0.02, 1 / 30, 0.1])
def test_the_last_target_is_where_the_arm_rests_if_no_more_come(period: float) -> None:
    rig = VirtualArm().ready()
    for index in range(1, round(1.0 / period) + 1):
        rig.target(brazo_joint=0.2 * period * index)
        rig.run(period)
    assert rig.run(2.0, lambda: rig.device.mode is DeviceMode.IDLE)
    assert rig.position[0] == pytest.approx(0.2, abs=0.51 * rm1().joints[0].steps.resolution)
    assert not violations(rig, rig.path)


def streaming(rig: VirtualArm, seconds: float) -> None:
    """A second or so of a stream in full motion."""
    lead(rig, {0: sine(0.5, 0.3)}, seconds, Sender())


@pytest.mark.parametrize("how", ["stop", "hold of the device", "e-stop", "link", "reboot"])
def test_targets_that_go_on_after_an_interruption_move_nothing(how: str) -> None:
    rig = VirtualArm().ready()
    streaming(rig, 2.3)
    match how:
        case "stop":
            rig.ask(StopKind.STOP)
        case "hold of the device":
            rig.lost = {"hb"}
            lead(rig, {0: GENTLE}, 0.8, Sender())
            rig.lost = set()
        case "e-stop":
            rig.device.press_input(0, True)
            lead(rig, {0: GENTLE}, 0.2, Sender())
            rig.device.press_input(0, None)
        case "link":
            rig.link(False)
            lead(rig, {0: GENTLE}, 0.2, Sender())
            rig.link(True)
        case "reboot":
            rig.reboot(78)
    lead(rig, {0: GENTLE}, 2.0, Sender())
    rested = rig.device.steps
    lead(rig, {0: GENTLE}, 2.0, Sender())
    assert rig.device.steps == rested
    assert rig.device.max_slot_error <= 128


def test_after_a_stop_and_a_silence_a_stream_begins_again() -> None:
    rig = VirtualArm().ready()
    streaming(rig, 2.3)
    rig.ask(StopKind.STOP)
    rig.run(2.0)
    there = rig.position[0]
    lead(rig, {0: GENTLE}, 2.0, Sender())
    assert abs(rig.position[0] - there) > 0.01
    assert_within_limits(rig)


def test_speed_hold_and_resume_of_a_person_keep_the_limits_and_the_stream() -> None:
    rig = VirtualArm().ready()
    signal = persons(rig.arm, 5, 12.0)
    kinds = DeviceCommandKind
    for kind, fields in (
        (kinds.SPEED, {"scale": 0.5}),
        (kinds.SPEED, {"scale": 1.0}),
        (kinds.HOLD, {}),
        (kinds.RESUME, {}),
    ):
        lead(rig, signal, 1.5, Sender())
        rig.ask(asked(kind, **fields), 40 + len(rig.answers))
    lead(rig, {0: GENTLE}, 2.5, Sender())
    assert not violations(rig, rig.path)
    assert rig.device.max_slot_error <= 128
    assert rig.device.mode is DeviceMode.RUN
    errors = [abs(error) for message in rig.messages(STEP_ERRORS) for error in message.error]
    assert max(errors) <= 0.5 + 1 / 256


def test_a_goal_waits_until_the_arm_rests_where_its_stream_was_cut_and_a_stop_ends_it() -> None:
    rig = VirtualArm().ready()
    for outcome in (GoalStatusCode.SUCCEEDED, GoalStatusCode.ABORTED):
        name = outcome.name
        streaming(rig, 1.3)
        here = rig.messages(JOINT_STATES)[-1].position
        assert rig.device.moving
        assert rig.goal(move(here, (0.2, 0.2, 0.05)), name).accepted
        if outcome is GoalStatusCode.ABORTED:
            rig.run(0.05)
            rig.ask(StopKind.STOP)
        assert rig.finish(name)[0] is outcome
        rig.run(1.0)
    rested = rig.device.steps
    rig.run(1.0)
    assert rig.device.steps == rested
    assert_within_limits(rig)


def test_a_jump_to_the_end_of_a_travel_stays_within_it_and_arrives() -> None:
    rig = VirtualArm().ready()
    joint = rig.arm.joints[0]
    for index in range(240):
        rig.target(brazo_joint=joint.upper if index // 60 % 2 == 0 else joint.upper - 0.5)
        rig.run(1 / 30)
        assert rig.position[0] <= joint.upper + 0.5 * joint.steps.resolution
    for _ in range(90):
        rig.target(brazo_joint=joint.upper)
        rig.run(1 / 30)
    assert rig.position[0] == pytest.approx(joint.upper, abs=joint.steps.resolution)
    assert not violations(rig, rig.path)


def test_given_velocities_lead_as_estimated_ones_do() -> None:
    rig = VirtualArm().ready()
    base = rig.position
    began = rig.now
    for _ in range(60):
        t = rig.now - began
        stamp = rig.moment.unix
        place = (base[0] + 0.2 * t, *base[1:])
        target = JointTargets(stamp=stamp, name=rig.arm.joint_names, position=place, velocity=(0.2, 0.0, 0.0))
        rig.handle(TargetsInput(target))
        rig.run(1 / 30)
    behind = base[0] + 0.2 * (rig.now - began) - rig.path[-1][0] / rig.arm.joints[0].steps.per_unit
    assert behind / 0.2 == pytest.approx(0.04, abs=0.005)


def test_velocities_that_do_not_fit_their_joints_are_refused() -> None:
    rig = VirtualArm().ready()
    stamp = rig.moment.unix
    rig.handle(TargetsInput(JointTargets(stamp=stamp, name=("brazo_joint",), position=(0.1,), velocity=(0.1, 0.2))))
    rig.run(0.5)
    event = rig.messages(DEVICE_EVENTS)[-1]
    assert event.why == because("target.velocities.count", named=1, given=2)
    assert rig.device.steps == (0, 0, 0)


def test_unstamped_targets_are_followed_and_said_once() -> None:
    rig = VirtualArm().ready()
    lead(rig, {0: GENTLE}, 2.0, Sender(stamped=False))
    told = [event for event in rig.messages(DEVICE_EVENTS) if event.event == "target_unstamped"]
    assert [event.why for event in told] == [because("target.unstamped")]
    assert abs(rig.position[0]) > 0.005


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.1])
def test_the_delay_is_the_lag(delay: float) -> None:
    rig = VirtualArm(parameters=GatewayParameters(target_delay=delay)).ready()
    base = lead(rig, {0: lambda t: 0.2 * t}, 1.5, Sender(50.0))
    behind = base[0] + 0.2 * 1.5 - rig.path[-1][0] / rig.arm.joints[0].steps.per_unit
    assert behind / 0.2 == pytest.approx(delay, abs=0.01)


def test_a_late_message_is_followed_by_a_fresh_one_at_once() -> None:
    rig = followed(ARMS["parol6"], 2, 5.0, VirtualWire(delay=0.002, jitter=0.05, is_ordered=True), Sender())
    late = [ack for ack in rig.published["command_acks"] if ack.code == Code.LATE]
    assert late
    for ack in late[:-1]:
        soonest = min(chunk.stamp for chunk in rig.messages(COMMANDS) if chunk.stamp >= ack.stamp)
        assert soonest - ack.stamp < 20_000_000


class Kept(VirtualArm):
    """Keeps what its core is given, and what comes of it."""

    def start_core(self, arm, session_id, parameters=None):
        super().start_core(arm, session_id, parameters)
        self.began, self.calls = session_id, []
        handle = self.core.handle

        def watched(given, moment):
            returned = handle(given, moment)
            self.calls.append((given, moment, returned))
            return returned

        self.core.handle = watched


def test_the_same_inputs_give_the_same_replacements() -> None:
    rig = Kept(VirtualWire(delay=0.002, jitter=0.02, loss=0.02, duplicates=0.02), seed=4)
    rig.ready()
    lead(rig, persons(rig.arm, 4, 3.0), 3.0, Sender(50.0, jitter=0.01))
    rig.run(2.0)
    again = GatewayCore(rig.arm, rig.began, rig.core.device.parameters)
    encoded = [msgspec.msgpack.encode(Given(m.unix, m.monotonic, 0, given)) for given, m, _ in rig.calls]
    for given, (_, _, was) in zip(unpacked(packed(encoded)), rig.calls, strict=True):
        assert again.handle(given.input, given.moment) == was
    assert replacements(rig) > 100


def test_the_stream_of_a_gateway_that_is_gone_is_stopped_by_the_next_one() -> None:
    rig = VirtualArm(start=middle(rm1())).ready()
    streaming(rig, 1.3)
    rig.new_gateway()
    rig.ready()
    assert rig.run(2.0, lambda: rig.device.mode is DeviceMode.IDLE)
    lead(rig, {0: GENTLE}, 2.0, Sender())
    assert replacements(rig) > 90
    assert_within_limits(rig)
