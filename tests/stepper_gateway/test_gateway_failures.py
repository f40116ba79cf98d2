"""Failures of links, devices, heartbeats, gateways: the arm stays on its path, nothing resumes by itself."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.motion import FollowErrorCode
from gemelo.schemas.topics import DEVICE_STATUS, JOINT_STATES
from gemelo.services.stepper_gateway.links.frames import Ack, CommandReply, StateFrame, SyncReply, encode
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.virtual_arm.gateway_driver import CancelInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, VirtualWire
from tests.profiles import examples
from tests.stepper_gateway.harness import assert_within_limits, move

HOME = (0.0, 0.0, 0.0)
READY = (0.6, -1.2, 0.08)


def moving_rig(**wire: float) -> VirtualArm:
    rig = VirtualArm(VirtualWire(**wire)).ready()  # type: ignore[arg-type]
    assert rig.goal(move(HOME, READY)).accepted
    rig.run(1.2)
    assert rig.device.moving
    return rig


def assert_works_again(rig: VirtualArm, since: int = 0) -> None:
    """A next goal from here succeeds."""
    assert rig.run(5.0, lambda: not rig.core.not_ready(rig.moment) and rig.device.mode == DeviceMode.IDLE)
    rig.run(0.1)
    verdict = rig.goal(move(rig.messages(JOINT_STATES)[-1].position, (0.1, 0.1, 0.05)), "next")
    assert verdict.accepted, verdict.reason
    assert rig.finish("next")[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig, since)


def test_a_lost_link_aborts_the_goal_the_device_holds_and_nothing_resumes() -> None:
    rig = moving_rig()
    rig.link(False)
    status, result = rig.finish(seconds=1.0)
    assert (status, result.error_code) == (GoalStatusCode.ABORTED, FollowErrorCode.DEVICE_FAILED)
    assert "broker" in result.error_string
    rig.run(3.0)
    assert rig.device.mode == DeviceMode.HOLD
    held = rig.device.steps
    rig.link(True)
    assert_works_again(rig)
    assert "stopping" in rig.events()
    assert rig.path[-1] != held


@pytest.mark.parametrize("phase", [0.0, 0.03, 0.06, 0.09])
def test_a_short_cut_is_bridged_by_the_lead(phase: float) -> None:
    rig = moving_rig()
    rig.run(phase)
    rig.wire.is_cut = True
    rig.run(0.25)
    rig.wire.is_cut = False
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)


def test_a_silent_device_is_offline_after_half_a_second() -> None:
    rig = moving_rig()
    rig.wire.is_cut = True
    rig.run(0.4)
    assert not rig.finished
    rig.run(0.2)
    status, result = rig.finished["g"]
    assert status == GoalStatusCode.ABORTED
    assert "silent" in result.error_string
    assert not rig.messages(DEVICE_STATUS)[-1].online
    verdict = rig.goal(move(READY, HOME), "refused")
    assert verdict.code == FollowErrorCode.DEVICE_FAILED
    rig.wire.is_cut = False
    assert_works_again(rig)


def test_a_reboot_while_moving_aborts_and_asks_for_a_reference() -> None:
    rig = moving_rig()
    rig.reboot(78, referenced=False)
    status, result = rig.finish(seconds=1.0)
    assert status == GoalStatusCode.ABORTED
    assert "restarted" in result.error_string
    rig.run(0.5)
    verdict = rig.goal(move(HOME, READY), "refused")
    assert not verdict.accepted
    assert "gemelo reference" in verdict.reason
    rig.command(DeviceCommandKind.REFERENCE)
    rig.run(0.2)
    assert rig.answers[1].accepted
    assert rig.messages(JOINT_STATES)[-1].position == HOME
    assert_works_again(rig, since=len(rig.path))


def test_a_late_frame_of_the_old_boot_is_no_reboot() -> None:
    rig = VirtualArm().ready()
    rig.reboot(78)
    rig.run(0.5)
    rig.receive(
        Kind.STATE, encode(StateFrame(boot_id=77, t_us=99_000_000, mode=3, steps=(1, 2, 3), velocity=(0, 0, 0)))
    )
    assert rig.events().count("rebooted") == 1
    assert rig.messages(JOINT_STATES)[-1].position == HOME
    rig.run(0.1)
    assert_works_again(rig)


def test_a_forged_boot_a_forged_time_and_a_stale_last_will_are_survived() -> None:
    rig = VirtualArm().ready()
    forged = StateFrame(boot_id=5, t_us=2**60, mode=3, steps=(1, 2, 3), velocity=(0, 0, 0))
    rig.receive(Kind.STATUS, b'{"online": false, "device": "rm1", "boot_id": 77}', retained=True)
    rig.receive(Kind.STATUS, b'{"online": true, "device": "rm1", "boot_id": 5, "joints": 9}')
    rig.run(0.1)
    assert not rig.core.not_ready(rig.moment)
    rig.receive(Kind.STATE, encode(forged))
    rig.run(1.5)
    assert not rig.core.not_ready(rig.moment)
    rig.receive(Kind.STATE, encode(StateFrame(boot_id=77, t_us=2**60, mode=3, steps=(1, 2, 3), velocity=(0, 0, 0))))
    rig.run(1.5)
    assert_works_again(rig)


def test_a_silent_gateway_stops_the_arm_on_its_path_and_a_new_one_takes_over() -> None:
    rig = moving_rig()
    rig.gateway_is_on = False
    rig.run(3.0)
    assert rig.device.mode == DeviceMode.HOLD
    rig.gateway_is_on = True
    rig.new_gateway()
    rig.ready()
    rig.run(0.5)
    assert rig.device.mode == DeviceMode.IDLE
    assert "stopping" in rig.events()
    assert_works_again(rig)


def test_a_gateway_that_starts_while_the_device_moves_stops_it() -> None:
    rig = moving_rig()
    rig.new_gateway()
    rig.ready()
    rig.run(2.0)
    assert rig.device.mode == DeviceMode.IDLE
    assert "stopping" in rig.events()
    assert_works_again(rig)


def test_a_frozen_gateway_finds_its_goal_aborted_by_the_lost_heartbeat() -> None:
    rig = moving_rig()
    rig.gateway_is_on = False
    rig.run(0.8)
    rig.gateway_is_on = True
    status, result = rig.finish(seconds=3.0)
    assert status == GoalStatusCode.ABORTED
    assert result.error_code == FollowErrorCode.DEVICE_FAILED
    assert_works_again(rig)


def test_hold_pauses_a_goal_and_resume_continues_it() -> None:
    rig = moving_rig()
    rig.command(DeviceCommandKind.HOLD, 1)
    rig.run(10.0)
    assert rig.answers[1].accepted
    assert rig.device.mode == DeviceMode.HOLD
    assert not rig.finished
    rig.command(DeviceCommandKind.RESUME, 2)
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert rig.answers[2].accepted
    assert_within_limits(rig)


def test_a_stop_command_decelerates_and_aborts_the_goal() -> None:
    rig = moving_rig()
    rig.command(DeviceCommandKind.STOP, 1)
    status, result = rig.finish()
    assert status == GoalStatusCode.ABORTED
    assert "STOP" in result.error_string
    assert rig.answers[1].accepted
    assert_works_again(rig)


def test_stop_during_streaming_ends_it_until_the_targets_have_paused() -> None:
    rig = VirtualArm().ready()
    for index in range(30):
        rig.target(brazo_joint=1.0)
        if index == 10:
            rig.command(DeviceCommandKind.STOP, 1)
        rig.run(0.1)
    stopped = rig.device.steps
    assert rig.device.mode == DeviceMode.IDLE
    rig.run(1.0)
    for _ in range(30):
        rig.target(brazo_joint=1.0)
        rig.run(0.1)
    assert rig.device.steps[0] > stopped[0]
    assert_within_limits(rig)


def test_a_command_to_an_absent_device_is_answered_with_the_reason() -> None:
    rig = VirtualArm().ready()
    rig.wire.is_cut = True
    rig.command(DeviceCommandKind.HOLD, 1)
    rig.run(3.0)
    assert not rig.answers[1].accepted
    rig.command(DeviceCommandKind.RESET, 2)
    assert "silent" in rig.answers[2].reason


def test_a_refused_command_says_why() -> None:
    rig = VirtualArm().ready()
    rig.command(DeviceCommandKind.RESUME, 1)
    rig.command(DeviceCommandKind.REFERENCE, 2, brazo_joint=9.0, antebrazo_joint=0.0, efector_joint=0.0)
    rig.command(DeviceCommandKind.REFERENCE, 3, antebraso_joint=0.0)
    rig.run(0.2)
    assert "NOT_READY" in rig.answers[1].reason
    assert "brazo_joint" in rig.answers[2].reason
    assert "antebrazo_joint" in rig.answers[3].reason
    assert not any(rig.answers[i].accepted for i in (1, 2, 3))


def test_reference_declares_where_the_joints_stand() -> None:
    rig = VirtualArm(referenced=False).ready()
    rig.command(DeviceCommandKind.REFERENCE, 1, efector_joint=0.1, brazo_joint=0.5, antebrazo_joint=-0.5)
    rig.run(0.2)
    assert rig.answers[1].accepted
    assert rig.messages(JOINT_STATES)[-1].position == pytest.approx((0.5, -0.5, 0.1), abs=0.008)
    assert_works_again(rig, since=len(rig.path))


@pytest.mark.parametrize("seed", range(6))
def test_cancel_works_over_a_wire_that_loses_and_reorders(seed: int) -> None:
    rig = VirtualArm(VirtualWire(delay=0.004, jitter=0.01, loss=0.15, duplicates=0.2), seed=seed).ready()
    rig.goal(move(HOME, READY))
    rig.run(0.05 + 0.4 * seed)
    assert rig.handle(CancelInput("g")).why is None
    status, result = rig.finish(seconds=10.0)
    assert status == GoalStatusCode.CANCELED
    assert result.executed_steps == rig.device.steps
    assert_works_again(rig)


def test_a_goal_needs_a_device_that_can_move() -> None:
    rig = VirtualArm(referenced=False).ready()
    verdict = rig.goal(move(HOME, READY))
    assert verdict.code == FollowErrorCode.DEVICE_FAILED
    assert "gemelo reference" in verdict.reason


junk = st.one_of(
    st.binary(max_size=300),
    st.just(b"\0" * 1_000_000),
    st.builds(
        lambda boot, t, mode: encode(StateFrame(boot_id=boot, t_us=t, mode=mode, steps=(9, 9), velocity=(1, 1))),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**40),
        st.integers(0, 255),
    ),
    st.builds(
        lambda boot, seq, code: encode(Ack(boot_id=boot, stream=1, seq=seq, next_seq=seq, code=code)),
        st.integers(0, 2**32 - 1),
        st.integers(0, 2**32 - 1),
        st.integers(0, 255),
    ),
    st.just(encode(SyncReply(boot_id=77, t0=2**63, t1=0, t2=5))),
    st.just(encode(CommandReply(boot_id=77, cmd_id=3, cmd=200, code=201, mode=99, t_us=0))),
    st.just(b'{"online": true, "boot_id": "x"}'),
    st.just(b'{"event": 5}'),
)


@examples(quick=15, full=60)
@given(st.lists(st.tuples(st.sampled_from([k for k in Kind if k != Kind.STATUS]), junk, st.booleans()), max_size=20))
def test_junk_from_the_wire_is_counted_and_nothing_moves(items: list[tuple[Kind, bytes, bool]]) -> None:
    rig = VirtualArm().ready()
    rig.run(0.2)
    wrong = 0
    for kind, payload, retained in items:
        before = rig.core.bad_frames
        rig.receive(kind, payload, retained)
        wrong += rig.core.bad_frames > before
        if retained:
            assert rig.core.bad_frames == before + 1
    rig.run(0.3)
    assert rig.device.steps == (0, 0, 0)
    assert not [kind for _, kind, _ in rig.sent if kind in ("traj", "cmd")]
    assert rig.core.bad_frames == wrong


@examples(quick=10, full=40)
@given(st.lists(st.tuples(st.sampled_from(list(Kind)), st.binary(max_size=80)), max_size=20))
def test_random_bytes_while_moving_change_nothing(items: list[tuple[Kind, bytes]]) -> None:
    rig = VirtualArm().ready()
    rig.goal(move(HOME, (0.1, -0.1, 0.01)))
    for kind, payload in items:
        rig.receive(kind, payload)
        rig.run(0.05)
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert_within_limits(rig)
