"""Several arms in one script: two twins of different arms, each found by its deployment file."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

import gemelo
from services.stack.stack import Stack
from tests.gemelo.conftest import make_ready
from tests.stacks.shared import BROKER, NEEDED

pytestmark = pytest.mark.full

ROBOTS = ("rm1", "parol6")


@pytest.fixture(scope="module")
def deployments(tmp_path_factory: pytest.TempPathFactory) -> Iterator[list[Path]]:
    """The deployment file of each twin."""
    with ExitStack() as running:
        files = []
        for robot in ROBOTS:
            folder = tmp_path_factory.mktemp(robot)
            environment = {"GEMELO_ROBOT": f"urdf/{robot}"}
            stack = running.enter_context(Stack(broker=BROKER, out=folder, processes=NEEDED, environment=environment))
            files.append(folder / "deployment.toml")
            port = stack.deployment["GEMELO_ROUTER_PORT"]
            files[-1].write_text(f'robot = "urdf/{robot}"\n\n[router]\nport = {port}\n')
        yield files


def test_two_arms_move_at_once_in_one_script(deployments: list[Path], monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("GEMELO_ROBOT", "GEMELO_ROUTER_PORT", "GEMELO_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    with (
        gemelo.connect(deployment=deployments[0], timeout=10.0) as first,
        gemelo.connect(deployment=str(deployments[1]), timeout=10.0) as second,
    ):
        assert (first.name, second.name) == ROBOTS
        for arm in (first, second):
            make_ready(arm)
        motions = [arm.start(named="left", speed=0.5) for arm in (first, second)]
        assert not any(motion.is_over for motion in motions)
        for arm, motion in zip((first, second), motions, strict=True):
            assert motion.wait().status is gemelo.GoalStatusCode.SUCCEEDED
            assert arm.joints == pytest.approx(motion.stopped_at, abs=1e-9)
            for joint in arm.description.joints:
                goal = arm.states["left"][joint.name]
                assert abs(arm.joints[joint.name] - goal) <= 0.501 / joint.steps.per_unit


def test_an_offset_keeps_the_orientation_where_an_arm_can_turn_its_tool(
    deployments: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("GEMELO_ROBOT", "GEMELO_ROUTER_PORT", "GEMELO_CONFIG"):
        monkeypatch.delenv(name, raising=False)
    with gemelo.connect("parol6", deployment=deployments[1], timeout=10.0) as arm:
        make_ready(arm)
        arm.move(named="ready")
        before = arm.pose()
        arm.line(offset=(0.0, 0.0, 0.02), speed=0.05)
        after = arm.pose()
    assert after.position == pytest.approx(before.offset(z=0.02).position, abs=5e-4)
    assert abs(sum(a * b for a, b in zip(before.orientation, after.orientation, strict=True))) > 0.9999
