"""Pick and place on both arms, simulated: to the step, around the post, and tidied up."""

from __future__ import annotations

import runpy
import signal
from collections.abc import Iterator

import numpy as np
import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.libraries.arm.kinematics.kinematics import Kinematics
from gemelo.schemas.frames import Transform
from gemelo.schemas.joints import JointState
from gemelo.schemas.scene import BoxShape, PlanningScene, SceneAdd, SceneObject
from gemelo.schemas.topics import DEVICE_SHAFT, JOINT_STATES, SCENE, STEP_ERRORS
from tests.simulated import found_by_connect, is_moving
from tests.stack.person import jumps

pytestmark = pytest.mark.full

MOVES = ["above the part", "down", "up", "around the post", "down", "up", "home"]
HALF_STEPS = 0.004  # [m] that half a step of every joint may turn the part away, and the tool with it
SHELF = SceneObject(
    name="shelf", shape=BoxShape(size=(0.1, 0.1, 0.1)), pose=Transform(translation=(-0.8, -0.8, 0.3)), padding=0.01
)


EXAMPLE = "examples/09_pick_and_place.py"


@pytest.fixture(scope="module", params=["rm1", "parol6"])
def arm(request: pytest.FixtureRequest) -> Iterator[SimulatedArm]:
    with gemelo.simulate(request.param) as simulated, found_by_connect(simulated):
        simulated.scene.edit(SceneAdd(object=SHELF))
        yield simulated


def is_as_found(scene: PlanningScene) -> bool:
    return scene.objects == (SHELF,) and scene.allowed == ()


def parts(scenes: list[PlanningScene]) -> list[SceneObject]:
    """The part in every version that has it."""
    return [item for scene in scenes for item in scene.objects if item.name == "part"]


def test_the_part_stands_where_it_was_to_go_and_no_step_is_lost(
    arm: SimulatedArm, capsys: pytest.CaptureFixture[str]
) -> None:
    scenes: list[PlanningScene] = []
    errors: list[float] = []
    seen: list[JointState] = []
    arm.node.subscribe(SCENE, scenes.append)
    arm.node.subscribe(STEP_ERRORS, lambda message: errors.append(max(map(abs, message.error))))
    arm.node.subscribe(JOINT_STATES, seen.append)
    shaft = arm.node.latest(DEVICE_SHAFT)
    runpy.run_path(EXAMPLE)
    output, complaint = capsys.readouterr()
    assert complaint == ""
    moves = [line for line in output.splitlines() if "steps lost" in line]
    assert [line.split(":")[0] for line in moves] == MOVES
    assert all(line.endswith(" 0 steps lost") for line in moves)
    assert not moves[3].startswith("around the post: straight")
    grips = [line for line in output.splitlines() if " mm, " in line]
    assert [line.split(":")[0] for line in grips] == ["open", "close", "open"]
    assert grips[1].endswith("holds part")
    assert grips[2].endswith("has let go of part")

    assert arm.wait_for(lambda: shaft.message is not None and shaft.message.steps == shaft.message.shaft, 3.0)
    assert max(errors) <= 0.5 + 1e-9
    assert not jumps(arm.description, seen)

    assert arm.wait_for(lambda: is_as_found(scenes[-1]), 3.0)
    first, last = parts(scenes)[0], parts(scenes)[-1]
    carried = next(item for item in reversed(parts(scenes)) if item.attached)
    assert (first.attached, carried.attached, last.attached) == (False, True, False)
    assert (first.gripped, carried.gripped, last.gripped) == (False, True, False)
    assert carried.frame == arm.tool_frame
    assert last.frame == ""
    moved = np.subtract(last.pose.translation, first.pose.translation)
    assert np.allclose(moved, way_of_the_tool(arm), atol=HALF_STEPS)


def way_of_the_tool(arm: SimulatedArm) -> np.ndarray:
    """[m] from the state where the part is picked to the one where it is placed."""
    kinematics, states = Kinematics(arm.description), arm.description.named_states
    return kinematics.tool(states["ready"]).position - kinematics.tool(states["left"]).position


def test_ctrl_c_stops_the_arm_and_tidies_up(arm: SimulatedArm) -> None:
    assert is_as_found(arm.scene.present)
    presses: list[float] = []

    def press_once(state: JointState) -> None:
        if not presses and any(abs(speed) > 1e-3 for speed in state.velocity):
            presses.append(arm.sim.now)
            signal.raise_signal(signal.SIGINT)

    pressing = arm.node.subscribe(JOINT_STATES, press_once)
    with pytest.raises(gemelo.Interrupted, match=r"^stopped by Ctrl-C: <Motion .* canceled in"):
        runpy.run_path(EXAMPLE)
    pressing.close()
    assert presses
    assert not is_moving(arm)
    assert is_as_found(arm.scene.present)
