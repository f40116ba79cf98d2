"""The judge of chaos: it passes what is right, and names what is not."""

from __future__ import annotations

import pytest

from gemelo.libraries.arm.model.description import ArmDescription
from gemelo.schemas.device import DeviceState
from gemelo.tools.chaos.invariants import jerks, jumps, misses, missing_records, moved, segments

SLOT = 20_000  # [us] between two states
BASE = 7  # boot id


def states(arm: ArmDescription, counts: list[int], boot: int = BASE, start: int = 0) -> list[DeviceState]:
    """The first joint's counter in states 20 ms apart; the others stand at 0."""
    rest = (0,) * (len(arm.joints) - 1)
    return [
        DeviceState(stamp=(start + i) * SLOT * 1000, device_time=(start + i) * SLOT, boot_id=boot, steps=(count, *rest))
        for i, count in enumerate(counts)
    ]


def ramp(arm: ArmDescription, share: float, count: int = 12) -> list[int]:
    """Counters of the first joint as it accelerates from rest at `share` of its limit."""
    joint = arm.joints[0]
    pull = share * joint.acceleration * joint.steps.per_unit
    return [round(pull * (i * SLOT * 1e-6) ** 2 / 2.0) for i in range(count)]


def test_an_arm_within_its_limits_neither_jumps_nor_jerks(rm1: ArmDescription) -> None:
    seen = states(rm1, ramp(rm1, 1.0, 5))
    assert jumps(rm1, seen) == []
    assert jerks(rm1, seen) == []


def test_a_step_beyond_the_velocity_limit_is_a_jump(rm1: ArmDescription) -> None:
    joint = rm1.joints[0]
    most = joint.velocity * joint.steps.per_unit * 0.021
    assert jumps(rm1, states(rm1, [0, int(most)])) == []
    (found,) = jumps(rm1, states(rm1, [0, int(most) + 4]))
    assert (found.code, found.values["joint"], found.values["time"]) == ("chaos.jump", joint.name, SLOT * 1e-6)
    assert str(found).startswith(f"{joint.name} went +")


def test_twice_the_acceleration_is_a_jerk(rm1: ArmDescription) -> None:
    assert jerks(rm1, states(rm1, ramp(rm1, 1.2))) == []
    assert jerks(rm1, states(rm1, ramp(rm1, 6.0)))


def test_a_stop_from_one_slot_to_the_next_is_a_jerk(rm1: ArmDescription) -> None:
    joint = rm1.joints[0]
    fast = round(0.8 * joint.velocity * joint.steps.per_unit * 0.02)
    (found,) = jerks(rm1, states(rm1, [0, fast, 2 * fast, 3 * fast, 3 * fast, 3 * fast]))
    assert found.code == "chaos.jerk"
    assert "at once" in str(found)


def test_a_boot_a_reference_and_a_late_machine_begin_a_new_segment(rm1: ArmDescription) -> None:
    before, after = states(rm1, [100, 100]), states(rm1, [0, 0], boot=BASE + 1)
    assert [len(piece) for piece in segments(before + after, [])] == [2, 2]
    long = states(rm1, [0] * 10)
    assert [len(piece) for piece in segments(long, [])] == [10]
    assert len(segments(long, [long[5].stamp])) > 1


def test_a_state_that_is_said_twice_counts_once(rm1: ArmDescription) -> None:
    first, second = states(rm1, [0, 5])
    assert segments([first, first, second], []) == [[first, second]]


def test_what_moved_by_itself_and_what_was_falsely_reached_is_named(rm1: ArmDescription) -> None:
    rest = tuple(0.0 for _ in rm1.joints)
    away = (0.01, *rest[1:])
    assert moved(rm1, rest, rest) == []
    assert [why.code for why in moved(rm1, rest, away)] == ["chaos.moved"] * len(moved(rm1, rest, away))
    assert "moved by itself" in str(moved(rm1, rest, away)[0])
    assert misses(rm1, rest, rest) == []
    assert misses(rm1, rest, away)[0].values["true"] == 0.01
    assert "its shaft is at 0.010000" in str(misses(rm1, rest, away)[0])


@pytest.mark.parametrize(("muted", "expected"), [([], [3, 4]), ([(3, 3)], [4]), ([(2, 4)], []), ([(5, 9)], [3, 4])])
def test_records_may_be_missing_only_while_nobody_could_write_them(
    muted: list[tuple[int, int]], expected: list[int]
) -> None:
    assert missing_records([1, 2, 3, 4], {1, 2}, muted) == expected
