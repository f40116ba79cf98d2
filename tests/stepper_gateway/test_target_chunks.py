"""Targets at times ahead, as a policy's chunk of actions: played, replaced by the next chunk, and refused by name."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.device import DeviceMode, StopKind
from gemelo.schemas.joints import LONGEST_AHEAD, MOST_AHEAD, JointTargets, TargetAhead
from gemelo.schemas.message import Vector
from gemelo.schemas.reasons import because
from gemelo.schemas.topics import DEVICE_EVENTS, STEP_ERRORS
from gemelo.services.stepper_gateway.motion.chunk import Ahead, curve_rates, on_cubic
from gemelo.services.stepper_gateway.motion.reference import Reference
from gemelo.tools.bench.leaders import Signal, person
from gemelo.tools.bench.scenes import parol6
from gemelo.tools.bench.stream_lag import middle
from gemelo.tools.virtual_arm.gateway_driver import TargetsInput
from gemelo.tools.virtual_arm.older_arm import OlderArm
from gemelo.tools.virtual_arm.virtual_arm import VirtualArm, rm1
from tests.stepper_gateway.live import replacements, violations

ARMS = {"rm1": rm1(), "parol6": parol6()}
PERIOD = 1 / 30  # [s] between two actions


def chunk(rig: VirtualArm, base: Vector, signal: Signal, begin: float, count: int, period: float = PERIOD) -> None:
    """Sends `count` actions of the first joint, from `begin` [s] of the signal on."""
    rows = [(base[0] + signal(begin + index * period), *base[1:]) for index in range(count)]
    ahead = tuple(TargetAhead(time=index * period, position=rows[index]) for index in range(1, count))
    names = rig.arm.joint_names
    rig.handle(TargetsInput(JointTargets(stamp=rig.moment.unix, name=names, position=rows[0], ahead=ahead)))


def worst_error(rig: VirtualArm, base: Vector, signal: Signal, seconds: float) -> float:
    """[rad] or [m] of the first joint beside the signal, played 40 ms late, from 0.3 s on."""
    scale = rig.arm.joints[0].steps.per_unit
    track = [row[0] / scale for row in rig.path]
    return max(abs(track[ms] - base[0] - signal(ms * 1e-3 - 0.04)) for ms in range(300, round(seconds * 1e3)))


@pytest.mark.parametrize("name", ARMS)
def test_a_policy_s_chunks_are_played_as_one_motion(name: str) -> None:
    arm = ARMS[name]
    rig = VirtualArm(arm=arm, start=middle(arm)).ready()
    signal, base = person(arm.joints[0], 5, 6.0, 0.6), rig.position
    rig.path.clear()
    for index in range(5):  # a chunk of 1.6 s every second: 0.6 s of each are replaced
        chunk(rig, base, signal, float(index), 48)
        rig.run(1.0)
    largest = max(abs(signal(0.01 * k)) for k in range(500))
    assert worst_error(rig, base, signal, 4.9) < 0.04 * largest
    assert not violations(rig, rig.path)
    assert max(abs(error) for message in rig.messages(STEP_ERRORS) for error in message.error) <= 0.5 + 1 / 256
    assert replacements(rig) > 70


@pytest.mark.parametrize("name", ARMS)
def test_a_chunk_is_played_to_its_end_and_the_stream_ends_there(name: str) -> None:
    arm = ARMS[name]
    rig = VirtualArm(arm=arm, start=middle(arm)).ready()
    base = rig.position
    chunk(rig, base, lambda t: 0.1 * t, 0.0, 60)
    assert rig.run(1.0, lambda: rig.device.mode is DeviceMode.RUN)
    assert rig.run(4.0, lambda: rig.device.mode is DeviceMode.IDLE)
    assert rig.now > 59 * PERIOD + 0.5
    assert rig.position[0] == pytest.approx(base[0] + 0.1 * 59 * PERIOD, abs=0.51 * arm.joints[0].steps.resolution)
    assert not violations(rig, rig.path)


def test_what_is_not_due_of_a_chunk_counts_no_more_once_the_next_one_comes() -> None:
    rig = VirtualArm(start=middle(rm1())).ready()
    base = rig.position
    chunk(rig, base, lambda t: 0.2 * t, 0.0, 90)
    rig.run(0.5)
    chunk(rig, base, lambda t: 0.1 - 0.1 * t, 0.0, 30)
    rig.run(3.0)
    assert max(row[0] for row in rig.path) / rig.arm.joints[0].steps.per_unit < base[0] + 0.13
    assert rig.position[0] == pytest.approx(base[0] + 0.1 - 0.1 * 29 * PERIOD, abs=0.001)


def test_single_targets_may_follow_a_chunk_and_end_it() -> None:
    rig = VirtualArm(start=middle(rm1())).ready()
    base = rig.position
    chunk(rig, base, lambda t: 0.2 * t, 0.0, 90)
    rig.run(0.5)
    for _ in range(60):
        rig.target(brazo_joint=base[0])
        rig.run(PERIOD)
    assert rig.position[0] == pytest.approx(base[0], abs=0.51 * rm1().joints[0].steps.resolution)
    assert not violations(rig, rig.path)


def test_after_a_stop_the_rest_of_a_chunk_and_the_chunks_after_it_move_nothing() -> None:
    rig = VirtualArm(start=middle(rm1())).ready()
    base = rig.position
    chunk(rig, base, lambda t: 0.1 * t, 0.0, 60)
    rig.run(0.6)
    rig.ask(StopKind.STOP)
    rig.run(0.4)
    rested = rig.device.steps
    for index in range(1, 4):  # 1 s apart, which is longer than the silence of a stream of single targets
        chunk(rig, base, lambda t: 0.1 * t, float(index), 60)
        rig.run(1.0)
    assert rig.device.steps == rested
    rig.run(2.0)
    chunk(rig, rig.position, lambda t: -0.1 * t, 0.0, 30)
    rig.run(1.5)
    assert rig.device.steps != rested


def test_a_device_that_cannot_replace_goes_by_a_chunk_too() -> None:
    rig = OlderArm().ready()
    base = rig.position
    chunk(rig, base, lambda t: 0.1 * t, 0.0, 60)
    rig.run(1.5)
    assert base[0] + 0.05 < rig.position[0] < base[0] + 0.16
    rig.run(2.5)
    assert rig.position[0] == pytest.approx(base[0] + 0.1 * 59 * PERIOD, abs=0.01)
    assert replacements(rig) == 0


def test_a_gateway_that_dies_in_a_chunk_leaves_an_arm_that_stops() -> None:
    rig = VirtualArm(start=middle(rm1())).ready()
    chunk(rig, rig.position, lambda t: 0.2 * t, 0.0, 90)
    rig.run(0.7)
    rig.lost = {"hb", "traj"}
    rig.run(1.5)
    rested = rig.device.steps
    rig.run(0.5)
    assert rig.device.steps == rested
    assert not violations(rig, rig.path)


def test_joints_that_a_chunk_does_not_name_stand() -> None:
    rig = VirtualArm(start=middle(rm1())).ready()
    base = rig.position
    ahead = tuple(TargetAhead(time=0.1 * index, position=(base[1] + 0.01 * index,)) for index in range(1, 11))
    name = (rig.arm.joint_names[1],)
    rig.handle(TargetsInput(JointTargets(stamp=rig.moment.unix, name=name, position=base[1:2], ahead=ahead)))
    rig.run(2.5)
    assert rig.position[1] == pytest.approx(base[1] + 0.1, abs=rig.arm.joints[1].steps.resolution)
    assert (rig.position[0], rig.position[2]) == (base[0], base[2])


def at(position: Vector = (0.1,), time: float = 0.1, velocity: Vector = ()) -> TargetAhead:
    return TargetAhead(time=time, position=position, velocity=velocity)


COUNT = {"named": 1, "given": 2}
REFUSED = {
    "too many": (tuple(at(time=0.01 * k) for k in range(1, MOST_AHEAD + 2)),
                 because("target.ahead.many", count=MOST_AHEAD + 1, limit=MOST_AHEAD)),
    "not after the first": ((at(time=0.0),), "target.ahead.apart"),
    "not by their times": ((at(time=0.2), at(time=0.1)), "target.ahead.apart"),
    "too far ahead": ((at(time=LONGEST_AHEAD + 0.1),), "target.ahead.late"),
    "positions": ((at((0.1, 0.2)),), because("target.ahead.at", because("target.positions.count", **COUNT),
                                             point=1, time=0.1)),
    "velocities": ((at(velocity=(0.1, 0.2)),), because("target.ahead.at", because("target.velocities.count", **COUNT),
                                                       point=1, time=0.1)),
    "beyond a limit": ((at(), at((9.0,), 0.2)), "goal.limit.position"),
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_played_is_refused_by_name(what: str) -> None:
    ahead, why = REFUSED[what]
    rig = VirtualArm().ready()
    rig.handle(TargetsInput(JointTargets(stamp=rig.moment.unix, name=("brazo_joint",), position=(0.1,), ahead=ahead)))
    rig.run(0.5)
    event = rig.messages(DEVICE_EVENTS)[-1]
    assert event.event == "target_refused"
    if isinstance(why, str):
        assert event.why is not None
        assert event.why.code == "target.ahead.at"
        assert event.why.causes[0].code == why
    else:
        assert event.why == why
    assert rig.device.steps == (0, 0, 0)


@given(st.lists(st.tuples(st.floats(0.001, 0.5), st.floats(-2.0, 2.0)), min_size=2, max_size=20))
def test_the_curve_through_targets_goes_beyond_none_of_two_neighbours(rows: list[tuple[float, float]]) -> None:
    times = [sum(gap for gap, _ in rows[:index]) for index in range(1, len(rows) + 1)]
    values = [value for _, value in rows]
    rates = curve_rates(times, values)
    for index in range(len(rows) - 1):
        span, ends = times[index + 1] - times[index], (rates[index], rates[index + 1])
        low, high = sorted(values[index : index + 2])
        for share in (0.0, 0.2, 0.5, 0.8, 1.0):
            place, rate = on_cubic(values[index], values[index + 1], ends, span, share)
            assert low - 1e-9 <= place <= high + 1e-9
            assert rate * (values[index + 1] - values[index]) >= -1e-9


def test_a_chunk_s_reference_is_its_own_velocity_s_integral_and_is_not_extrapolated() -> None:
    reference = Reference(rm1().joints)
    ahead = [Ahead(0.1 * k, (0.1 * math.sin(0.5 * k), 0.0, 0.1), ()) for k in range(1, 9)]
    assert reference.take(10.0, (0.0, 0.0, 0.1), (), ahead)
    for index in range(80):
        t, dt = 10.0 + 0.01 * index, 1e-5
        (before, after), (_, rate) = (reference.at(t + s * dt, 0.0)[0][0] for s in (0, 1)), reference.at(t, 0.0)
        assert (after - before) / dt == pytest.approx(rate[0], abs=1e-3)
    assert reference.at(12.0, 0.0) == ((ahead[-1].position), (0.0, 0.0, 0.0))


def test_a_chunk_whose_sender_was_overtaken_changes_nothing() -> None:
    reference = Reference(rm1().joints)
    row = (0.0, 0.0, 0.1)
    assert reference.take(10.0, row, (), [Ahead(1.0, (0.3, 0.0, 0.1), ())])
    assert not reference.take(9.95, row, (), [Ahead(0.5, (0.1, 0.0, 0.1), ())])
    assert reference.newest == (0.3, 0.0, 0.1)
    assert reference.due(10.5)[0] == pytest.approx(reference.at(10.5, 0.0)[0][0])
    assert 0.0 < reference.due(10.5)[0] < 0.3
