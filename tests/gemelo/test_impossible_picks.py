"""Things of a simulated cell that cannot be picked, or not be carried on: what is said, and what stays where it was."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import gemelo
from gemelo.api.simulation import SimulatedArm
from gemelo.libraries.arm.cell.camera_file import CAMERA_FILE, write_measured
from gemelo.libraries.arm.cell.camera_model import exact_info
from gemelo.libraries.arm.cell.cell_file import load_cell
from gemelo.libraries.arm.model.description import load_arm
from gemelo.schemas.cell import MeasuredCamera, Mount
from gemelo.schemas.topics import camera_truth

BIN, RED = (0.1, 0.3), (0.3, -0.12)  # [m] of rm1's sample cell: the place, and where the red block stands
ASTRAY = 0.04  # [m]
MORE = """
[[place]]
name = "far"
kind = "pose"
position = [0.9, 0.1, 0.06]

[[thing]]  # which is nowhere
name = "ghost"
kind = "tag"
id = 7
size = 0.028

[[thing]]  # whose grasp is beside it
name = "beside"
kind = "tag"
id = 8
size = 0.028
box = [0.03, 0.03, 0.04]
grasp_offset = [0.0, -0.06, -0.012]
position = [0.24, 0.02, 0.04]
"""


@pytest.fixture
def astray(tmp_path: Path, rm1_folder: Path) -> Iterator[SimulatedArm]:
    """rm1's cell without its fixed tags, with a camera that stands 40 mm beside where camera.toml has it."""
    path = tmp_path / "cell.toml"
    text = (rm1_folder / "cell.toml").read_text()
    path.write_text(re.sub(r"\[\[tag\]\].*?(?=\[\[thing)", "", text, flags=re.DOTALL) + MORE)
    arm = load_arm(rm1_folder)
    (record,) = load_cell(path, arm).cameras
    info = exact_info(record, arm.base_frame)
    x, y, z = info.parent_from_camera.translation
    mount = Mount(parent=info.parent, position=(x, y + ASTRAY, z), rotation=info.parent_from_camera.rotation)
    write_measured(path.with_name(CAMERA_FILE), [MeasuredCamera(name=record.name, mount=mount)])
    with gemelo.simulate("rm1", cell=path) as simulated:
        yield simulated


def test_what_cannot_be_picked_is_refused_or_aborted_with_its_reason(astray: SimulatedArm) -> None:
    """Above all what stays where it was: rm1's jaws measure nothing, and can only say what is believed of them."""
    arm = astray
    arm.move(named="folded")
    assert arm.detect("red_block")[0].pose.position[1] == pytest.approx(RED[1] + ASTRAY, abs=2e-3)
    with pytest.raises(gemelo.Aborted, match=r"red_block was not picked: it still stands at .*: is the camera where"):
        arm.pick("red_block", to="bin")
    assert "red_block" not in arm.scene.objects
    truth = arm.node.latest(camera_truth("overhead"))
    asked = arm.node.now()
    assert arm.wait_for(lambda: truth.message is not None and truth.message.stamp > asked, 3.0)
    (red,) = [item for item in truth.message.items if item.name == "red_block"]
    assert red.base_from_thing.translation[:2] == pytest.approx(RED)


def test_a_thing_that_cannot_be_carried_on_is_said_to_be_between_the_jaws(rm1_folder: Path) -> None:
    """What stands in the bin is below the jaws, and in the way of the cup that they carry."""
    with gemelo.simulate("rm1", cell=rm1_folder / "cell.toml") as arm:
        arm.move(named="ready")
        arm.scene.add_box("full", (0.04, 0.04, 0.07), at=(*BIN, 0.035))
        with pytest.raises(gemelo.Aborted, match=r"cup was picked and is still between the jaws: .*full"):
            arm.pick("cup", to="bin")
        assert arm.scene.objects["cup"].attached
        arm.scene.remove("full")
        arm.grip("open")
        arm.scene.remove("cup")
