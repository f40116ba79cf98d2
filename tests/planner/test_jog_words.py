"""The status of a jogged arm: what slows it, with its figures, and the device's own reason to stand still."""

from __future__ import annotations

import math

import numpy as np
import pytest

from gemelo.schemas.joints import JointState
from gemelo.schemas.planning import JogCommand, JogLimit
from gemelo.schemas.reasons import Reason, because, plain
from gemelo.services.planner.collision.clearance import CLEARANCE
from gemelo.services.planner.jog.jog import PERIOD, SILENCE, Jog
from tests.planner.jogging import Jogged, arm_of, kinematics_of, world_of

TURN = JogCommand(name=("brazo_joint",), velocity=(0.5,))
FAULT = plain('device "rm1" has a fault: LIMIT_SWITCH at joint "antebrazo_joint": its limit switch was pressed')


def last_limit(jogged: Jogged, check: str) -> JogLimit:
    found = [limit for status in jogged.statuses for limit in status.limits if limit.check == check]
    assert found, jogged.limits()
    return found[-1]


def test_a_joint_limit_is_said_with_its_value_in_degrees() -> None:
    jogged = Jogged("rm1", crowded=False)
    joint = jogged.arm.joint("brazo_joint")
    jogged.hold(JogCommand(name=("brazo_joint",), velocity=(joint.velocity,)), 4.0)
    limit = last_limit(jogged, "joint limit")
    assert (limit.subject, limit.limit) == ("brazo_joint", joint.upper)
    assert limit.value == pytest.approx(joint.upper, abs=0.01)
    assert jogged.statuses[-1].limits[0].why == because("jog.limit.turning", joint="brazo_joint", limit=joint.upper)
    assert jogged.statuses[-1].limited_by == f"joint limit of brazo_joint ({math.degrees(joint.upper):.4g} deg)"


def test_an_obstacle_is_said_with_the_pair_and_how_far_they_are_apart() -> None:
    jogged = Jogged("rm1", start="home")
    jogged.hold(JogCommand(name=("brazo_joint",), velocity=(0.4,)), 4.0)
    limit = last_limit(jogged, "collision")
    assert limit.subject.endswith(" and post")
    assert limit.value == pytest.approx(jogged.world.distance(jogged.commanded[-1]), abs=1e-4)
    assert limit.limit == CLEARANCE
    first, second = limit.subject.split(" and ")
    figures = {"distance": limit.value, "limit": CLEARANCE}
    assert limit.why == because("jog.limit.collision", first=first, second=second, **figures)
    assert limit.message == str(limit.why)


def test_a_singularity_is_said_with_the_manipulability() -> None:
    jogged = Jogged("rm1", crowded=False)
    out = jogged.kinematics.tool(jogged.tracker.knot.position).position
    away = np.array([out[0], out[1], 0.0]) / np.linalg.norm(out[:2])
    jogged.hold(JogCommand(linear=tuple(0.08 * away)), 6.0)
    limit = last_limit(jogged, "singularity")
    assert limit.value is not None
    assert 0.0 < limit.value < 1.0
    assert limit.why == because("jog.limit.singular", share=limit.value)


class Watched:
    """A jog of an arm that stands wherever it is led to, unless its device is hindered."""

    def __init__(self) -> None:
        self.jog = Jog(arm_of("rm1"), kinematics_of("rm1"), world_of("rm1", crowded=False))
        self.now, self.said = 0.0, list[str]()
        names = arm_of("rm1").joint_names
        self.state = JointState(name=names, position=arm_of("rm1").named_states["ready"], velocity=(0.0,) * len(names))

    def hold(self, command: JogCommand | None, seconds: float, not_ready: Reason | None = None) -> None:
        for _ in range(round(seconds / PERIOD)):
            if command is not None:
                self.jog.on_command(command, self.now)
            output = self.jog.step(self.now, 0, self.state, 0.0, goal_is_active=False, not_ready=not_ready)
            self.said += [output.status.limited_by] if output.status is not None else []
            if self.jog.commanded is not None and not_ready is None:
                position = tuple(self.jog.commanded[0].tolist())
                self.state = JointState(name=self.state.name, position=position, velocity=(0.0,) * len(position))
            self.now += PERIOD


def test_an_arm_whose_device_has_a_fault_is_not_jogged_and_says_which() -> None:
    watched = Watched()
    watched.hold(TURN, 0.2, FAULT)
    assert watched.jog.commanded is None
    assert set(watched.said) == {str(FAULT)}
    watched.hold(TURN, 0.2)
    assert watched.jog.commanded is not None


def test_a_fault_ends_a_jog_with_its_own_reason_and_nothing_resumes_by_itself() -> None:
    watched = Watched()
    watched.hold(TURN, 0.4)
    watched.hold(TURN, 0.4, FAULT)
    assert watched.jog.commanded is None
    assert watched.said[-1] == str(FAULT)
    watched.hold(TURN, 0.4)
    assert watched.jog.commanded is None
    assert "jogging was interrupted" in watched.said[-1]
    assert "LIMIT_SWITCH" in watched.said[-1]
    watched.hold(None, SILENCE + PERIOD)
    watched.hold(TURN, 0.4)
    assert watched.jog.commanded is not None
