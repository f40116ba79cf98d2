"""Streamed poses: the nearest configuration at each, slowed near singularities and limits, named beyond reach."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gemelo.schemas.planning import JogLimit, PoseTarget
from gemelo.services.planner.jog.pose_stream import BadPose, PoseStream, require_pose
from tests.planner.jogging import Array, arm_of, kinematics_of
from tests.profiles import examples
from tests.table import table

PERIOD = 1 / 30  # [s]
ARMS = ["rm1", "parol6"]


class Led:
    """One arm led by poses, as if it followed them at once."""

    def __init__(self, name: str) -> None:
        self.arm, self.kinematics = arm_of(name), kinematics_of(name)
        self.stream, self.now = PoseStream(self.kinematics), 1.0
        self.track = [np.array(self.arm.named_states["ready"])]
        self.begin = self.kinematics.tool(self.track[0])
        self.limits: list[JogLimit] = []
        self.speeds = np.array([joint.velocity for joint in self.arm.joints])

    def lead(self, offset: Array, orientation: tuple[float, ...] = ()) -> float:
        """[m] that the tool is away from a target (3,) [m] beside where it began."""
        target = self.begin.position + offset
        posed = self.stream.take(
            PoseTarget(position=tuple(target.tolist()), orientation=orientation), tuple(self.track[-1]), self.now
        )
        self.track.append(np.array(posed.position))
        self.limits = list(posed.limits)
        self.now += PERIOD
        return float(np.linalg.norm(self.kinematics.tool(self.track[-1]).position - target))

    @property
    def checks(self) -> set[str]:
        return {limit.check for limit in self.limits}

    def assert_within_limits(self) -> None:
        """Every joint within its travel, and no faster than it can between two targets after the first."""
        track = np.array(self.track)
        assert np.all(np.abs(np.diff(track, axis=0)[1:]) <= PERIOD * self.speeds * (1 + 1e-9))
        for column, joint in enumerate(self.arm.joints):
            assert joint.lower - 1e-9 <= track[:, column].min() <= track[:, column].max() <= joint.upper + 1e-9


def circle(t: float, radius: float = 0.02) -> Array:
    return np.array([0.0, radius * (1.0 - math.cos(1.2 * t)), 0.5 * radius * math.sin(1.2 * t)])


@pytest.mark.parametrize("name", ARMS)
def test_the_tool_is_at_every_pose_that_moves_no_faster_than_the_joints_can(name: str) -> None:
    led = Led(name)
    worst = max(led.lead(circle(PERIOD * index)) for index in range(200))
    assert worst < 1e-5
    assert not led.limits
    led.assert_within_limits()
    if name == "parol6":  # it keeps its orientation
        assert np.allclose(led.kinematics.tool(led.track[-1]).rotation, led.begin.rotation, atol=1e-5)


def test_a_turn_of_the_tool_is_followed_where_the_arm_can_choose_it() -> None:
    led = Led("parol6")
    for index in range(60):
        turned = led.begin.rotation @ pin.exp3(np.array([0.0, 0.005 * index, 0.0]))
        led.lead(np.zeros(3), tuple(pin.Quaternion(turned).coeffs().tolist()))
    assert np.allclose(led.kinematics.tool(led.track[-1]).rotation, turned, atol=1e-5)
    assert led.kinematics.tool(led.track[-1]).position == pytest.approx(led.begin.position, abs=1e-5)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_what_leaves_the_reachable_stands_is_named_and_is_followed_again_when_it_comes_back(
    name: str, axis: int, side: float
) -> None:
    led = Led(name)
    offset, checks = np.zeros(3), set[str]()
    for index in range(300):
        offset[axis] = side * min(1.5, 0.15 * PERIOD * index)
        led.lead(offset)
        checks |= led.checks
    assert "reach" in led.checks
    assert checks & {"singularity", "joint limit"}
    stood = led.track[-1]
    led.lead(offset)
    assert np.max(np.abs(led.track[-1] - stood) / led.speeds) < 0.002
    away = math.inf
    for index in range(600):
        offset[axis] = side * max(0.0, 1.5 - 0.15 * PERIOD * index)
        away = led.lead(offset)
    assert away < 1e-4
    led.assert_within_limits()


@pytest.mark.parametrize("name", ARMS)
@examples(quick=10, full=100)
@given(st.lists(st.tuples(*[st.floats(-0.6, 0.6)] * 3), min_size=1, max_size=6))
def test_wherever_the_targets_jump_the_joints_keep_their_limits(name: str, places: list[tuple[float, ...]]) -> None:
    led = Led(name)
    for place in places:
        for _ in range(12):
            led.lead(np.array(place))
    led.assert_within_limits()


def test_a_new_stream_begins_where_the_arm_is() -> None:
    led = Led("rm1")
    for index in range(30):
        led.lead(circle(PERIOD * index))
    led.now += 1.0
    assert led.stream.begins(led.now)
    elsewhere = tuple(np.array(led.track[0]) + 0.05)
    there = led.kinematics.tool(elsewhere).position
    posed = led.stream.take(PoseTarget(position=tuple(there.tolist())), elsewhere, led.now)
    assert posed.position == pytest.approx(elsewhere, abs=1e-6)


BAD = [
    (PoseTarget(position=(0.1, 0.2)), "jog.command.values"),
    (PoseTarget(position=(0.1, 0.2, 1e9)), "jog.pose.far"),
    (PoseTarget(position=(0.1, 0.2, 0.3), orientation=(0.0, 0.0, 1.0)), "jog.pose.orientation"),
    (PoseTarget(position=(0.1, 0.2, 0.3), orientation=(0.0, 0.0, 0.0, 0.0)), "jog.pose.quaternion"),
]


@table(("pose", "code"), BAD)
def test_what_is_no_pose_is_refused_by_name(pose: PoseTarget, code: str) -> None:
    with pytest.raises(BadPose) as refusal:
        require_pose(pose)
    assert refusal.value.reason.code == code
