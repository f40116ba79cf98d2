"""Streamed poses of the tool on a simulated twin: followed with the lag of streamed joints, refused out of reach."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.schemas.message import Vector
from tests.simulated import is_moving, make_ready

PERIOD = 1 / 30  # [s]


@pytest.fixture(scope="module", params=["rm1", "parol6"])
def twin(request: pytest.FixtureRequest) -> Iterator[SimulatedArm]:
    with gemelo.simulate(request.param) as arm:
        yield arm


def rest_at_ready(arm: SimulatedArm) -> None:
    make_ready(arm)
    arm.sim.sleep(1.0)  # no stream of before goes on
    arm.move(named="ready")


def lead_up(arm: SimulatedArm, seconds: float) -> None:
    x, y, z = arm.pose().position
    for index in range(round(seconds / PERIOD)):
        arm.stream(pose=(x, y, z + 0.2 * PERIOD * index))
        arm.sim.sleep(PERIOD)


def test_the_tool_follows_streamed_poses_with_little_lag(twin: SimulatedArm) -> None:
    rest_at_ready(twin)
    pose = twin.pose()
    targets: list[Vector] = []
    tools: list[Vector] = []
    for index in range(150):
        t = index * PERIOD
        offset = (0.0, 0.02 * (1.0 - math.cos(1.2 * t)), 0.01 * math.sin(1.2 * t))
        status = twin.stream(pose=pose.offset(*offset) if len(twin.joints) == 6 else pose.offset(*offset).position)
        assert status is None or not status.limits
        targets.append(pose.offset(*offset).position)
        twin.sim.sleep(PERIOD)
        tools.append(twin.pose().position)
    late = [np.linalg.norm(np.array(tools[shift + 30 :]) - np.array(targets[30 : len(tools) - shift]), axis=1).mean()
            for shift in range(6)]  # fmt: skip
    assert min(late) < 0.001  # a step of rm1 is 5 mm there
    assert int(np.argmin(late)) <= 2  # targets of 30 Hz: the first tool pose is read a period after its target


def test_a_pose_out_of_reach_is_refused_by_name_and_the_stream_goes_on(twin: SimulatedArm) -> None:
    rest_at_ready(twin)
    x, y, z = twin.pose().position
    with pytest.raises(gemelo.Refused, match="out of reach") as refused:
        lead_up(twin, 10.0)
    assert refused.value.reason.code == "jog.limit.reach"
    for _ in range(150):
        twin.stream(pose=(x, y, z))
        twin.sim.sleep(PERIOD)
    assert twin.pose().position == pytest.approx((x, y, z), abs=0.002)
    assert twin.wait_for(lambda: not is_moving(twin), 5.0)


def test_after_a_stop_poses_that_go_on_move_nothing_and_say_so(twin: SimulatedArm) -> None:
    rest_at_ready(twin)
    x, y, z = twin.pose().position
    for index in range(20):
        twin.stream(pose=(x, y, z - 0.02 * PERIOD * index))
        twin.sim.sleep(PERIOD)
    twin.stop()
    refusals, places = [], []
    for index in range(20, 80):
        try:
            twin.stream(pose=(x, y, z - 0.02 * PERIOD * index))
        except gemelo.Refused as refused:
            refusals.append(refused.reason.code)
        twin.sim.sleep(PERIOD)
        places.append(tuple(twin.joints.values()))
    assert refusals
    assert set(refusals) == {"target.interrupted", "target.and_more"}
    assert places[-1] == pytest.approx(places[30], abs=1e-9)
    assert twin.wait_for(lambda: not is_moving(twin), 5.0)
    twin.sim.sleep(1.0)


def test_a_pose_is_streamed_alone(twin: SimulatedArm) -> None:
    with pytest.raises(gemelo.BadArgument, match="streamed alone"):
        twin.stream({twin.description.joint_names[0]: 0.0}, pose=(0.2, 0.0, 0.2))
    with pytest.raises(gemelo.BadArgument, match="none is given"):
        twin.stream()
    with pytest.raises(gemelo.BadArgument, match="millimetres"):
        twin.stream(pose=(200.0, 0.0, 200.0))


def test_what_stands_in_the_way_of_streamed_targets_and_poses_is_named_and_not_touched(twin: SimulatedArm) -> None:
    rest_at_ready(twin)
    joint = twin.description.joint_names[0]
    begin = twin.joints[joint]
    x, y, _ = twin.fk({**twin.joints, joint: begin + 0.5}).position
    twin.scene.add_box("post", size=(0.04, 0.04, 0.6), at=(x, y, 0.3))
    said: set[str] = set()
    for index in range(120):
        status = twin.stream({joint: begin + min(0.8, 0.3 * PERIOD * index)})
        said |= set() if status is None or status.why is None else {status.why.code}
        twin.sim.sleep(PERIOD)
    assert said == {"target.obstructed"}
    assert twin.joints[joint] < begin + 0.5
    rest_at_ready(twin)  # nothing is touched: a plan leads away
    twin.scene.clear()
