"""Joints that a trip passes, homes or leaves to a person, and the sentence of a confidence that is too low."""

from __future__ import annotations

from dataclasses import replace as with_
from itertools import pairwise

import pytest
from msgspec.structs import replace

import gemelo
from gemelo.api.ledger import Requirement, read_ledger
from gemelo.api.verification import far_side, is_passable, trip_of
from gemelo.libraries.arm.model.description import ArmDescription, load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.schemas.ledger import StepLedger, VerifiedBy

RM1, PAROL6 = (load_arm(project_root() / "urdf" / name) for name in ("rm1", "parol6"))


def standing(arm: ArmDescription) -> dict[str, float]:
    return dict(zip(arm.joint_names, arm.reference_position, strict=True))


def without_switch(arm: ArmDescription, name: str) -> ArmDescription:
    joints = tuple(
        with_(joint, drive=replace(joint.drive, homing=None)) if joint.name == name else joint for joint in arm.joints
    )
    return with_(arm, joints=joints)


def test_home_switches_within_the_limits_are_passed_and_limit_switches_are_not() -> None:
    assert [is_passable(PAROL6, joint) for joint in PAROL6.joints] == [True] * 6
    assert [is_passable(RM1, joint) for joint in RM1.joints] == [False] * 3


def test_a_joint_whose_place_is_not_known_homes() -> None:
    known = (True, False, True, True, True, True)
    trip = trip_of(PAROL6, (), known, standing(PAROL6))
    assert trip.homing == ["joint_2"]
    assert [joint.name for joint in trip.passable] == ["joint_1", "joint_3", "joint_4", "joint_5", "joint_6"]


def test_a_joint_without_a_switch_is_named_and_if_none_has_one_that_is_refused_with_the_remedy() -> None:
    arm = without_switch(RM1, "brazo_joint")
    trip = trip_of(arm, (), (True,) * 3, standing(arm))
    assert (trip.without_switch, trip.homing) == (["brazo_joint"], ["antebrazo_joint", "efector_joint"])
    with pytest.raises(gemelo.Refused, match=r"brazo_joint.*arm\.reference") as refused:
        trip_of(arm, ["brazo_joint"], (True,) * 3, standing(arm))
    assert (refused.value.check, refused.value.subject) == ("verify", "brazo_joint")
    with pytest.raises(gemelo.BadArgument, match="did you mean"):
        trip_of(arm, ["braso_joint"], (True,) * 3, standing(arm))


@pytest.mark.parametrize("joint", PAROL6.joints, ids=lambda joint: joint.name)
def test_the_trip_closes_the_switch_from_either_side_within_the_limits(joint) -> None:
    homing = joint.drive.homing
    sign = 1.0 if homing.direction == "upper" else -1.0
    for at in (joint.clamp(homing.position - sign * 0.5), joint.upper if sign > 0 else joint.lower):
        there, back = far_side(joint, at)
        assert joint.is_within(there)
        assert joint.is_within(back)
        sides = [sign * (place - homing.position) >= 0.0 for place in (at, there, back)]
        assert (False, True) in list(pairwise(sides))  # it closes on one of both legs


LEDGER = StepLedger(
    name=("a", "b"), commanded=(1.0, 2.0), executed=(1, 2), verified=(0, 0), verified_at=(5, 6),
    verified_by=(VerifiedBy.HOMING, VerifiedBy.SWITCH), found_off=(0, 0), turns=(1.0, 2.0), load=(0.1, 0.2),
    confidence=(0.99, 0.9), arm_confidence=0.891, doubtful="b", reason='joint "b": `gemelo verify`', lost=(0.0, 0.0),
    bound=(1.0, 800.0), tool_error=0.0001, tool_bound=0.02,
)  # fmt: skip


class Told:
    """A session whose newest ledger is given."""

    def __init__(self, ledger: StepLedger) -> None:
        self.ledger = ledger

    def newest(self, _topic: object) -> StepLedger:
        return self.ledger


def test_a_confidence_that_is_too_low_refuses_with_joint_value_limit_and_remedy() -> None:
    requirement = Requirement(Told(LEDGER))  # type: ignore[arg-type]
    requirement.require(0.85)
    with pytest.raises(gemelo.Refused, match=r"89\.1 % sure .* 95\.0 % are required: joint \"b\"") as refused:
        requirement.require(0.95)
    found = refused.value
    assert (found.check, found.subject, found.value, found.limit) == ("confidence", "b", 0.891, 0.95)
    assert found.remedy == "arm.verify()"
    with pytest.raises(gemelo.Refused):
        requirement.check()  # it stays in force
    with requirement.suspended():
        requirement.check()
    requirement.require(0.0)
    requirement.check()
    with pytest.raises(gemelo.BadArgument, match="95 is no probability"):
        requirement.require(95.0)


def test_a_ledger_is_read_by_joints_and_a_foreign_board_has_no_executed_steps() -> None:
    ledger = read_ledger(LEDGER)
    assert (ledger.joints["b"].executed, ledger.joints["b"].bound) == (2, 800.0)
    foreign = read_ledger(replace(LEDGER, executed=(), open_loop=True))
    assert foreign.joints["a"].executed is None
    assert foreign.open_loop
