"""States that repeat the one before: the core is given few of them, and lacks nothing that any of them says."""

from __future__ import annotations

from itertools import pairwise

import pytest

from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import JOINT_STATES
from gemelo.services.stepper_gateway.inputs import FrameInput, Input, Reply, StepInput
from gemelo.services.stepper_gateway.links.connection import ReceiveQueue
from gemelo.services.stepper_gateway.links.frames import StateFrame, encode
from gemelo.services.stepper_gateway.links.link import Kind, Received
from gemelo.services.stepper_gateway.links.repeated_states import HELD, Repetition, StateSieve
from gemelo.services.stepper_gateway.parameters import GatewayParameters
from gemelo.tools.virtual_arm.gateway_driver import NewcomerInput
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm
from tests.stepper_gateway.harness import move

PERIOD = 20_000_000  # [ns] of the device


def state(number: int, **other: object) -> Received:
    """The one after `number` periods."""
    frame = StateFrame(**{"boot_id": 7, "t_us": 20_000 * number, "mode": 3, "steps": (9,), "velocity": (0.0,), **other})
    return Received(Kind.STATE, encode(frame), False, PERIOD * number)


class SievedArm(VirtualArm):
    """The core is given what the shell gives it; `given` are the times [s] of its states."""

    def __init__(self, parameters: GatewayParameters | None = None) -> None:
        self.sieve, self.given = StateSieve(), list[float]()
        super().__init__(parameters=parameters)

    def handle(self, given: Input) -> Reply:
        if isinstance(given, StepInput):
            reply = super().handle(given)
            for held in self.sieve.release(round(self.moment.monotonic * 1e9)):
                self._take(held)
            return reply
        if not isinstance(given, FrameInput):
            return super().handle(given)
        received = Received(given.kind, given.payload, given.retained, given.arrival)
        for each in self.sieve.sift(received, lambda t_us: self.core.is_state_due(t_us, self.moment)):
            self._take(each)
        return None

    def _take(self, received: Received) -> None:
        if received.kind is Kind.STATE:
            self.given.append(self.now)
        super().handle(FrameInput(*received))

    def count(self, seconds: float) -> int:
        """How many states the core is given in the next `seconds` [s]."""
        before = len(self.given)
        self.run(seconds)
        return len(self.given) - before


def resting(parameters: GatewayParameters | None = None) -> SievedArm:
    arm = SievedArm(parameters)
    arm.ready()
    arm.run(3.0)
    return arm


@pytest.mark.parametrize(
    "other", [{"steps": (8,)}, {"mode": 4}, {"refused": 1}, {"boot_id": 8}, {"velocity": (0.5,)}, {"flags": 0}]
)
def test_only_time_and_checksum_may_differ_in_a_repeated_state(other: dict[str, object]) -> None:
    repetition = Repetition()
    assert not repetition.is_in(state(0))
    assert repetition.is_in(state(1))
    assert not repetition.is_in(state(2, **other))
    assert repetition.is_in(state(3, **other))
    assert not repetition.is_in(state(4))


def test_what_fails_its_checksum_or_is_retained_is_no_repeated_state_and_other_frames_change_nothing() -> None:
    repetition = Repetition()
    repetition.is_in(state(0))
    assert not repetition.is_in(Received(Kind.SENSORS, state(1).payload, False, 1))
    assert repetition.is_in(state(1))
    assert not repetition.is_in(Received(Kind.STATE, state(2).payload, True, 1))
    repetition.is_in(state(3))
    broken = bytearray(state(4).payload)
    broken[9] ^= 1
    assert not repetition.is_in(Received(Kind.STATE, bytes(broken), False, 1))
    for junk in (b"", b"nonsense", state(5).payload[:40]):
        assert not repetition.is_in(Received(Kind.STATE, junk, False, 1))


def test_the_loop_is_woken_for_all_but_repeated_states_and_receives_these_too() -> None:
    woken: list[int] = []
    queue = ReceiveQueue(lambda: woken.append(1))
    sent = [
        state(0),
        state(1),
        state(2),
        state(3, steps=(8,)),
        state(4, steps=(8,)),
        state(5)._replace(kind=Kind.EVENT),
    ]
    for each, count in zip(sent, (1, 1, 1, 2, 2, 3), strict=True):
        queue.put(each)
        assert len(woken) == count
    assert queue.take(16) == sent


def test_before_what_differs_comes_the_last_state_that_was_left_out() -> None:
    sieve = StateSieve()
    assert sieve.sift(state(0), lambda _: False) == [state(0)]
    assert sieve.sift(state(1), lambda _: False) == sieve.sift(state(2), lambda _: False) == []
    assert sieve.sift(state(3, steps=(8,)), lambda _: False) == [state(2), state(3, steps=(8,))]
    assert sieve.sift(state(4, steps=(8,)), lambda t_us: t_us == 80_000) == [state(4, steps=(8,))]


@pytest.mark.parametrize("kind", [Kind.CMD_ACK, Kind.TRAJ_ACK, Kind.EVENT, Kind.STATUS, Kind.CONFIG_ACK])
def test_what_was_before_an_answer_is_not_given_after_it(kind: Kind) -> None:
    """Else a path that was resumed would be held by somebody else at once: the state of before says so."""
    sieve, answer = StateSieve(), Received(kind, b"answer", False, 3 * PERIOD)
    assert sieve.sift(state(0), lambda _: False) == [state(0)]
    assert sieve.sift(state(1), lambda _: False) == []
    assert sieve.sift(answer, lambda _: False) == [state(1), answer]
    assert sieve.sift(state(4, mode=4), lambda _: False) == [state(4, mode=4)]


def test_readings_between_repeated_states_give_the_core_no_more_of_these() -> None:
    sieve, readings = StateSieve(), Received(Kind.SENSORS, b"readings", False, 2 * PERIOD)
    sieve.sift(state(0), lambda _: False)
    sieve.sift(state(1), lambda _: False)
    assert sieve.sift(readings, lambda _: False) == [readings]
    assert sieve.sift(state(3, mode=4), lambda _: False) == [state(1), state(3, mode=4)]


def test_the_last_state_before_a_silence_is_not_lost() -> None:
    sieve = StateSieve()
    sieve.sift(state(0), lambda _: False)
    sieve.sift(state(1), lambda _: False)
    assert sieve.release(PERIOD + HELD - 1) == []
    assert sieve.release(PERIOD + HELD) == [state(1)]
    assert sieve.release(PERIOD + HELD) == []


def test_at_rest_the_core_is_given_ten_states_a_second_and_publishes_them_as_before() -> None:
    arm = resting()
    assert 9 * 5 <= arm.count(5.0) <= 11 * 5
    states: list[JointState] = arm.messages(JOINT_STATES)
    assert max((after.stamp - one.stamp) * 1e-9 for one, after in pairwise(states[-50:])) < 0.125


def test_in_motion_and_for_a_node_that_has_come_the_core_is_given_all() -> None:
    arm = resting()
    assert arm.goal(move(arm.position, tuple(each + 0.2 for each in arm.position)), "there").accepted
    assert arm.count(1.0) >= 49
    arm.run(3.0)
    arm.handle(NewcomerInput())
    assert arm.count(0.5) >= 24


def test_one_who_wants_all_states_at_rest_gets_them() -> None:
    assert resting(GatewayParameters(rest_rate=50.0)).count(2.0) >= 99


@pytest.mark.parametrize("timeout", [0.1, 0.5])
def test_a_device_that_falls_silent_at_rest_is_offline_after_its_time_and_not_before(timeout: float) -> None:
    arm = resting(GatewayParameters(state_timeout=timeout))
    for _ in range(5):
        arm.run(0.03)
        assert not arm.reason_not_ready
    arm.device_is_on = False
    arm.run(timeout - 0.03)
    assert not arm.reason_not_ready
    arm.run(0.06)
    assert arm.reason_not_ready
    arm.device_is_on = True
    arm.run(0.5)
    assert not arm.reason_not_ready
