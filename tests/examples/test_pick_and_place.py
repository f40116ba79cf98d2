"""Pick and place through the whole stack, on both arms: to the step, around the post, and tidied up."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from schemas.device import ShaftPositions
from schemas.frames import Transform
from schemas.scene import BoxShape, PlanningScene, SceneAdd, SceneObject, SceneRequest
from schemas.topics import DEVICE_SHAFT, SCENE, SCENE_EDIT, STEP_ERRORS
from services.arm.kinematics.kinematics import Kinematics
from services.stack.stack import Stack
from tests.stack.person import Operator, jumps
from tests.stacks.shared import BROKER

pytestmark = pytest.mark.full

NEEDED = ("router", "broker", "virtual_esp32", "stepper_gateway", "state_publisher", "planner")
LONGEST = 90.0  # [s]
MOVES = ["above the part", "down", "up", "around the post", "down", "up", "home"]
HALF_STEPS = 0.004  # [m] that half a step of every joint may turn the part away, and the tool with it
SHELF = SceneObject(
    name="shelf", shape=BoxShape(size=(0.1, 0.1, 0.1)), pose=Transform(translation=(-0.8, -0.8, 0.3)), padding=0.01
)


@pytest.fixture(scope="module", params=["rm1", "parol6"])
def operator(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Operator]:
    environment, out = {"GEMELO_ROBOT": f"urdf/{request.param}"}, tmp_path_factory.mktemp("out")
    with Stack(broker=BROKER, out=out, processes=NEEDED, environment=environment) as stack:
        person = Operator(stack)
        assert person.node.call(SCENE_EDIT, SceneRequest(edit=SceneAdd(object=SHELF))).accepted
        yield person
        person.close()


def example(operator: Operator) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, Path("examples/09_pick_and_place.py")],
        cwd=operator.stack.root, env=operator.stack.environment, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def is_as_found(scene: PlanningScene) -> bool:
    return scene.objects == (SHELF,) and scene.allowed == ()


def parts(scenes: list[PlanningScene]) -> list[SceneObject]:
    """The part in every version that has it."""
    return [item for scene in scenes for item in scene.objects if item.name == "part"]


def test_the_part_stands_where_it_was_to_go_and_no_step_is_lost(operator: Operator) -> None:
    scenes: list[PlanningScene] = []
    errors: list[float] = []
    shafts: list[ShaftPositions] = []
    operator.node.subscribe(SCENE, scenes.append)
    operator.node.subscribe(STEP_ERRORS, lambda message: errors.append(max(map(abs, message.error))))
    operator.node.subscribe(DEVICE_SHAFT, shafts.append)
    operator.seen.clear()
    process = example(operator)
    try:
        assert operator.wait_for(lambda: process.poll() is not None, LONGEST)
        output, complaint = process.communicate(timeout=5.0)
    finally:
        process.kill()
    assert (process.returncode, complaint) == (0, "")
    moves = [line for line in output.splitlines() if "steps lost" in line]
    assert [line.split(":")[0] for line in moves] == MOVES
    assert all(line.endswith(" 0 steps lost") for line in moves)
    assert not moves[3].startswith("around the post: straight")
    grips = [line for line in output.splitlines() if " mm, " in line]
    assert [line.split(":")[0] for line in grips] == ["open", "close", "open"]
    assert grips[1].endswith("holds part")
    assert grips[2].endswith("has let go of part")

    assert operator.wait_for(lambda: len(shafts) > 0 and shafts[-1].steps == shafts[-1].shaft, 3.0)
    assert max(errors) <= 0.5 + 1e-9
    assert not jumps(operator.arm, operator.seen)

    assert operator.wait_for(lambda: is_as_found(scenes[-1]), 3.0)
    first, last = parts(scenes)[0], parts(scenes)[-1]
    carried = next(item for item in reversed(parts(scenes)) if item.attached)
    assert (first.attached, carried.attached, last.attached) == (False, True, False)
    assert (first.gripped, carried.gripped, last.gripped) == (False, True, False)
    assert carried.frame == operator.arm.tool_frame
    assert last.frame == ""
    moved = np.subtract(last.pose.translation, first.pose.translation)
    assert np.allclose(moved, way_of_the_tool(operator), atol=HALF_STEPS)


def way_of_the_tool(operator: Operator) -> np.ndarray:
    """[m] from the state where the part is picked to the one where it is placed."""
    kinematics, states = Kinematics(operator.arm), operator.arm.named_states
    return kinematics.tool(states["ready"]).position - kinematics.tool(states["left"]).position


def test_ctrl_c_stops_the_arm_and_tidies_up(operator: Operator) -> None:
    scene = operator.node.latest(SCENE)
    assert operator.wait_for(lambda: scene.message is not None and is_as_found(scene.message), 3.0)
    process = example(operator)
    try:
        assert operator.wait_for(operator.is_moving, 20.0)
        process.send_signal(signal.SIGINT)
        assert operator.wait_for(lambda: process.poll() is not None, 10.0)
        _, complaint = process.communicate(timeout=5.0)
    finally:
        process.kill()
    assert process.returncode == 1
    assert complaint.splitlines()[-1].startswith("gemelo.errors.Interrupted: stopped by Ctrl-C: <Motion")
    assert "canceled in" in complaint.splitlines()[-1]
    assert operator.wait_for(lambda: is_as_found(scene.message) and not operator.is_moving(), 3.0)
