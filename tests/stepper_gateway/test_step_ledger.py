"""The ledger in the gateway, with the real firmware core, its motors and its switches, in virtual time."""

from __future__ import annotations

import json
from contextlib import closing
from pathlib import Path

import pytest
from msgspec.structs import replace

from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.process.unwritten import UnwrittenFiles
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.ledger import StepLedger, VerifiedBy
from gemelo.schemas.topics import STEP_LEDGER
from gemelo.services.stepper_gateway.ledger.confidence import REBOOT, LedgerRecord
from gemelo.services.stepper_gateway.ledger.ledger_file import LedgerFile, read_ledger, write_ledger
from gemelo.services.stepper_gateway.ledger.step_ledger import KEEP_EVERY, KEEP_SOON
from gemelo.services.stepper_gateway.links.link import Kind
from gemelo.tools.bench.stopping import smooth_move
from gemelo.tools.virtual_arm.sketch_arm import SketchArm
from gemelo.tools.virtual_arm.virtual_arm import BOOTED, VirtualArm, rm1
from tests.runtime.support import until
from tests.stepper_gateway.harness import ROOT, move
from tests.stepper_gateway.test_ra_sketch import HOME as AT_HOME

HOME, REFERENCE, DISARM, ARM = (
    DeviceCommandKind.HOME, DeviceCommandKind.REFERENCE, DeviceCommandKind.DISARM, DeviceCommandKind.ARM,
)  # fmt: skip
ZERO, NEAR = (0.0, 0.0, 0.0), (0.4, -0.4, 0.03)
MOTORS = [joint.drive.motor for joint in rm1().joints]


def ledger(rig: VirtualArm | SketchArm) -> StepLedger:
    """The one after what has just happened."""
    told = len(rig.messages(STEP_LEDGER))
    assert rig.run(1.0, lambda: len(rig.messages(STEP_LEDGER)) > told)
    newest: StepLedger = rig.messages(STEP_LEDGER)[-1]
    return newest


def home(rig: VirtualArm, *names: str) -> StepLedger:
    rig.command(HOME, **dict.fromkeys(names, 0.0))
    assert rig.run(2.0, lambda: rig.device.mode is DeviceMode.HOMING)
    assert rig.run(90.0, lambda: rig.device.mode is DeviceMode.IDLE)
    rig.run(0.1)
    return ledger(rig)


def homed_by_word(rig: VirtualArm) -> VirtualArm:
    """The device says that its joints have found their switches where they are."""
    for name in ("q1", "q2", "q3"):
        event = {"event": "homed", "t_us": BOOTED + rig.now_us, "detail": f"{name}: 0 steps off"}
        rig.receive(Kind.EVENT, json.dumps(event).encode())
    rig.run(0.1)
    return rig


@pytest.fixture
def rig() -> VirtualArm:
    return homed_by_word(VirtualArm(motors=MOTORS).ready())


def follow(rig: VirtualArm, goal: tuple[float, ...], name: str = "g") -> None:
    verdict = rig.goal(move(rig.position, goal), name)
    assert verdict.accepted, verdict.reason
    rig.finish(name)


def test_an_arm_that_says_where_it_is_is_not_verified_by_that() -> None:
    told = ledger(VirtualArm().ready())
    assert told.arm_confidence == 0.0
    assert set(told.verified_by) == {VerifiedBy.NOTHING}
    assert "`gemelo verify`" in told.reason


def test_homing_verifies_a_joint_at_its_switch_and_finds_what_was_lost() -> None:
    rig = VirtualArm(motors=MOTORS).ready()
    first = home(rig, "efector_joint")
    assert first.verified_by == (VerifiedBy.NOTHING, VerifiedBy.NOTHING, VerifiedBy.HOMING)
    assert first.verified[2] == round(rm1().joints[2].steps.to_steps(0.206))
    assert first.confidence[2] > 0.999
    rig.device.slip(2, -40)
    again = home(rig, "efector_joint")
    assert abs(again.found_off[2] + 40) <= 1
    assert again.lost[2] == 0.0  # homing has corrected it
    assert again.confidence[2] > 0.999


def test_a_move_is_counted_in_turns_and_load_and_lowers_the_confidence(rig: VirtualArm) -> None:
    before = ledger(rig)
    follow(rig, NEAR)
    after = ledger(rig)
    assert before.arm_confidence > 0.999
    assert 0.9 < after.arm_confidence < before.arm_confidence
    assert after.executed == rig.device.steps
    turns = [abs(steps) / 400 for steps in rig.device.steps]
    assert after.turns == pytest.approx(turns, abs=0.01)
    assert all(0.02 < load < 0.2 for load in after.load)
    assert after.tool_error < after.tool_bound


def test_a_load_that_was_never_verified_gives_up_a_joint_and_a_verified_one_does_not(rig: VirtualArm) -> None:
    follow(rig, NEAR)
    unknown = ledger(rig)
    assert unknown.tool_bound > 0.02  # the least sure joint may be off by all that it has travelled
    proven = homed_by_word(rig)
    follow(proven, ZERO, "back")
    sure = ledger(proven)
    assert sure.arm_confidence > 0.95 > unknown.arm_confidence
    assert sure.tool_error < sure.tool_bound < 0.005


def test_an_estop_leaves_nothing_verified(rig: VirtualArm) -> None:
    rig.device.press_input(0, True)
    rig.run(0.1)
    told = ledger(rig)
    assert told.arm_confidence == 0.0
    assert told.tool_bound > 0.3  # the joints may be anywhere in their ranges


def test_a_person_s_word_is_nearly_as_good_as_a_switch(rig: VirtualArm) -> None:
    rig.command(DISARM)
    rig.run(0.5)
    rig.command(ARM)
    rig.run(0.5)
    assert ledger(rig).arm_confidence == 0.0
    rig.command(REFERENCE, 2, brazo_joint=0.0, antebrazo_joint=0.0)
    rig.run(0.3)
    told = ledger(rig)
    assert told.verified_by == (VerifiedBy.REFERENCE, VerifiedBy.REFERENCE, VerifiedBy.NOTHING)
    assert 0.99 < told.confidence[0] < 1.0
    assert (told.confidence[2], told.doubtful) == (0.0, "efector_joint")


def test_pulses_that_stopped_without_a_ramp_are_an_incident(rig: VirtualArm) -> None:
    verdict = rig.goal(move(ZERO, NEAR))
    assert verdict.accepted
    rig.run(0.5)
    rig.freeze(0.2)
    rig.run(3.0)
    assert "late" in rig.events()
    assert ledger(rig).arm_confidence < 0.6


def test_the_ledger_is_kept_over_a_restart_of_the_gateway(rig: VirtualArm) -> None:
    follow(rig, NEAR)
    rig.run(KEEP_EVERY)
    before = ledger(rig)
    rig.new_gateway()
    rig.ready()
    after = ledger(rig)
    assert after.verified == before.verified
    assert after.verified_at == before.verified_at
    assert after.turns == before.turns
    assert after.arm_confidence == pytest.approx(before.arm_confidence, abs=1e-4)


def test_what_the_device_did_without_a_gateway_counts_as_the_hardest_motion(rig: VirtualArm) -> None:
    rig.run(KEEP_EVERY)
    verdict = rig.goal(move(ZERO, NEAR, slower=3.0))
    assert verdict.accepted
    rig.run(0.02)
    kept = [replace(rig.kept[-1], is_moving=False)]
    rig.run(2.0)
    rig.kept = kept
    seen = ledger(rig)
    rig.new_gateway()
    rig.ready()
    after = ledger(rig)
    assert after.load[0] > seen.load[0]
    assert after.arm_confidence < seen.arm_confidence


def test_a_ledger_that_was_written_in_a_motion_is_doubted(rig: VirtualArm) -> None:
    rig.run(KEEP_EVERY)
    rig.kept = [replace(rig.kept[-1], is_moving=True)]
    before = ledger(rig)
    rig.new_gateway()
    rig.ready()
    after = ledger(rig)
    assert all(now > then for now, then in zip(after.turns, before.turns, strict=True))
    assert after.arm_confidence < before.arm_confidence


def test_another_boot_at_rest_costs_a_little_and_one_without_reference_everything(rig: VirtualArm) -> None:
    before = ledger(rig).confidence[0]
    rig.reboot(91)
    assert rig.run(3.0, lambda: not rig.reason_not_ready)
    assert ledger(rig).confidence[0] == pytest.approx(before * (1.0 - REBOOT), rel=0.01)
    rig.reboot(92, referenced=False)
    rig.run(1.0)
    assert ledger(rig).arm_confidence == 0.0


@pytest.mark.parametrize("other", [{"virtual": False}, {"config_crc32": 1}, {"steps": (0, 0)}])
def test_the_ledger_of_another_device_or_configuration_says_nothing(rig: VirtualArm, other: dict[str, object]) -> None:
    rig.run(KEEP_EVERY)
    rig.kept = [replace(rig.kept[-1], **other)]
    rig.new_gateway()
    rig.ready()
    assert ledger(rig).arm_confidence == 0.0


def test_it_is_written_when_something_has_changed_and_not_more_often_than_its_rate(rig: VirtualArm) -> None:
    rig.run(KEEP_EVERY)
    quiet = len(rig.kept)
    rig.run(3.0 * KEEP_EVERY)
    assert len(rig.kept) == quiet
    begun = rig.now
    for count in range(6):
        follow(rig, NEAR if count % 2 == 0 else ZERO, f"move {count}")
    written = rig.kept[quiet:]
    assert any(record.is_moving for record in written)
    assert len(written) <= (rig.now - begun) / KEEP_SOON + 1


def test_a_home_switch_that_a_planned_motion_passes_verifies_without_homing() -> None:
    arm = load_arm(ROOT / "urdf/parol6")
    start = arm.named_states["home"]
    rig = VirtualArm(arm=arm, start=start).ready()
    goal = (2.125, *start[1:])  # behind the switch of joint_1 at 2.1127
    assert rig.goal(smooth_move(arm, rig.position, goal, 1.0)).accepted
    rig.finish()
    told = ledger(rig)
    assert told.verified_by == (VerifiedBy.SWITCH, *[VerifiedBy.NOTHING] * 5)
    assert told.confidence[0] > 0.98
    assert told.lost[0] == 0.0
    assert rig.goal(smooth_move(arm, rig.position, start, 1.0), "back").accepted
    rig.finish("back")
    rig.device.slip(0, 500)
    assert rig.goal(smooth_move(arm, rig.position, goal, 1.0), "again").accepted
    rig.finish("again")
    told = ledger(rig)
    assert told.lost[0] == pytest.approx(500, abs=3)
    assert told.confidence[0] == 0.0
    assert told.tool_error == pytest.approx(500 / arm.joints[0].steps.per_unit * 0.3, rel=0.7)
    assert "gemelo home joint_1" in told.reason


def test_of_a_board_with_another_dialect_nothing_is_sure() -> None:
    arm = SketchArm().referenced()
    assert arm.goal(move(AT_HOME, (0.1, 0.0, 0.0), arm=arm.arm)).accepted
    arm.finish()
    told = ledger(arm)
    assert told.open_loop
    assert (told.executed, told.arm_confidence) == ((), 0.0)
    assert "does not say what it has executed" in told.reason
    assert arm.kept == []


def test_the_file_is_replaced_as_a_whole_and_read_back(tmp_path: Path, rig: VirtualArm) -> None:
    complaints: list[str] = []
    file = LedgerFile(tmp_path / "run", "rm1", UnwrittenFiles(complaints.append))
    file.keep(rig.core.ledger_record())
    file.close()
    assert read_ledger(file.path) == (rig.core.ledger_record(), "")
    assert [path.name for path in file.path.parent.iterdir()] == ["rm1.ledger.json"]
    assert oct(file.path.stat().st_mode & 0o777) == "0o600"
    assert complaints == []


def test_a_file_that_cannot_be_read_or_written_is_said_and_costs_no_more(tmp_path: Path) -> None:
    path = tmp_path / "rm1.ledger.json"
    assert read_ledger(path) == (None, "")
    path.write_text('{"joints": {"brazo_joint": {"turns"')
    record, trouble = read_ledger(path)
    assert record is None
    assert "gemelo verify" in trouble
    (tmp_path / "full").write_text("no folder")
    complaints: list[str] = []
    file = LedgerFile(tmp_path / "full", "rm1", UnwrittenFiles(complaints.append))
    file.keep(LedgerRecord())
    file.close()
    assert len(complaints) == 1
    assert "no joint counts as verified after a restart" in complaints[0]
    with pytest.raises(OSError, match="full"):
        write_ledger(tmp_path / "full" / "x.json", LedgerRecord())


def test_what_the_disk_has_refused_is_written_when_it_takes_it(tmp_path: Path) -> None:
    complaints: list[str] = []
    (tmp_path / "run").write_text("no folder")
    with closing(LedgerFile(tmp_path / "run", "rm1", UnwrittenFiles(complaints.append))) as file:
        file.keep(LedgerRecord())
        assert until(lambda: complaints)
        (tmp_path / "run").unlink()
        assert until(file.path.exists)
        assert until(lambda: len(complaints) == 2), complaints
    assert "can be written again" in complaints[1]
