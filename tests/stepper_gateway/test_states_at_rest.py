"""States of an arm at rest: fewer, never late when something changes, and all of them where it moves."""

from __future__ import annotations

from itertools import pairwise

import pytest
from msgspec.structs import replace

from gemelo.schemas.joints import JointState
from gemelo.schemas.ledger import StoppingDistance
from gemelo.schemas.message import Message
from gemelo.schemas.topics import (
    GRIPPER_STATE,
    JOINT_COMMANDS,
    JOINT_STATES,
    SENSORS,
    STEP_ERRORS,
    STEP_LEDGER,
    STOPPING_DISTANCE,
    Topic,
)
from gemelo.services.stepper_gateway.device.frame_handler import SHORTEST
from gemelo.services.stepper_gateway.device.rest_thinner import NEWCOMER, RestingTopics, RestThinner
from gemelo.services.stepper_gateway.links.frames import StateFrame
from gemelo.services.stepper_gateway.moment import Moment
from gemelo.services.stepper_gateway.motion.path_version import PathPoint
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.gateway_driver import NewcomerInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

THERE = PathPoint((7.0,), (0.0,))
READINGS = (SENSORS, GRIPPER_STATE, STEP_LEDGER, STOPPING_DISTANCE, JOINT_COMMANDS, STEP_ERRORS)


def frame(number: int, **other: object) -> StateFrame:
    """The one after `number` periods of 20 ms."""
    return StateFrame(t_us=20_000 * number, **{"mode": 3, "steps": (7,), "velocity": (0.0,), **other})


def passed(frames: list[StateFrame], points: dict[int, PathPoint] | None = None, longest: float = 0.1) -> list[int]:
    thinner = RestThinner(SHORTEST)
    return [
        state.t_us // 20_000
        for number, state in enumerate(frames)
        if thinner.passes((replace(state, t_us=0), (points or {}).get(number, THERE)), state.t_us * 1e-6, longest)
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


def resting(**parameters: float) -> VirtualArm:
    """An arm that has stood still for 3 s."""
    arm = VirtualArm(parameters=GatewayParameters(**parameters))
    arm.ready()
    arm.run(3.0)
    return arm


def sent(arm: VirtualArm, topic: Topic[Message], seconds: float) -> int:
    """How many messages of `topic` come in the next `seconds` [s]."""
    before = len(arm.messages(topic))
    arm.run(seconds)
    return len(arm.messages(topic)) - before


@pytest.mark.parametrize("topic", READINGS, ids=lambda topic: topic.key)
def test_readings_that_are_the_same_come_twice_a_second(topic: Topic[Message]) -> None:
    assert topic.rest_rate == 2.0
    period = 1.0 / (topic.rate or 50.0)
    assert 5.0 / (0.5 + period) - 1 <= sent(resting(), topic, 5.0) <= 5.0 / (0.5 - 0.5 * period) + 1
    assert sent(resting(readings_rest_rate=50.0, rest_rate=50.0), topic, 5.0) >= 4.4 * (topic.rate or 0.0)


def test_a_stamp_and_a_round_trip_that_are_measured_anew_are_no_change() -> None:
    topics, now = RestingTopics(), Moment(1, 100.0)
    one = StoppingDistance(stamp=1, is_known=True, round_trip=0.001)
    assert topics.passes(STOPPING_DISTANCE, one, 2.0, now)
    again = replace(one, stamp=2, round_trip=0.002)
    assert not topics.passes(STOPPING_DISTANCE, again, 2.0, Moment(2, 100.02))
    assert topics.passes(STOPPING_DISTANCE, replace(again, distance=0.1), 2.0, Moment(3, 100.04))


def test_a_node_that_comes_waits_for_no_reading_that_comes_seldom() -> None:
    arm = resting()
    for _ in range(5):
        arm.run(0.27)
        arm.handle(NewcomerInput())
        arm.run(0.03)  # until it has subscribed
        counts = {topic.key: len(arm.messages(topic)) for topic in (STEP_LEDGER, STOPPING_DISTANCE, JOINT_STATES)}
        arm.run(0.081)
        assert all(len(arm.published[key]) > count for key, count in counts.items()), counts


def test_in_motion_the_stopping_distance_comes_at_its_full_rate() -> None:
    arm = resting()
    arm.goal(move(arm.position, tuple(each + 0.2 for each in arm.position)), "there")
    before = len(arm.messages(STOPPING_DISTANCE))
    arm.run(0.5)
    gaps = [(after.stamp - one.stamp) * 1e-9 for one, after in pairwise(arm.messages(STOPPING_DISTANCE)[before:])]
    assert gaps
    assert max(gaps) < 0.125


def test_a_node_that_comes_receives_everything_at_its_full_rate_and_then_the_arm_rests_again() -> None:
    arm = resting()
    arm.handle(NewcomerInput())
    counts = {topic.key: len(arm.messages(topic)) for topic in (JOINT_STATES, *READINGS)}
    arm.run(NEWCOMER)
    for topic in (JOINT_STATES, *READINGS):
        came = len(arm.messages(topic)) - counts[topic.key]
        assert came >= int(0.8 * NEWCOMER * (topic.rate or 0.0)) >= 2, topic.key
    arm.run(1.0)
    assert 9 <= sent(arm, STOPPING_DISTANCE, 5.0) <= 10
