"""States of an arm at rest: fewer, never late when something changes, and all of them where it moves."""

from __future__ import annotations

from itertools import pairwise

import pytest

from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.stepper_gateway.device.state_thinner import StateThinner
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

THERE = PathPoint((7.0,), (0.0,))


def frame(number: int, **other: object) -> StateFrame:
    """The one after `number` periods of 20 ms."""
    return StateFrame(t_us=20_000 * number, **{"mode": 3, "steps": (7,), "velocity": (0.0,), **other})


def passed(frames: list[StateFrame], points: dict[int, PathPoint] | None = None, longest: float = 0.1) -> list[int]:
    thinner = StateThinner()
    return [
        state.t_us // 20_000
        for number, state in enumerate(frames)
        if thinner.passes(state, (points or {}).get(number, THERE), longest)
    ]


def test_at_rest_the_gap_doubles_until_it_is_the_longest() -> None:
    assert passed([frame(n) for n in range(30)]) == [0, 1, 3, 7, 12, 17, 22, 27]
    assert passed([frame(n) for n in range(9)], longest=0.02) == list(range(9))


@pytest.mark.parametrize(
    "other", [{"steps": (8,)}, {"mode": 4}, {"refused": 1}, {"outputs": 1}, {"velocity": (0.5,)}, {"flags": 0}]
)
def test_whatever_changes_is_published_at_once_and_so_is_what_comes_after_it(other: dict[str, object]) -> None:
    assert passed([frame(n, **(other if n >= 14 else {})) for n in range(20)]) == [0, 1, 3, 7, 12, 14, 15, 17]


def test_another_commanded_point_is_a_change_too() -> None:
    assert passed([frame(n) for n in range(12)], {5: PathPoint((7.5,), (0.0,))}) == [0, 1, 3, 5, 6, 7, 9]


def test_after_another_boot_whose_clock_is_behind_nothing_waits() -> None:
    assert passed([frame(n) for n in (500, 501, 502, 503, 504, 2, 3, 4, 5, 6)]) == [500, 501, 503, 2, 3, 5]


def test_a_board_that_speaks_seldom_is_published_whole() -> None:
    assert passed([frame(50 * n) for n in range(6)]) == [0, 50, 100, 150, 200, 250]


def test_a_real_move_is_published_at_full_rate_and_every_gap_at_rest_at_most_doubles() -> None:
    arm = VirtualArm()
    arm.ready()
    arm.run(3.0)
    arm.goal(move(arm.position, tuple(each + 0.2 for each in arm.position)), "there")
    arm.run(6.0)
    states: list[JointState] = arm.messages(JOINT_STATES)
    gaps = [(after.stamp - before.stamp) * 1e-9 for before, after in pairwise(states)]
    assert max(gaps) < 0.125
    for number, (one, _) in enumerate(pairwise(states)):
        if any(one.velocity):
            assert gaps[number] < 0.025, "in motion none is left out"
    assert all(after < 2.0 * before + 0.01 for before, after in pairwise(gaps))
    assert sum(gap > 0.09 for gap in gaps) > 20, "and at rest there are few"


def test_one_who_wants_all_states_at_rest_gets_them() -> None:
    arm = VirtualArm(parameters=GatewayParameters(rest_rate=50.0))
    arm.ready()
    arm.run(2.0)
    states: list[JointState] = arm.messages(JOINT_STATES)
    assert max((after.stamp - before.stamp) * 1e-9 for before, after in pairwise(states[-50:])) < 0.025
