"""A CAD part of ten megabytes, a path of ten thousand points and a goal of fifty thousand on the real processes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.libraries.runtime.endpoints import info_request
from gemelo.schemas.actions import GoalStatusCode
from gemelo.schemas.motion import FollowJointTrajectoryGoal, JointTrajectory, TrajectoryPoint
from gemelo.schemas.scene import MeshShape, SceneMesh
from gemelo.schemas.system import Empty
from gemelo.schemas.topics import FOLLOW_JOINT_TRAJECTORY, scene_mesh
from gemelo.tools.stack.stack import Stack
from tests.simulation.test_large_scenes import tube
from tests.stack import gemelo as command

pytestmark = pytest.mark.alone  # ten megabytes pass through every link of two cores
SERVICES = ("stepper_gateway", "planner", "state_publisher", "logger")


@pytest.fixture(autouse=True)
def every_process_stays(arm: gemelo.Arm) -> Iterator[None]:
    """None of them has ended and begun anew."""

    def processes() -> dict[str, int]:
        return {name: arm.node.call(info_request(name), Empty(), timeout=10.0).pid for name in SERVICES}

    before = processes()
    yield
    assert processes() == before


def test_a_part_of_ten_megabytes_is_in_the_scene_and_every_node_has_its_file(
    stack: Stack, arm: gemelo.Arm, tmp_path: Path
) -> None:
    file = tube(tmp_path / "part.stl", 10_000_000)
    arm.move(named="ready")
    with arm.scene.restored():
        arm.scene.add_mesh("part", file, at=(2.0, 0.0, 0.0))
        arm.scene.move("part", (2.0, 0.1, 0.0))
        listed = command.gemelo(stack, "scene", "list")
        assert f"mesh of {file.stat().st_size} bytes" in listed
        shape = arm.scene.objects["part"].shape
        assert isinstance(shape, MeshShape)
        late: list[SceneMesh] = []
        subscription = arm.node.subscribe(scene_mesh(shape.digest), late.append)
        assert arm.wait_for(lambda: bool(late), 20.0)
        subscription.close()
        assert late[0].data == file.read_bytes()
        arm.scene.add_mesh("near", file, at=arm.pose().position)
        with pytest.raises(gemelo.Refused, match="near"):
            arm.plan(named="left", allowed_time=60.0)
        arm.scene.remove("near")
        assert arm.move(named="left", allowed_time=60.0).status is GoalStatusCode.SUCCEEDED
    assert "part" not in command.gemelo(stack, "scene", "list")


def test_a_path_of_ten_thousand_points_is_planned_and_begun(arm: gemelo.Arm) -> None:
    arm.move(named="ready")
    name, here = arm.joint_names[1], arm.joints
    points = [{name: here[name] + 0.2 * math.sin(index / 50)} for index in range(10_000)]
    plan = arm.plan(joints=points[-1], via=tuple(points[:-1]))
    assert len(plan.trajectory.points) > 10_000
    motion = arm.start(plan)
    assert arm.wait_for(lambda: abs(arm.joints[name] - here[name]) > 0.01, 60.0)
    motion.cancel()
    assert motion.wait(60.0).status is GoalStatusCode.CANCELED


def test_a_raw_goal_of_fifty_thousand_points_is_taken_and_begun(arm: gemelo.Arm) -> None:
    arm.move(named="ready")
    here, last = arm.joints, arm.joint_names[-1]
    rate = 2.0 * math.pi / 1000.0  # [rad/s] one wave in all

    def point(index: int) -> TrajectoryPoint:
        t = 0.02 * index
        off = 0.03 * (1.0 - math.cos(rate * t))
        position = tuple(here[name] - off * (name == last) for name in arm.joint_names)
        return TrajectoryPoint(positions=position, time_from_start=1.0 + t)  # from where it stands to the first

    trajectory = JointTrajectory(joint_names=arm.joint_names, points=tuple(map(point, range(50_000))))
    client = arm.node.action(FOLLOW_JOINT_TRAJECTORY)
    handle = client.send(FollowJointTrajectoryGoal(trajectory=trajectory), attached=True)
    assert arm.wait_for(lambda: here[last] - arm.joints[last] > 1e-4, 120.0)
    handle.cancel()
    assert arm.wait_for(lambda: arm.device.mode is not gemelo.DeviceMode.RUN, 20.0)
