"""Streamed targets on the real firmware core: tracked within the limits, braked by silence, refused by name."""

from __future__ import annotations

import math
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.device import DeviceCommandKind, DeviceMode
from gemelo.schemas.joints import JointState
from gemelo.schemas.topics import DEVICE_EVENTS, JOINT_STATES
from gemelo.services.stepper_gateway.motion.knots import Knot, Limits
from gemelo.services.stepper_gateway.motion.target_tracker import TargetTracker
from gemelo.tools.virtual_arm.gateway_driver import TargetsInput
from gemelo.tools.virtual_arm.older_arm import OlderArm
from gemelo.tools.virtual_arm.virtual_arm import UNIX, VirtualArm, rm1
from tests.profiles import examples
from tests.stepper_gateway.harness import assert_within_limits, move


def test_a_10_hz_sine_is_tracked_within_the_limits() -> None:
    rig = VirtualArm().ready()
    begun = rig.now
    sine = {
        "brazo_joint": (0.3, 0.2),
        "antebrazo_joint": (0.4, 0.15),
    }

    def wanted(name: str, t: float) -> float:
        size, rate = sine[name]
        return size * math.sin(2 * math.pi * rate * t)

    while rig.now - begun < 10.0:
        rig.target(**{name: wanted(name, rig.now - begun) for name in sine})
        rig.run(0.1)
    assert_within_limits(rig)
    track = [(m.stamp * 1e-9 - UNIX * 1e-9 - begun, m.position[0]) for m in rig.messages(JOINT_STATES)]
    track = [(t, p) for t, p in track if 2.0 < t < 9.5]
    lags = [i * 0.02 for i in range(60)]
    miss = [max(abs(p - wanted("brazo_joint", t - lag)) for t, p in track) for lag in lags]
    assert lags[miss.index(min(miss))] < 0.8
    assert min(miss) < 0.05


def test_a_target_is_reached_exactly_while_the_stream_lasts() -> None:
    rig = VirtualArm().ready()
    for _ in range(40):
        rig.target(brazo_joint=0.5)
        rig.run(0.1)
    assert rig.device.steps == ((rm1().joints[0].steps.to_q8(0.5) + 128) >> 8, 0, 0)
    assert rig.device.mode == DeviceMode.RUN  # it waits for more targets, at rest
    rig.run(1.5)
    assert rig.device.mode == DeviceMode.IDLE
    assert "underrun" not in rig.events()


def test_a_stream_that_falls_silent_brakes_to_rest_and_does_not_go_on_to_the_stale_target() -> None:
    rig = OlderArm().ready()
    rig.target(brazo_joint=2.5)
    assert rig.run(2.0, lambda: rig.device.mode == DeviceMode.RUN)
    assert rig.run(1.6, lambda: rig.device.mode == DeviceMode.IDLE)
    assert 0.05 < rig.position[0] < 0.8
    rig.run(2.0)
    assert rig.device.mode == DeviceMode.IDLE
    assert_within_limits(rig)


def silenced() -> VirtualArm:
    """An arm that still decelerates after its targets have fallen silent, nearly at rest; by a STOP, as it has no
    replacements."""
    rig = OlderArm().ready()
    while rig.position[0] < 0.1:
        rig.target(brazo_joint=2.5)
        rig.run(0.1)
    assert rig.run(2.0, lambda: rig.device.mode == DeviceMode.HOLD and newest(rig).velocity[0] < 0.05)
    return rig


def newest(rig: VirtualArm) -> JointState:
    return rig.messages(JOINT_STATES)[-1]


def test_a_goal_waits_for_an_arm_that_comes_to_rest_after_its_targets() -> None:
    rig = silenced()
    assert rig.goal(move(newest(rig).position, (0.2, 0.2, 0.05))).accepted
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert rig.position[0] == pytest.approx(0.2, abs=0.001)
    assert_within_limits(rig)


def test_a_persons_stop_of_an_arm_that_comes_to_rest_ends_the_goal_that_waits_and_refuses_others() -> None:
    rig = silenced()
    goal = move(newest(rig).position, (0.2, 0.2, 0.05))
    assert rig.goal(goal).accepted
    rig.command(DeviceCommandKind.STOP)
    assert rig.finish()[0] == GoalStatusCode.ABORTED
    assert "holds" in rig.goal(goal).reason
    assert rig.run(1.0, lambda: rig.device.mode == DeviceMode.IDLE)
    rested = rig.device.steps
    rig.run(1.0)
    assert rig.device.steps == rested


def test_the_stream_begins_again_after_silence() -> None:
    rig = VirtualArm().ready()
    for place in (0.3, -0.2):
        for _ in range(30):
            rig.target(brazo_joint=place)
            rig.run(0.1)
        rig.run(2.0)
        assert rig.position[0] == pytest.approx(place, abs=0.001)


def test_a_target_beyond_a_limit_is_refused_by_name_and_the_one_before_stays() -> None:
    rig = VirtualArm().ready()
    for index in range(40):
        rig.target(brazo_joint=0.2)
        if index > 3:
            rig.target(brazo_joint=3.0)
        rig.run(0.1)
    assert rig.position[0] == pytest.approx(0.2, abs=0.001)
    told = [e for e in rig.messages(DEVICE_EVENTS) if e.event == "target_refused"]
    assert 3 <= len(told) <= 6  # about once a second, not at every target
    assert all(part in told[0].detail for part in ("brazo_joint", "3.0000", "2.95"))


@pytest.mark.parametrize(
    ("names", "positions", "said"),
    [
        (("brazo",), (0.1,), 'did you mean "brazo_joint"'),
        (("brazo_joint", "brazo_joint"), (0.1, 0.2), "named 2 times"),
        (("brazo_joint",), (0.1, 0.2), "2 positions"),
        ((), (), "names no joint"),
    ],
)
def test_a_malformed_target_is_refused_and_nothing_moves(
    names: tuple[str, ...], positions: tuple[float, ...], said: str
) -> None:
    from gemelo.schemas.joints import JointTargets

    rig = VirtualArm().ready()
    rig.handle(TargetsInput(JointTargets(name=names, position=positions)))
    rig.run(1.0)
    assert said in rig.messages(DEVICE_EVENTS)[-1].detail
    assert rig.device.steps == (0, 0, 0)


def test_targets_are_refused_while_a_goal_runs_and_a_goal_takes_over_from_targets() -> None:
    rig = VirtualArm().ready()
    for _ in range(15):
        rig.target(brazo_joint=1.0, antebrazo_joint=-0.5)
        rig.run(0.1)
    assert abs(rig.path[-1][0] - rig.path[-2][0]) > 0.05  # in full motion
    here = rig.messages(JOINT_STATES)[-1].position
    assert rig.goal(move(here, (0.2, 0.2, 0.05))).accepted
    rig.run(0.1)
    rig.target(brazo_joint=-1.0)
    assert "goal" in rig.messages(DEVICE_EVENTS)[-1].detail
    assert rig.finish()[0] == GoalStatusCode.SUCCEEDED
    assert rig.position[0] == pytest.approx(0.2, abs=0.001)
    assert_within_limits(rig)


LIMITS = Limits.of(rm1().joints)
UPPER = (2.95, 2.95, 0.2)
shares = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


@examples(quick=10, full=40)
@given(st.lists(st.tuples(shares, st.integers(1, 60), st.booleans()), min_size=1, max_size=6))
def test_whatever_the_targets_the_tracker_keeps_every_limit(
    program: list[tuple[tuple[float, ...], int, bool]],
) -> None:
    lower = (-2.95, -2.95, 0.0)
    tracker = TargetTracker(LIMITS, 0.02, Knot.at_rest((0.0, 0.0, 0.1)))
    before = tracker.knot
    for share, count, brakes in program:
        target = tuple(lo + (s + 1) / 2 * (hi - lo) for s, lo, hi in zip(share, lower, UPPER, strict=True))
        tracker.follow(target)
        if brakes:
            tracker.brake()
        for _ in range(count):
            knot = tracker.step()
            for i in range(3):
                assert lower[i] - 1e-6 <= knot.position[i] <= UPPER[i] + 1e-6
                assert abs(knot.velocity[i]) <= LIMITS.velocity[i] * (1 + 1e-9)
                assert abs(knot.acceleration[i]) <= LIMITS.acceleration[i] * (1 + 1e-9)
                assert abs(knot.acceleration[i] - before.acceleration[i]) <= LIMITS.jerk[i] * 0.02 * (1 + 1e-6)
            before = knot


ENDS = """
from gemelo.libraries.arm.model.description import load_arm
from gemelo.libraries.runtime.deployment import project_root
from gemelo.libraries.runtime.bus.memory_bus import MemoryBus, MemoryNetwork
from gemelo.libraries.runtime.node import Node
from gemelo.libraries.runtime.process.shutdown import ShutdownRequest
from gemelo.services.stepper_gateway.core import GatewayCore
from gemelo.services.stepper_gateway.motion.knots import Knot
from gemelo.services.stepper_gateway.motion.knots import Limits
from gemelo.services.stepper_gateway.motion.target_tracker import TargetTracker

arm = load_arm(project_root() / "urdf/rm1")
core = GatewayCore(arm, 1)
core.own = core
node = Node("stepper_gateway", robot="rm1", bus=MemoryBus(MemoryNetwork()), stop=ShutdownRequest())

def step(now):
    core.tracker = TargetTracker(Limits.of(arm.joints), 0.02, Knot.at_rest((0.0, 0.0, 0.0)))
    node.stop()

node.spin(step)
node.close()
"""


def test_a_gateway_that_has_streamed_ends_without_a_word_of_leaks() -> None:
    """What ruckig has made lives in circles of the core, which must be collected before the interpreter ends."""
    ended = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, timeout=60.0, check=True)
    assert ended.stderr == ""
